"""Manoeuvres: what they do to a belief, by law, in every estimator and in simulation."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

import piazzi as pz
from piazzi import kernels
from tests.solvers import orbits

pytestmark = pytest.mark.usefixtures("uncompiled")

DV, SPREAD = np.array([3.0, -2.0]), np.array([[0.04, 0.01], [0.01, 0.09]])
SOLVERS = [kernels.RungeKutta4(6), kernels.Taylor(6), kernels.Kepler(), kernels.DormandPrince(1e-12)]


def burn(time, dv=DV, spread=SPREAD, **more):
    return pz.Manoeuvre(time, dv, spread, **more)


def jump(dv=DV, spread=SPREAD):
    """Change of mean and covariance of [x, y, vx, vy]."""
    return np.array([0, 0, *dv]), np.block([[np.zeros((2, 2)), np.zeros((2, 2))], [np.zeros((2, 2)), spread]])


@pytest.mark.parametrize("solver", SOLVERS, ids=lambda s: type(s).__name__)
@pytest.mark.parametrize("method", ["scaled", "integral"])
@pytest.mark.parametrize("at", [100.0, 37.3, 300.0])
def test_belief_after_is_predicted_jumped_and_predicted_on(solver, method, at):
    """Coast to the manoeuvre, add delta-v to the mean and its covariance to the velocity's, and coast on.

    Noise Q dt enters at the end of the interval, as without a manoeuvre; integrated noise enters along both parts.
    """
    noise = pz.ProcessNoise([0.1, 0.1, 1e-4, 1e-4], "second", method)
    # parts of an interval get their share of its substeps: lengths that divide both parts give the same steps
    solver = replace(
        solver, substeps=None, max_step=10.0 if at == 37.3 and solver.chooses_steps else 0.1 if at == 37.3 else 50.0
    )
    problem = orbits.orbit(2, solver, process_noise=noise, manoeuvres=[burn(at)])
    coasting = orbits.orbit(2, solver, process_noise=noise)
    found = pz.predict(problem, problem.prior, 0.0, 300.0)
    before = pz.predict(coasting, coasting.prior, 0.0, at)
    dx, C = jump()
    belief = pz.Gaussian(before.mean + dx, before.covariance + C)
    if at < 300.0:
        after = pz.predict(coasting, belief, at, 300.0 - at)
        mean, Phi2, Q2 = after.mean, after.Phi, after.Q
    else:
        mean, Phi2, Q2 = belief.mean, np.eye(4), np.zeros((4, 4))
    P = Phi2 @ (before.Phi @ problem.covariance @ before.Phi.T + C) @ Phi2.T
    P += 300.0 * np.diag([0.1, 0.1, 1e-4, 1e-4]) if method == "scaled" else Phi2 @ before.Q @ Phi2.T + Q2
    size = np.sqrt(np.diag(P))
    assert_allclose(found.mean, mean, rtol=1e-11)
    # a closed form or an adaptive one takes other panels for the integral
    tolerance = 1e-6 if method == "integral" and solver.chooses_steps else 1e-11
    assert_allclose(found.covariance / np.outer(size, size), P / np.outer(size, size), rtol=0, atol=tolerance)


def test_delta_v_with_covariance_is_added_to_the_velocity_s():
    """Without process noise the covariance after is exactly Phi2 (Phi1 P Phi1' + C) Phi2'."""
    problem = orbits.orbit(2, kernels.Kepler(), manoeuvres=[burn(100.0)])
    predicted = pz.predict(problem, problem.prior, 0.0, 300.0)
    plain = orbits.orbit(2, kernels.Kepler())
    x, Phi1 = plain.step(problem.mean, 100.0)
    dx, C = jump()
    x, Phi2 = plain.step(x + dx, 200.0)
    P = Phi2 @ (Phi1 @ problem.covariance @ Phi1.T + C) @ Phi2.T
    assert_allclose(predicted.mean, x, rtol=1e-14)
    assert_allclose(predicted.covariance, P, rtol=1e-11)
    assert_allclose(predicted.Phi, Phi2 @ Phi1, rtol=1e-11)
    assert_allclose(predicted.Q, Phi2 @ C @ Phi2.T, rtol=1e-11, atol=1e-12)


def test_a_manoeuvre_of_nothing_changes_nothing():
    times = [0.0, 60.0, 200.0, 300.0]
    for method in ("scaled", "integral"):
        noise = pz.ProcessNoise([0.1, 0.1, 1e-4, 1e-4], "second", method)
        plain = orbits.orbit(2, kernels.Kepler(substeps=50), process_noise=noise)
        with_one = replace(plain, manoeuvres=[pz.Manoeuvre(123.0, [0.0, 0.0])])
        tracking = pz.simulate(plain, times, np.random.default_rng(0))
        a, b = (pz.ExtendedKalmanFilter().estimate(p, tracking) for p in (plain, with_one))
        assert_allclose(b.mean, a.mean, rtol=1e-12)
        assert_allclose(b.covariance, a.covariance, rtol=1e-6)


@pytest.mark.parametrize("times", [[0.0, 0.1, 0.2, 0.1 + 0.2, 0.7], [0.0, 1e6 + 0.1, 1e6 + 0.3]])
def test_a_manoeuvre_at_an_epoch_happens_once_and_before_it(times):
    """Also where the sum of the intervals is not the time by a rounding."""
    model = pz.Model(["x", "v"], ["v", "0"], [pz.Sensor("s", ["x"])], groups={"velocity": ["v"]})
    for k in range(1, len(times)):
        for nudge in (-1, 0, 1):
            at = times[k] * (1 + nudge * 2.0**-52)
            problem = pz.Problem(
                model, pz.Gaussian([0, 0], np.zeros((2, 2))), None, [pz.Station("a", "s", 1.0)], integrator=pz.RungeKutta4(3),
                manoeuvres=[pz.Manoeuvre(at, [1.0])],
            )  # fmt: skip
            truth = pz.simulate(problem, times, np.random.default_rng(0)).truth
            assert_allclose(truth[:, 1], np.arange(len(times)) >= k, rtol=0, atol=0)


def test_several_in_one_interval_in_any_order_and_of_any_state():
    model = pz.Model(["x", "v", "b"], ["v", "0", "0"], [pz.Sensor("s", ["x + b"])], groups={"velocity": ["v"]})
    moves = [
        pz.Manoeuvre(5.0, [-1.0]),
        pz.Manoeuvre(2.0, [1.0]),
        pz.Manoeuvre(2.0, [1.0]),
        pz.Manoeuvre(9.0, [7.0], 0.5, ["b"]),
    ]
    problem = pz.Problem(
        model, pz.Gaussian([0, 0, 0], np.zeros((3, 3))), stations=[pz.Station("a", "s", 1.0)], manoeuvres=moves,
        integrator=pz.RungeKutta4(7),
    )  # fmt: skip
    predicted = pz.predict(problem, problem.prior, 0.0, 10.0)
    assert_allclose(predicted.mean, [2 * 3 + 1 * 5, 1.0, 7.0], rtol=1e-14)
    assert_allclose(predicted.covariance, np.diag([0, 0, 0.5]), atol=1e-15)


def test_simulated_errors_of_the_engine_have_its_covariance():
    prior = pz.Gaussian(orbits.state(2, 0.1), np.zeros(4))
    problem = orbits.orbit(2, kernels.Kepler(), prior=prior, manoeuvres=[burn(60.0)])
    truth = np.array([pz.simulate(problem, [0.0, 60.0], np.random.default_rng(s)).truth[1] for s in range(400)])
    coasted, _ = orbits.orbit(2, kernels.Kepler()).step(problem.mean, 60.0)
    off = truth - coasted
    assert_allclose(off[:, :2], 0, atol=1e-6)
    assert_allclose(off[:, 2:].mean(axis=0), DV, atol=4 * np.sqrt(np.diag(SPREAD) / 400).max())
    assert_allclose(np.cov(off[:, 2:].T), SPREAD, atol=0.35 * SPREAD.max())


@pytest.mark.parametrize("spread", [SPREAD, None], ids=["uncertain", "exact"])
@pytest.mark.parametrize("method", ["scaled", "integral"])
def test_estimators_agree_across_manoeuvres(spread, method):
    """At irregular times: window of one = EKF; window of all, iterated = graph at the last state; errors are as claimed."""
    times = np.cumsum(np.random.default_rng(0).uniform(20, 120, 14))
    moves = [burn(times[3], spread=spread), burn(times[6] + 1.0, -DV, spread), burn(times[6] + 2.0, DV, spread)]
    noise = pz.ProcessNoise([1.0, 1.0, 1e-4, 1e-4], "second", method)
    problem = orbits.orbit(2, kernels.RungeKutta4(4), process_noise=noise, manoeuvres=moves)
    tracking = pz.simulate(problem, times, np.random.default_rng(1))
    ekf = pz.ExtendedKalmanFilter().estimate(problem, tracking)
    one = pz.SlidingWindow(1).estimate(problem, tracking)
    assert_allclose(one.mean, ekf.mean, rtol=1e-12)
    graph = pz.FactorGraph(tolerance=1e-9).estimate(problem, tracking)
    window = pz.SlidingWindow(100, iterations=5).estimate(problem, tracking)
    sigma = np.sqrt(np.diag(graph.covariance[-1]))
    assert graph.success, graph.message
    assert np.abs((window.mean[-1] - graph.mean[-1]) / sigma).max() < 1e-8
    for estimate in (ekf, graph):
        error = estimate.mean - tracking.truth
        nees = np.einsum("ki,kij,kj->k", error, np.linalg.inv(estimate.covariance), error)
        assert nees.max() < 30


def test_one_measurement_at_a_time_across_a_manoeuvre():
    times = np.arange(8) * 50.0
    problem = orbits.orbit(2, kernels.RungeKutta4(4), manoeuvres=[burn(120.0)])
    tracking = pz.simulate(problem, times, np.random.default_rng(1))
    whole = pz.ExtendedKalmanFilter().estimate(problem, tracking)
    live = pz.ExtendedKalmanFilter().start(problem)
    for k, t in enumerate(times):
        live.update("centre", tracking.values[k], t)
        assert_allclose(live.mean, whole.mean[k], rtol=1e-14)


def test_an_unknown_manoeuvre_is_found_by_who_knows_of_it():
    """Mismatch: the truth burns, and only one of the two filters was told."""
    noise = pz.ProcessNoise([0.0, 0.0, 1e-6, 1e-6])
    told = orbits.orbit(2, kernels.Kepler(), process_noise=noise, manoeuvres=[burn(500.0, [30.0, 30.0])])
    untold = replace(told, manoeuvres=(), truth=pz.Truth(manoeuvres=told.manoeuvres))
    tracking = pz.simulate(untold, np.arange(40) * 60.0, np.random.default_rng(0))
    again = pz.simulate(told, np.arange(40) * 60.0, np.random.default_rng(0))
    assert_allclose(tracking.truth, again.truth, rtol=0)
    error = [
        np.abs(pz.ExtendedKalmanFilter().estimate(p, tracking).mean - tracking.truth)[-1, :2].max() for p in (told, untold)
    ]
    assert error[0] < 0.1 * error[1]


@pytest.mark.parametrize(
    ("move", "message"),
    [
        (pz.Manoeuvre(np.nan, DV), "time of manoeuvre 0 is nan"),
        (pz.Manoeuvre(1.0, [1.0]), "delta_v of the manoeuvre at 1 s has 1 values; it needs 2"),
        (pz.Manoeuvre(1.0, [1.0, np.inf]), "delta_v of the manoeuvre at 1 s of 'vy' is inf"),
        (pz.Manoeuvre(1.0, DV, -SPREAD), "covariance of the manoeuvre at 1 s must be positive semidefinite"),
        (pz.Manoeuvre(1.0, DV, states="thrust"), "'thrust', which is not a group"),
        (pz.Manoeuvre(1.0, DV, states=["vx", "vq"]), "'vq', which is not a state"),
    ],
)
def test_bad_manoeuvres_are_refused(move, message):
    with pytest.raises(ValueError, match=message):
        orbits.orbit(2, kernels.Kepler(), manoeuvres=[move])


def test_a_manoeuvre_before_the_prior_is_refused():
    problem = orbits.orbit(2, kernels.Kepler(), manoeuvres=[burn(10.0)])
    with pytest.raises(ValueError, match="the manoeuvre at 10 s is not after the prior at 10 s"):
        pz.simulate(problem, [10.0, 20.0], np.random.default_rng(0))


def test_a_discrete_model_cannot_be_interrupted():
    model = pz.Model(["x"], ["x"], [pz.Sensor("s", ["x"])], discrete=True)
    with pytest.raises(ValueError, match="manoeuvres need a continuous model"):
        pz.Problem(model, pz.Gaussian([0.0], [1.0]), manoeuvres=[pz.Manoeuvre(1.0, [1.0], states=["x"])])


# ---- within rounding of an epoch -------------------------------------------------------------------------------------

GRIDS = {
    "from zero": 0.1 * np.arange(6),
    "before zero": -0.3 + 0.1 * np.arange(6),
    "across a zero that is none": -333.3 + 111.1 * np.arange(6),
    "far before zero": -1e6 + 15.0 * np.arange(6),
    "far after zero": 1e9 + 15.0 * np.arange(6),
    "uneven": np.cumsum([0.1, 0.2, 1e3, 1e-3, 0.7, 1e5]),
}


def happened(problem, times) -> list[np.ndarray]:
    """How often the velocity has jumped at each epoch: in simulation, filters, smoother, graph, live, and by one forecast."""
    tracking = pz.Tracking(times, np.zeros(len(times)))
    ekf = pz.ExtendedKalmanFilter()
    whole = [e.estimate(problem, tracking) for e in (ekf, pz.SquareRootKalmanFilter(), pz.Smoother(), pz.FactorGraph())]
    live, window = ekf.start(problem), pz.SlidingWindow(len(times)).start(problem)
    means = []
    for t in times:
        for session in (live, window):
            session.update("a", 0.0, t)
        means.append([live.mean[1], window.mean[1]])
    first = ekf.estimate(problem, pz.Tracking(times[:1], [0.0]))
    ahead = np.append(0.0, first.predict(times[1:]).mean[:, 1])
    return [
        pz.simulate(problem, times, np.random.default_rng(0)).truth[:, 1],
        *(e.mean[:, 1] for e in whole),
        *np.array(means).T,
        ahead,
    ]


@pytest.mark.parametrize("grid", GRIDS)
def test_within_rounding_of_an_epoch_it_happens_once_and_at_that_epoch(grid):
    """At it, one and two units in the last place beside it, and just within what counts as the same time."""
    times = GRIDS[grid]
    model = pz.Model(["x", "v"], ["v", "0"], [pz.Sensor("s", ["x"])], groups={"velocity": ["v"]})
    for k in range(1, len(times)):
        at = [times[k]]
        for direction in (-np.inf, np.inf):
            one = np.nextafter(times[k], direction)
            at += [one, np.nextafter(one, direction)]
        slack = 1e-12 * max(abs(times[k]), 1.0)
        at += [times[k] - 0.9 * slack, times[k] + 0.9 * slack]
        for when in at:
            problem = pz.Problem(
                model, pz.Gaussian([0, 0], np.zeros((2, 2))), None, [pz.Station("a", "s", 1.0)],
                integrator=pz.RungeKutta4(3), manoeuvres=[pz.Manoeuvre(when, [1.0])],
            )  # fmt: skip
            for jumps in happened(problem, times):
                assert_allclose(jumps, np.arange(len(times)) >= k, rtol=0, atol=0, err_msg=f"{when!r} at {times[k]!r}")


@pytest.mark.parametrize("factor", [1.1, 3.0, 30.0])
@pytest.mark.parametrize("grid", GRIDS)
def test_a_little_after_an_epoch_it_happens_once_in_the_next_interval(grid, factor):
    times = GRIDS[grid]
    model = pz.Model(["x", "v"], ["v", "0"], [pz.Sensor("s", ["x"])], groups={"velocity": ["v"]})
    for k in range(1, len(times) - 1):
        when = times[k] + factor * 1e-12 * max(abs(times[k]), 1.0)
        problem = pz.Problem(
            model, pz.Gaussian([0, 0], np.zeros((2, 2))), None, [pz.Station("a", "s", 1.0)],
            integrator=pz.RungeKutta4(3), manoeuvres=[pz.Manoeuvre(when, [1.0])],
        )  # fmt: skip
        for jumps in happened(problem, times):
            assert_allclose(jumps, np.arange(len(times)) >= k + 1, rtol=0, atol=0, err_msg=f"{when!r} after {times[k]!r}")


@pytest.mark.parametrize("start", [0.0, -333.3, 1e6])
def test_within_rounding_of_the_prior_it_is_refused_by_whole_runs_and_live(start):
    for when in (start, np.nextafter(start, np.inf), start + 0.9e-12 * max(abs(start), 1.0), start - 1.0):
        for prior_time in (None, start):
            problem = orbits.orbit(2, kernels.Kepler(), manoeuvres=[burn(when)], prior_time=prior_time)
            with pytest.raises(ValueError, match="is not after the prior"):
                pz.ExtendedKalmanFilter().estimate(problem, pz.Tracking([start, start + 9.0], [7e6, 7e6]))
            for estimator in (pz.ExtendedKalmanFilter(), pz.UnscentedKalmanFilter(), pz.SlidingWindow(3)):
                with pytest.raises(ValueError, match="is not after the prior"):
                    estimator.start(problem).update("centre", 7e6, start)
