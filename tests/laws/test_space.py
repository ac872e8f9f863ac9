"""A satellite in space: field of degree 20, Sun and Moon from tables, sunlight and shadow, range by light time, own force.

Every estimator runs on it, and they agree as their laws say; what it costs to derive.
"""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from numpy.testing import assert_allclose

import piazzi as pz
from piazzi.earth.gravity import Gravity
from piazzi.kernels.generate import model_source
from piazzi.model.functions import Signature
from piazzi.outside.table import Table
from piazzi.study.ensemble import Layout, filter_runs, simulate_runs

SPIN, C = 7.292115e-5, 299792458.0
TIMES = np.arange(-90000.0, 100000.0, 300.0)
STATES = ["x", "y", "z", "vx", "vy", "vz"]


def turned(t):
    """Axes of the Earth by rows, (..., 9)."""
    c, s, one = np.cos(SPIN * t), np.sin(SPIN * t), np.ones_like(t)
    return np.stack([c, s, 0 * t, -s, c, 0 * t, 0 * t, 0 * t, one], axis=-1)


class Turn:
    """A rotation from a table of its matrix."""

    table = Table(TIMES, turned(TIMES))
    span, checksum = table.span, table.checksum

    def __init__(self, back):
        self.back = back
        self.signature = Signature("rotation", 4, 3, (), self.table.terms, transposed=back, shared="turn")

    def block(self, first, last):
        return self.table.block(first, last)

    def value(self, t, *r):
        W = turned(np.float64(t)).reshape(3, 3)
        return tuple((W.T if self.back else W) @ np.array(r))


class Ground:
    """A station that the Earth carries along."""

    signature, span, checksum = Signature.of_station(), None, "ground"

    def __init__(self, r):
        p = np.einsum("kij,i->kj", turned(TIMES).reshape(-1, 3, 3), np.array(r))
        self.table = Table(TIMES, np.hstack([p, np.cross([0.0, 0.0, SPIN], p)]))

    def block(self, first, last):
        return self.table.block(first, last)

    def value(self, t):
        return self.table.value(t)


def third(body, mu):
    """Definitions of what a third body does."""
    out = {", ".join(body + a for a in "xyz"): f"{body}(t)"}
    out[f"{body}_far"] = f"({body}x**2 + {body}y**2 + {body}z**2)**1.5"
    out[f"{body}_near"] = "(" + " + ".join(f"({body}{a} - {a})**2" for a in "xyz") + ")**1.5"
    return out | {f"{body}a{a}": f"{mu}*(({body}{a} - {a})/{body}_near - {body}{a}/{body}_far)" for a in "xyz"}


def circle(radius, rate):
    return Table(TIMES, radius * np.stack([np.cos(rate * TIMES), np.sin(rate * TIMES), 0.1 + 0 * TIMES], -1))


@cache
def satellite(degree=20, Q=0.0, thrust="thrust*v{a}/speed"):
    functions = {
        "field": Gravity("EGM2008", degree=degree),
        "fixed": Turn(False),
        "free": Turn(True),
        "sun": circle(1.496e11, 2e-7),
        "moon": circle(3.84e8, 2.66e-6),
    }
    definitions = {
        "bx, by, bz": "fixed(t, x, y, z)",
        "gx, gy, gz": "field(bx, by, bz)",
        "ax, ay, az": "free(t, gx, gy, gz)",
        **third("sun", 1.32712440018e20),
        **third("moon", 4.9028e12),
        "speed": "sqrt(vx**2 + vy**2 + vz**2)",
        "sun_d": "sqrt(sunx**2 + suny**2 + sunz**2)",
        "along": "(x*sunx + y*suny + z*sunz)/sun_d",
        "edge": "sqrt(x**2 + y**2 + z**2 - along**2) - 6378137.0",  # from the shadow's edge, a cylinder behind the Earth
        "lit": "1 - (0.5 - 0.5*tanh(edge/2e4))*(0.5 - 0.5*tanh(along/1e5))",
        "light": "-9e-8*lit/sun_d",
    }
    dynamics = {"x": "vx", "y": "vy", "z": "vz"}
    dynamics |= {f"v{a}": f"a{a} + suna{a} + moona{a} + light*sun{a} + {thrust.format(a=a)}" for a in "xyz"}
    light = {
        "root": f"rho/{C} - tau",
        "definitions": {
            "rx, ry, rz": "at(-tau, order=2)",
            "qx, qy, qz": "station(t)",
            "rho": "sqrt((rx - qx)**2 + (ry - qy)**2 + (rz - qz)**2)",
        },
    }
    model = pz.Model(
        STATES,
        dynamics,
        pz.Sensor("range", {"distance": "rho"}, roots={"tau": light}),
        ["thrust"],
        {"position": STATES[:3], "velocity": STATES[3:]},
        definitions=definitions,
        functions=functions,
    )
    prior = pz.Gaussian([7e6, 0.0, 0.0, 0.0, 5.3e3, 5.3e3], [1e4] * 3 + [1.0] * 3)
    places = {"a": (4.1e6, 1.0e6, 4.76e6), "b": (-2.0e6, 5.0e6, 3.3e6)}
    stations = [pz.Station(name, "range", 1.0, place=Ground(r)) for name, r in places.items()]
    noise = pz.ProcessNoise([0.0] * 3 + [Q] * 3, "second", "scaled")
    return pz.Problem(model, prior, noise, stations, {"thrust": 1e-6}, pz.RungeKutta4(2), 0.0, functions=functions)


@cache
def tracked(Q=0.0):
    return pz.simulate(satellite(Q=Q), np.arange(0.0, 3000.0, 30.0), np.random.default_rng(1))


def test_the_gradient_of_all_forces_is_their_derivative():
    problem, x = satellite(), np.array([6.9e6, 1.1e6, -0.7e6, 1.0e3, 5.3e3, 5.1e3])
    steps = np.diag([1000.0] * 3 + [1.0] * 3)
    F = problem.dynamics_jacobian(x, 1234.5)
    for j, h in enumerate(steps):
        near, far = (
            (problem.dynamics(x + k * h, 1234.5) - problem.dynamics(x - k * h, 1234.5)) / (2 * k * h[j]) for k in (1, 2)
        )
        assert_allclose(F[:3, j], near[:3], atol=1e-12)
        assert_allclose(F[3:, j], ((4 * near - far) / 3)[3:], atol=1e-8 * np.abs(F[3:, :3]).max(), rtol=1e-6)


def test_light_time_is_that_of_an_iteration_along_the_orbit():
    problem, t = satellite(), 777.0
    x = np.array([6.9e6, 1.1e6, -0.7e6, 1.0e3, 5.3e3, 5.1e3])
    q, tau = np.array(problem.stations[0].place.value(t)[:3]), 0.0
    for _ in range(20):
        before = problem.step(x, -tau, t)[0] if tau else x
        tau = np.linalg.norm(before[:3] - q) / C
    assert_allclose(problem.measure("a", x, t)[0], C * tau, atol=1e-6)
    H = problem.measurement_jacobian("a", x, t)[0]
    h = np.array([100.0] * 3 + [1.0] * 3)
    slopes = [(problem.measure("a", x + d, t) - problem.measure("a", x - d, t))[0] / (2 * d.max()) for d in np.diag(h)]
    assert_allclose(H, slopes, rtol=1e-6, atol=1e-7)  # a kilometre of range is known to 1e-10 m


@pytest.mark.slow  # kernels of 40 s; uncompiled, they are compared below
@pytest.mark.parametrize("Q", [0.0, 1e-10])
def test_all_estimators_find_the_orbit_and_agree(Q):
    problem, tracking = satellite(Q=Q), tracked(Q)
    estimators = [pz.ExtendedKalmanFilter(), pz.Smoother(), pz.FactorGraph(), pz.SlidingWindow(15), pz.UnscentedKalmanFilter()]
    estimators += [] if Q else [pz.BatchLeastSquares()]
    graph = pz.FactorGraph().estimate(problem, tracking)
    for estimator in estimators:
        assert_found(estimator.estimate(problem, tracking), tracking, graph)


def assert_found(found, tracking, graph):
    """The last state is the truth, and the graph's."""
    assert found.success, found.message
    sigma = np.sqrt(np.diagonal(found.covariance[-1]))
    assert np.abs((found.mean[-1] - tracking.truth[-1]) / sigma).max() < 4.5
    assert np.abs((found.mean[-1] - graph.mean[-1]) / sigma).max() < 0.5


@pytest.mark.slow
def test_a_window_of_one_is_the_filter():
    problem, tracking = satellite(Q=1e-10), tracked(1e-10)
    window = pz.SlidingWindow(1, iterations=1).estimate(problem, tracking)
    whole = pz.ExtendedKalmanFilter().estimate(problem, tracking)
    sigma = np.sqrt(np.diagonal(whole.covariance, axis1=1, axis2=2))
    assert np.abs((window.mean - whole.mean) / sigma).max() < 1e-4


def test_a_live_session_is_the_whole_run():
    problem, tracking = satellite(Q=1e-10), tracked(1e-10)
    whole = pz.ExtendedKalmanFilter().estimate(problem, tracking)
    live = pz.ExtendedKalmanFilter().start(problem)
    for k, t in enumerate(tracking.times[:20]):
        for s, station in enumerate("ab"):
            live.update(station, tracking.padded(1)[2 * k + s], t)
        sigma = np.sqrt(np.diag(whole.covariance[k]))
        assert_allclose(live.mean / sigma, whole.mean[k] / sigma, atol=1e-9)


def close_by(Q=1e-10):
    """The same with a prior so narrow that all is linear: the next order is 1e-6 of it."""
    prior = pz.Gaussian([7e6, 0.0, 0.0, 0.0, 5.3e3, 5.3e3], [1.0] * 3 + [1e-6] * 3)
    return replace(satellite(Q=Q), prior=prior)


@pytest.mark.slow
def test_where_all_is_linear_the_graph_is_the_smoother():
    problem = close_by()
    tracking = pz.simulate(problem, np.arange(0.0, 3000.0, 30.0), np.random.default_rng(2))
    smoother, graph = pz.Smoother().estimate(problem, tracking), pz.FactorGraph().estimate(problem, tracking)
    whole = pz.ExtendedKalmanFilter().estimate(problem, tracking)
    sigma = np.sqrt(np.diagonal(smoother.covariance, axis1=1, axis2=2))
    assert np.abs((graph.mean - smoother.mean) / sigma).max() < 1e-3
    scale = sigma[:, :, None] * sigma[:, None]
    assert_allclose(graph.covariance / scale, smoother.covariance / scale, atol=1e-4)
    assert_allclose(smoother.mean[-1], whole.mean[-1], rtol=1e-12)
    batch = pz.BatchLeastSquares().estimate(close_by(0.0), tracking)
    still = pz.FactorGraph().estimate(close_by(0.0), tracking)
    assert np.abs((batch.mean - still.mean) / sigma).max() < 1e-3


def test_the_shadow_is_met():
    problem, tracking = satellite(), tracked()
    sun = np.array([problem.functions["sun"].value(t) for t in tracking.times])
    along = (tracking.truth[:, :3] * sun).sum(axis=1) / np.linalg.norm(sun, axis=1)
    edge = np.sqrt((tracking.truth[:, :3] ** 2).sum(axis=1) - along**2) - 6378137.0
    dark = (along < 0) & (edge < 0)
    assert 0 < dark.sum() < len(dark)


def test_with_its_edge_as_an_event_they_agree_as_well(monkeypatch):
    """Steps end where the satellite leaves the shadow: another sum than without, but less than the noise of the answer."""
    monkeypatch.setenv("PIAZZI_JIT", "0")
    whole = satellite(degree=4, Q=1e-10)
    start = whole.step(whole.mean, 1620.0)[0]
    plain = replace(whole, prior=pz.Gaussian(start, [1e4] * 3 + [1.0] * 3), prior_time=1620.0)
    parted = replace(plain, model=replace(plain.model, events={"shadow": "edge"}))
    tracking = pz.simulate(plain, np.arange(1620.0, 1920.0, 30.0), np.random.default_rng(0))
    found = {}
    for estimator in (pz.ExtendedKalmanFilter(), pz.Smoother(), pz.FactorGraph(), pz.SlidingWindow(1, iterations=1)):
        one, other = (estimator.estimate(problem, tracking) for problem in (parted, plain))
        assert one.success and other.success, one.message
        sigma = np.sqrt(np.diagonal(other.covariance, axis1=1, axis2=2))
        assert 0.0 < np.abs((one.mean - other.mean) / sigma).max() < 0.05
        found[type(estimator).__name__] = one.mean
    sigma = np.sqrt(np.diagonal(one.covariance, axis1=1, axis2=2))
    assert np.abs((found["SlidingWindow"] - found["ExtendedKalmanFilter"]) / sigma).max() < 1e-3
    assert_allclose(found["Smoother"][-1], found["ExtendedKalmanFilter"][-1], rtol=1e-12)


def parted(Q):
    """The problem of degree 20 with the edge of its shadow as an event."""
    whole = satellite(Q=Q)
    return replace(whole, model=replace(whole.model, events={"shadow": "edge"}))


@pytest.mark.slow
@pytest.mark.parametrize("Q", [0.0, 1e-10])
def test_with_events_too_all_estimators_find_the_orbit_and_agree(Q):
    problem, tracking = parted(Q), tracked(Q)
    graph = pz.FactorGraph().estimate(problem, tracking)
    estimators = [pz.ExtendedKalmanFilter(), pz.Smoother(), graph, pz.SlidingWindow(15), pz.UnscentedKalmanFilter()]
    for estimator in [*estimators, pz.SquareRootKalmanFilter(), *([] if Q else [pz.BatchLeastSquares()])]:
        assert_found(graph if estimator is graph else estimator.estimate(problem, tracking), tracking, graph)


@pytest.mark.slow
def test_with_events_too_sessions_windows_and_studies_are_what_they_are():
    problem, tracking = parted(1e-10), tracked(1e-10)
    whole = pz.ExtendedKalmanFilter().estimate(problem, tracking)
    sigma = np.sqrt(np.diagonal(whole.covariance, axis1=1, axis2=2))
    window = pz.SlidingWindow(1, iterations=1).estimate(problem, tracking)
    assert np.abs((window.mean - whole.mean) / sigma).max() < 1e-4
    live = pz.ExtendedKalmanFilter().start(problem)
    for row, (t, station) in enumerate(zip(tracking.row_times, tracking.row_stations, strict=True)):
        live.update(station, tracking.values[row], t)
    assert_allclose(live.mean / sigma[-1], whole.mean[-1] / sigma[-1], atol=1e-9)
    runs = simulate_runs(Layout(problem, tracking.times), problem, *drawn(problem, len(tracking.times), 9))
    mean, _, scores = filter_runs(Layout(problem, tracking.times), runs[1], runs[0])
    for r, (truth, z) in enumerate(zip(*runs, strict=True)):
        alone = pz.ExtendedKalmanFilter().estimate(problem, replace(tracking, values=z, truth=truth))
        assert np.abs((mean[r] - alone.mean[-1]) / np.sqrt(np.diagonal(alone.covariance[-1]))).max() < 1e-6
    assert 2.0 < scores.nees.mean() < 12.0


def drawn(problem, epochs, runs):
    """First states of runs, and unit normal draws."""
    rng, n = np.random.default_rng(5), problem.model.n
    first = problem.mean + rng.standard_normal((runs, n)) * np.sqrt(np.diagonal(problem.covariance))
    return first, rng.standard_normal((runs, epochs, n)), rng.standard_normal((runs, 2 * epochs, 1))


@pytest.mark.slow
def test_a_study_runs_on_it(tmp_path):
    estimators = {"filter": pz.ExtendedKalmanFilter(), "smoother": pz.Smoother()}
    found = pz.Study(satellite(Q=1e-10), np.arange(0.0, 900.0, 30.0), estimators, runs=4).run(tmp_path / "s.nc", workers=1)
    assert all(found.row(0, row).success.all() for row in range(len(found.rows)))


def test_its_source_grows_with_its_definitions():
    def length(bodies):
        out = {"far": "x"} | {k: v for b in range(bodies) for k, v in third(f"body{b}", 1e20).items()}
        rates = [" + ".join(["far", *(f"body{b}a{a}" for b in range(bodies))]) for a in "xyz"]
        functions = {f"body{b}": circle(1e11 + b, 1e-7) for b in range(bodies)}
        return len(
            model_source(pz.Model(list("xyz"), rates, definitions=out, functions=functions), pz.RungeKutta4(1).scheme, 1)
        )

    few, some, many = (length(n) for n in (2, 4, 8))
    assert many - some < 2.2 * (some - few)


def test_another_degree_compiles_nothing_and_moves_the_orbit():
    low, high = satellite(degree=2), satellite()
    assert low.spec("transition", "rates") is high.spec("transition", "rates")
    apart = low.dynamics(low.prior.mean)[3:] - high.dynamics(low.prior.mean)[3:]
    assert 1e-6 < np.linalg.norm(apart) < 1e-3
