"""Process noise along radius, transverse and normal of the orbit."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

import piazzi as pz
from piazzi import kernels
from tests.solvers import orbits

pytestmark = pytest.mark.usefixtures("uncompiled")


def axes(x) -> np.ndarray:
    """Unit vectors along radius, transverse and (in space) normal as columns, by cross products."""
    d = len(x) // 2
    r, v = (np.append(a, 0.0) if d == 2 else a for a in (x[:d], x[d:]))
    radial = r / np.linalg.norm(r)
    normal = np.cross(r, v) / np.linalg.norm(np.cross(r, v))
    return np.column_stack([radial, np.cross(normal, radial), normal])[:d, :d]


def in_space(x, Q) -> np.ndarray:
    T = np.kron(np.eye(2), axes(x))
    return T @ Q @ T.T


def states(d):
    """Prograde and retrograde, on both sides."""
    out = [orbits.state(d, 0.1, nu) for nu in (0.3, 2.0, 4.0)]
    return out + [x * np.array([1.0] * d + [-1.0] * d) for x in out]


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("per", ["second", "step"])
def test_scaled_noise_turns_with_the_orbit(d, per):
    """At the end of the interval, where it enters."""
    Q = np.diag([1.0, 4.0, 9.0][:d] + [0.01, 0.04, 0.0][:d])
    Q[0, 1] = Q[1, 0] = 0.5
    for x in states(d):
        noise = pz.ProcessNoise(Q, per, "scaled", axes="orbit")
        problem = orbits.orbit(d, kernels.Kepler(), process_noise=noise, prior=pz.Gaussian(x, np.eye(2 * d)))
        predicted = pz.predict(problem, problem.prior, 0.0, 600.0)
        assert_allclose(predicted.Q, in_space(predicted.mean, Q) * (600.0 if per == "second" else 1.0), rtol=1e-11, atol=1e-12)


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize(
    "solver", [kernels.Kepler(substeps=30), kernels.RungeKutta8(30), kernels.DormandPrince(1e-12, max_step=20)]
)
def test_integrated_noise_turns_along_the_way(d, solver):
    """Against Simpson's rule over Kepler's motion, written out."""
    Q = np.diag([0.0, 0.0, 0.0][:d] + [1.0, 4.0, 9.0][:d])
    x = orbits.state(d, 0.1)
    noise = pz.ProcessNoise(Q, axes="orbit")
    problem = orbits.orbit(d, solver, process_noise=noise, prior=pz.Gaussian(x, np.eye(2 * d)))
    predicted = pz.predict(problem, problem.prior, 0.0, 600.0)
    motion = orbits.orbit(d, kernels.Kepler())
    after, _ = motion.step(x, 600.0)
    total, count = np.zeros((2 * d, 2 * d)), 60
    for i in range(count + 1):
        inside, _ = motion.step(x, 600.0 * i / count)
        _, E = motion.step(inside, 600.0 * (1 - i / count))
        weight = (1 if i in (0, count) else 4 if i % 2 else 2) * 600.0 / count / 3
        total += weight * E @ in_space(inside, Q) @ E.T
    scale = np.sqrt(np.outer(np.diag(total), np.diag(total)))
    assert_allclose(predicted.Q / scale, total / scale, rtol=0, atol=1e-6)
    assert_allclose(predicted.mean, after, rtol=1e-9)


def test_equal_noise_in_all_directions_has_no_axes():
    x = orbits.state(3, 0.3)
    Q = np.diag([2.0] * 3 + [0.5] * 3)
    results = []
    for a in ("states", "orbit"):
        problem = orbits.orbit(
            3, kernels.RungeKutta4(3), process_noise=pz.ProcessNoise(Q, axes=a), prior=pz.Gaussian(x, np.eye(6))
        )
        results.append(pz.predict(problem, problem.prior, 0.0, 100.0))
    assert_allclose(results[1].covariance, results[0].covariance, rtol=1e-12, atol=1e-9)


def test_a_circular_orbit_looks_the_same_from_everywhere():
    """Noise in the axes of the orbit, seen in them again, does not depend on where on a circle the satellite is."""
    Q = np.diag([1.0, 2.0, 0.01, 0.04])
    seen = []
    for nu in (0.0, 1.0, 3.0):
        x = orbits.state(2, 0.0, nu)
        problem = orbits.orbit(
            2, kernels.Kepler(), process_noise=pz.ProcessNoise(Q, axes="orbit"), prior=pz.Gaussian(x, np.eye(4))
        )
        predicted = pz.predict(problem, problem.prior, 0.0, 500.0)
        T = np.kron(np.eye(2), axes(predicted.mean))
        seen.append(T.T @ predicted.Q @ T)
    assert_allclose(seen[1], seen[0], rtol=1e-9)
    assert_allclose(seen[2], seen[0], rtol=1e-9)


def test_simulated_noise_has_these_axes():
    """Transverse noise only: the simulated state leaves the undisturbed one along the track."""
    Q = np.diag([0.0, 4.0, 0.0, 0.0])
    noise = pz.ProcessNoise(Q, "step", axes="orbit")
    x = orbits.state(2, 0.1)
    problem = orbits.orbit(2, kernels.Kepler(), process_noise=noise, prior=pz.Gaussian(x, np.zeros(4)))
    after, _ = problem.step(x, 300.0)
    off = []
    for seed in range(200):
        off.append(pz.simulate(problem, [0.0, 300.0], np.random.default_rng(seed)).truth[1] - after)
    along = np.array(off)[:, :2] @ axes(after)
    assert np.abs(along[:, 0]).max() < 1e-6
    assert 0.8 * 4 < np.var(along[:, 1]) < 1.2 * 4


def test_estimators_take_it_alike():
    """On a nonlinear problem with noise in orbit axes: window of one = EKF; window of all, iterated = graph."""
    times = np.cumsum(np.random.default_rng(0).uniform(20, 200, 12))
    for method in ("integral", "scaled"):
        noise = pz.ProcessNoise([1.0, 25.0, 1e-4, 1e-3], "second", method, "orbit")
        problem = orbits.orbit(2, kernels.RungeKutta4(4), process_noise=noise)
        tracking = pz.simulate(problem, times, np.random.default_rng(1))
        ekf = pz.ExtendedKalmanFilter().estimate(problem, tracking)
        one = pz.SlidingWindow(1).estimate(problem, tracking)
        assert_allclose(one.mean, ekf.mean, rtol=1e-12)
        graph = pz.FactorGraph(tolerance=1e-9).estimate(problem, tracking)
        window = pz.SlidingWindow(100, iterations=5).estimate(problem, tracking)
        sigma = np.sqrt(np.diag(graph.covariance[-1]))
        assert np.abs((window.mean[-1] - graph.mean[-1]) / sigma).max() < 1e-8


def test_a_model_without_orbit_is_refused():
    model = pz.Model(["q"], ["0"], [pz.Sensor("s", ["q"])])
    with pytest.raises(ValueError, match=r"axes of the orbit need groups position and velocity .* none"):
        pz.Problem(model, pz.Gaussian([0.0], [1.0]), pz.ProcessNoise([1.0], axes="orbit"))
    with pytest.raises(ValueError, match="axes is 'rtn'; it must be one of states, orbit"):
        pz.ProcessNoise([1.0], axes="rtn")
