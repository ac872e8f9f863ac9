"""Events: steps end where a definition passes zero, and the transition matrix has the jump of what switches there.

The oracles are closed forms: motion under accelerations that are constant on either side, and central differences of it.
"""

from dataclasses import fields
from math import sqrt

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import piazzi as pz
from piazzi.kernels import load_plain
from piazzi.kernels.generate import model_source
from piazzi.simulation import propagate
from piazzi.study import Study
from piazzi.study.ensemble import Layout, filter_runs, library, simulate_runs
from tests.laws.lanes import compared

BURN, IDLE, EDGE, SLANT = 3.0, 0.5, 2.0, 0.25


def cart(integrator=None, noise=0.0, events=("edge",), **changes):
    """A cart that a motor pushes harder beyond a line, which moves: the edge is x - EDGE + SLANT t."""
    model = pz.Model(
        states=["x", "v"],
        dynamics={"x": "v", "v": "a + b*(1 + sign(edge))/2"},
        sensors=pz.Sensor("ruler", ["x"]),
        parameters=["a", "b"],
        definitions={"edge": f"x - {EDGE} + {SLANT}*t"},
        events=events,
    )
    settings = {
        "prior": pz.Gaussian([0.0, 0.5], [0.04, 0.01]),
        "process_noise": pz.ProcessNoise([0.0, noise], method="integral"),
        "stations": pz.Station("ruler", "ruler", 1e-4),
        "parameters": {"a": IDLE, "b": BURN},
        "integrator": integrator or pz.RungeKutta4(3),
    }
    return pz.Problem(model, **(settings | changes))


def exact(x, duration, t=0.0):
    """Where the cart is, in closed form, if it begins before the line and goes on beyond it."""
    x0, v0 = x
    # x0 + v0 s + IDLE/2 s^2 = EDGE - SLANT (t + s)
    gap, speed = EDGE - SLANT * t - x0, v0 + SLANT
    s = (-speed + sqrt(speed**2 + 2 * IDLE * gap)) / IDLE
    s = min(s, duration)
    rest, x1, v1 = duration - s, x0 + v0 * s + IDLE / 2 * s**2, v0 + IDLE * s
    return np.array([x1 + v1 * rest + (IDLE + BURN) / 2 * rest**2, v1 + (IDLE + BURN) * rest])


def differences(flow, x, h=1e-5):
    """Central differences of order 4 of a flow by its first state."""
    x = np.asarray(x, dtype=float)
    columns = []
    for i in range(len(x)):
        e = h * np.eye(len(x))[i]
        columns.append((8 * (flow(x + e) - flow(x - e)) - (flow(x + 2 * e) - flow(x - 2 * e))) / (12 * h))
    return np.array(columns).T


INTEGRATORS = [
    pz.RungeKutta4(3),
    pz.RungeKutta8(1),
    pz.Midpoint(7),
    pz.ConstantAcceleration(2),
    pz.DormandPrince(),
    pz.RungeKutta4(max_step=0.4),
    pz.GaussJackson(max_step=0.1),
]


@pytest.mark.parametrize("integrator", INTEGRATORS, ids=lambda i: type(i).__name__)
def test_a_thrust_that_switches_and_its_transition_matrix(integrator):
    problem, x = cart(integrator), np.array([0.1, 0.6])
    y, Phi = problem.step(x, 3.0)
    assert_allclose(y, exact(x, 3.0), rtol=0, atol=1e-11)
    assert_allclose(Phi, differences(lambda x: exact(x, 3.0), x), rtol=0, atol=1e-9)
    back, Psi = problem.step(y, -3.0, 3.0)
    assert_allclose(back, x, rtol=0, atol=1e-10)
    assert_allclose(Psi @ Phi, np.eye(2), rtol=0, atol=1e-9)


def test_without_the_event_the_matrix_is_wrong():
    """What the term is worth: steps that do not know of the jump miss it, however short they are."""
    x = np.array([0.1, 0.6])
    _, Phi = cart(pz.RungeKutta4(1000), events=()).step(x, 3.0)
    assert np.abs(Phi - differences(lambda x: exact(x, 3.0), x)).max() > 0.5


def test_the_same_uncompiled(monkeypatch):
    x = np.array([0.1, 0.6])
    compiled = cart().step(x, 3.0)
    monkeypatch.setenv("PIAZZI_JIT", "0")
    for one, other in zip(cart().step(x, 3.0), compiled, strict=True):
        assert_allclose(one, other, rtol=0, atol=1e-13)


def test_a_crossing_at_an_epoch_counts_once():
    """Split there or anywhere else, the parts of an interval are the whole, whichever way the sums are rounded."""
    problem, x = cart(), np.array([0.1, 0.6])
    whole, Phi = problem.step(x, 3.0)
    crossing = (-0.85 + sqrt(0.85**2 + 2 * IDLE * 1.9)) / IDLE
    for first in (crossing, *(crossing + k * 2e-16 for k in (-3, -2, -1, 1, 2, 3)), crossing - 1e-13, 1.0, 2.5):
        y, A = problem.step(x, first)
        z, B = problem.step(y, 3.0 - first, first)
        assert_allclose(z, whole, rtol=0, atol=1e-11)
        assert_allclose(B @ A, Phi, rtol=0, atol=1e-10)


def oscillator(substeps):
    """A mass that is pulled to a line with constant force: parabola after parabola."""
    model = pz.Model(["x", "v"], {"x": "v", "v": "-sign(side)"}, definitions={"side": "x"}, events={"line": "side"})
    noise = pz.ProcessNoise([0.0, 0.0], method="integral")
    return pz.Problem(model, pz.Gaussian([0.0, 1.0], [1.0, 1.0]), noise, integrator=pz.RungeKutta4(substeps))


@pytest.mark.parametrize("substeps", [1, 3, 64])
def test_several_crossings_in_one_step(substeps):
    """From v at the line it is back after 2 v, with -v: eleven crossings in one interval."""

    def flow(x):
        reach = x[1] ** 2 / 2 + x[0]  # of the first parabola
        v = sqrt(2 * reach)
        since = 20.3 - (x[1] + v)  # after the first crossing, downwards
        turns, rest = divmod(since, 2 * v)
        s = -1.0 if turns % 2 == 0 else 1.0
        return s * np.array([v * rest - rest**2 / 2, v - rest])

    problem = oscillator(substeps)
    x = np.array([0.3, 0.8])
    assert int((20.3 - 0.8) / (2 * sqrt(2 * 0.62))) >= 8
    y, Phi = problem.step(x, 20.3)
    if substeps == 64:
        assert_allclose(y, flow(x), rtol=0, atol=1e-10)
        assert_allclose(Phi, differences(flow, x, 1e-6), rtol=0, atol=1e-7)
    else:  # a step is longer than what happens in it, and may miss pairs of crossings; what is found is a number
        assert np.isfinite(y).all()


@pytest.mark.parametrize("beyond", [1e-2, 1e-6, 1e-10, 0.0, -1e-10, -1e-6])
def test_a_pass_between_both_ends_of_a_step(beyond):
    """A ball thrown to just beyond a height: a clock runs for as long as it is above, 2 sqrt(2 beyond) seconds."""
    model = pz.Model(
        ["x", "v", "clock"],
        {"x": "v", "v": "-1", "clock": "(1 + sign(above))/2"},
        definitions={"above": "x - 1"},
        events={"height": "above"},
    )
    problem = pz.Problem(model, pz.Gaussian(np.zeros(3), np.ones(3)), [0.0] * 3, integrator=pz.RungeKutta8(1))
    start = np.array([0.0, sqrt(2 * (1 + beyond)), 0.0])
    y, Phi = problem.step(start, 3.0)
    assert y[2] == pytest.approx(2 * sqrt(2 * max(beyond, 0.0)), abs=1e-6 if abs(beyond) < 1e-9 else 1e-9)
    if beyond > 1e-8:
        assert_allclose(Phi[2], [2 / sqrt(2 * beyond), 2 * start[1] / sqrt(2 * beyond), 1.0], rtol=1e-6)
    assert np.isfinite(Phi).all()


def test_two_events_in_one_step_in_their_order():
    """Doors at 1 and 2: speed doubles at one, is halved again at the other, wherever they stand in the list."""
    texts = {"first": "x - 1", "second": "x - 2"}
    for events in (("first", "second"), ("second", "first")):
        model = pz.Model(
            ["x", "c"],
            {"x": "1 + (1 + sign(first))/2 - (1 + sign(second))/2", "c": "0"},
            definitions=texts,
            events=events,
        )
        problem = pz.Problem(model, pz.Gaussian([0.0, 0.0], [1.0, 1.0]), [0.0, 0.0], integrator=pz.RungeKutta4(1))
        y, Phi = problem.step([0.2, 0.0], 4.0)
        assert y[0] == pytest.approx(2.0 + (4.0 - 0.8 - 0.5), abs=1e-12)
        assert_allclose(Phi, np.eye(2), rtol=0, atol=1e-12)  # a later start is a later end, at the same speed


def switched():
    """A push whose beginning is a constant to estimate."""
    model = pz.Model(
        ["x", "v"],
        {"x": "v", "v": "(1 + sign(on))/2"},
        pz.Sensor("ruler", ["x"]),
        parameters={"start": "estimated"},
        definitions={"on": "t - start"},
        events={"burn": "on"},
    )
    return pz.Problem(
        model,
        pz.Gaussian([0.0, 0.0], [1e-6, 1e-6]),
        [0.0, 0.0],
        pz.Station("ruler", "ruler", 1e-6),
        parameters={"start": pz.Gaussian([1.2], [0.1])},
        integrator=pz.RungeKutta4(2),
    )


def test_an_edge_that_is_estimated_has_its_column():
    """The column of the matrix is the jump."""
    _, Phi = switched().step([0.0, 0.0, 1.2], 3.0)
    assert_allclose(Phi[:, 2], [-1.8, -1.0, 1.0], rtol=0, atol=1e-12)  # x = (3 - start)^2 / 2


@pytest.mark.slow  # kernels of nine seconds
def test_the_time_of_a_switch_is_found():
    problem = switched()
    times = np.linspace(0.0, 4.0, 41)
    truth = np.where(times > 1.5, (times - 1.5) ** 2 / 2, 0.0)
    found = pz.FactorGraph().estimate(problem, pz.Tracking(times, truth[:, None], ["ruler"] * 41))
    assert found.mean[-1, 2] == pytest.approx(1.5, abs=1e-3)


def noise_of(problem, x, start, end):
    """Process noise from a state that is known exactly."""
    kept = {f.name: getattr(problem, f.name) for f in fields(problem) if f.init}
    sure = pz.Problem(**kept | {"prior": pz.Gaussian(x, np.zeros((2, 2))), "prior_time": start})
    live = pz.ExtendedKalmanFilter().start(sure)
    live.predict(end)
    return live.covariance


@pytest.mark.parametrize(
    "integrator",
    [
        pz.RungeKutta4(3),
        pytest.param(pz.RungeKutta8(2), marks=pytest.mark.slow),
        pytest.param(pz.DormandPrince(), marks=pytest.mark.slow),
    ],
    ids=lambda i: type(i).__name__,
)
def test_process_noise_is_split_at_the_event(integrator):
    """The integral of Phi(T, s) Q Phi(T, s)^T, by Gauss and Legendre on both sides of the crossing, from closed forms."""
    q, x, T = 0.3, np.array([0.1, 0.6]), 3.0
    crossing = (-0.85 + sqrt(0.85**2 + 2 * IDLE * 1.9)) / IDLE
    total = np.zeros((2, 2))
    nodes, weights = np.polynomial.legendre.leggauss(8)
    for a, b in ((0.0, crossing), (crossing, T)):
        for node, weight in zip(nodes, weights, strict=True):
            s = a + (b - a) * (node + 1) / 2
            if s < crossing:
                at = np.array([x[0] + x[1] * s + IDLE / 2 * s**2, x[1] + IDLE * s])
                Phi = differences(lambda y, s=s: exact(y, T - s, s), at)
            else:
                Phi = np.array([[1.0, T - s], [0.0, 1.0]])
            total += weight * (b - a) / 2 * np.outer(Phi[:, 1], Phi[:, 1]) * q
    assert_allclose(noise_of(cart(integrator, q), x, 0.0, T), total, rtol=1e-8)


def test_a_shadow():
    """Sunlight that a cone of half-shadow dims: the rates are continuous, and the matrix is the derivative of the motion."""
    model = pz.Model(
        ["x", "y", "vx", "vy"],
        {"x": "vx", "y": "vy", "vx": "-x/r**3 - push*lit", "vy": "-y/r**3"},
        parameters=["push"],
        definitions={
            "r": "sqrt(x**2 + y**2)",
            "apart": "atan2(abs(y), x)",
            "edge": "3.141592653589793 - apart - asin(0.9/r)",
            "outer": "edge - 0.05",
            "inner": "edge + 0.05",
            "lit": "10*(max(inner, 0) - max(outer, 0))",  # 1 to 0 over 0.1 rad
        },
        events=("outer", "inner"),
    )
    prior = pz.Gaussian([1.1, 0.1, 0.0, 1.0], np.ones(4))
    settings = {"prior": prior, "process_noise": [0.0] * 4, "parameters": {"push": 0.05}}
    plain = pz.Problem(model, integrator=pz.RungeKutta8(40), **settings)
    fine = pz.Problem(model, integrator=pz.RungeKutta8(1000), **settings)
    start = np.array([1.1, 0.05, -0.05, 0.97])
    y, Phi = plain.step(start, 6.0)
    reference, _ = fine.step(start, 6.0)
    assert_allclose(y, reference, rtol=0, atol=2e-10)
    assert_allclose(Phi, differences(lambda x: fine.step(x, 6.0)[0], start, 1e-4), rtol=0, atol=1e-6)
    straight = pz.Problem(_without(model), integrator=pz.RungeKutta8(40), **settings)
    assert np.abs(straight.step(start, 6.0)[0] - reference).max() > 100 * np.abs(y - reference).max()


def _without(model):
    """The same without events."""
    kept = dict(model.definitions)
    dynamics = dict(zip(model.states, model.dynamics, strict=True))
    return pz.Model(model.states, dynamics, parameters=["push"], definitions=kept)


def test_a_model_without_events_has_nothing_of_them():
    problem = cart(events=())
    source = model_source(problem.model, problem.integrator.scheme, 1)
    for word in ("side", "beside", "event", "scalar_g"):
        assert word not in source
    assert not any("events" in part for part in problem.spec("transition", "noise_integral").fragments)
    assert problem.moves_in_lanes


# ---- every estimator takes the same steps ----------------------------------------------------------------------------------


TIMES = np.linspace(0.0, 3.0, 16)


@pytest.fixture(scope="module")
def seen():
    problem = cart(noise=1e-3, prior=pz.Gaussian([0.1, 0.6], [1e-3, 1e-3]))
    return problem, pz.simulate(problem, TIMES, np.random.default_rng(4))


def test_the_filter_is_the_textbooks_with_these_steps(seen):
    problem, tracking = seen
    found = pz.ExtendedKalmanFilter().estimate(problem, tracking)
    x, P = problem.mean, problem.covariance
    for k, t in enumerate(TIMES):
        if k:
            before = TIMES[k - 1]
            Q = noise_of(problem, x, before, t)
            x, Phi = problem.step(x, t - before, before)
            P = Phi @ P @ Phi.T + Q
        gain = P[:, 0] / (P[0, 0] + 1e-4)
        x = x + gain * (tracking.values[k, 0] - x[0])
        P = P - np.outer(gain, P[0])
        assert_allclose(found.mean[k], x, rtol=0, atol=1e-10)
        assert_allclose(found.covariance[k], P, rtol=0, atol=1e-11)


@pytest.mark.slow  # kernels of 15 s; filter, live sessions and batch are in the tests around
def test_all_estimators_take_them(seen):
    problem, tracking = seen
    ekf = pz.ExtendedKalmanFilter().estimate(problem, tracking)
    window = pz.SlidingWindow(lag=1).estimate(problem, tracking)
    assert_allclose(window.mean, ekf.mean, rtol=0, atol=1e-10)
    root = pz.SquareRootKalmanFilter().estimate(problem, tracking)
    assert_allclose(root.mean, ekf.mean, rtol=0, atol=1e-9)
    graph = pz.FactorGraph().estimate(problem, tracking)
    assert graph.success
    whole = pz.SlidingWindow(lag=len(TIMES), iterations=10).estimate(problem, tracking)
    assert_allclose(whole.mean[-1], graph.mean[-1], rtol=0, atol=1e-6)
    for estimator in (pz.UnscentedKalmanFilter(), pz.Smoother(), graph):
        found = estimator if estimator is graph else estimator.estimate(problem, tracking)
        off = (found.mean - tracking.truth) / np.sqrt(np.diagonal(found.covariance, axis1=1, axis2=2))
        assert np.abs(off).max() < 5


def test_sigma_points_go_through_the_event_one_by_one():
    """Points on both sides of the edge: each is where the closed form has it."""
    problem = cart(noise=0.0, prior=pz.Gaussian([1.9, 0.6], [0.04, 0.01]))
    found = pz.UnscentedKalmanFilter()
    tracking = pz.Tracking(np.array([0.0, 1.0]), np.array([[np.nan], [2.6]]), ["ruler", "ruler"])
    estimate = found.estimate(problem, tracking)
    assert np.isfinite(estimate.mean).all()


@pytest.mark.parametrize(
    "estimator",
    [
        pz.ExtendedKalmanFilter(),
        pytest.param(pz.UnscentedKalmanFilter(), marks=pytest.mark.slow),
        pytest.param(pz.SlidingWindow(lag=5), marks=pytest.mark.slow),
    ],
    ids=lambda e: type(e).__name__,
)
def test_live_is_the_whole_run_bit_for_bit(seen, estimator):
    problem, tracking = seen
    whole, live = estimator.estimate(problem, tracking), estimator.start(problem)
    for k, t in enumerate(tracking.times):
        live.update("ruler", tracking.values[k, 0], t)
        assert_array_equal(live.mean, whole.mean[k])


def test_batch_finds_the_first_state():
    """Noiseless measurements of the closed form: batch least squares through the event comes back to where it began."""
    problem, first = cart(prior=pz.Gaussian([0.0, 0.5], [1.0, 1.0])), np.array([0.13, 0.62])
    values = np.array([exact(first, t) for t in TIMES])[:, :1]
    found = pz.BatchLeastSquares().estimate(problem, pz.Tracking(TIMES, values, ["ruler"] * len(TIMES)))
    assert found.success
    assert_allclose(found.mean[0], first, rtol=0, atol=2e-4)


def scaled():
    """Process noise that does not depend on the states, so that these, and whole runs, move in lanes."""
    noise = pz.ProcessNoise([0.0, 1e-3], "second", "scaled")
    return cart(pz.RungeKutta8(2), prior=pz.Gaussian([0.1, 0.6], [1e-3, 1e-3]), process_noise=noise)


def drawn(problem, runs):
    """First states of runs, and unit normal draws."""
    rng = np.random.default_rng(8)
    first = problem.mean + rng.standard_normal((runs, 2)) * np.sqrt(np.diag(problem.covariance))
    return first, rng.standard_normal((runs, len(TIMES), 2)), rng.standard_normal((runs, len(TIMES), 1))


@pytest.mark.parametrize("jit", ["0", pytest.param("1", marks=pytest.mark.slow)])
def test_runs_in_an_ensemble_are_what_they_are_alone(jit, monkeypatch):
    monkeypatch.setenv("PIAZZI_JIT", jit)
    problem = scaled()
    assert problem.runs_in_ensemble
    layout, draws = Layout(problem, TIMES), drawn(problem, 11)
    truth, z = simulate_runs(layout, problem, *draws)
    mean, covariance, _ = filter_runs(layout, z, truth)
    crossed = truth[:, :, 0] - EDGE + SLANT * TIMES
    assert ((crossed[:, :-1] < 0) & (crossed[:, 1:] > 0)).sum() == 11  # each at its own time
    for r, (first, w, v) in enumerate(zip(*draws, strict=True)):
        states, values = propagate(problem, problem, TIMES, np.array([0]), first, w, v)
        assert_allclose(truth[r], states, rtol=0, atol=1e-12)
        assert_allclose(z[r], values, rtol=0, atol=1e-12)
        found = pz.ExtendedKalmanFilter().estimate(problem, pz.Tracking(TIMES, z[r]))
        assert_allclose(mean[r], found.mean[-1], rtol=0, atol=1e-11)
        assert_allclose(covariance[r], found.covariance[-1], rtol=0, atol=1e-12)


def test_only_a_group_with_a_crossing_goes_one_by_one(monkeypatch):
    """Uncompiled a group is one run, so that its crossings can be counted."""
    monkeypatch.setenv("PIAZZI_JIT", "0")
    problem = scaled()
    layout = Layout(problem, TIMES)
    inside = library(problem).simulate_lanes._function.__globals__
    real, alone = inside["one_by_one"], []
    monkeypatch.setitem(inside, "one_by_one", lambda t, dt, *given: alone.append(t + dt) or real(t, dt, *given))
    truth, _ = simulate_runs(layout, problem, *drawn(problem, 3))
    after = truth[:, :, 0] - EDGE + SLANT * TIMES > 0
    assert_allclose(sorted(alone), sorted(TIMES[after.argmax(axis=1)]), rtol=0, atol=1e-12)


@pytest.mark.slow
def test_lanes_change_no_bit(seen):
    for problem, tracking in (seen, (scaled(), seen[1])):
        for estimator in (pz.UnscentedKalmanFilter(), pz.FactorGraph(), pz.SlidingWindow(6), pz.BatchLeastSquares()):
            found = compared(estimator.estimate, problem, tracking).found
            assert max(found.values()) <= 1e-14, found


def test_a_study_runs(seen, tmp_path):
    problem, _ = seen
    assert not problem.runs_in_ensemble
    stored = Study(problem, TIMES, ["ekf"], 5, seed=3).run(tmp_path / "study.nc", workers=0)
    assert stored.summary.lines[0].failed == 0


def test_a_crossing_costs_the_step_to_it_and_little_more(monkeypatch):
    """To 1e-9 of the step: to the cubic's guess, and from there by short steps; counted in steps of the method."""
    monkeypatch.setenv("PIAZZI_JIT", "0")
    model = pz.Model(["x", "v"], {"x": "v", "v": "-x"}, definitions={"edge": "x - 0.3"}, events=("edge",))
    problem = pz.Problem(model, pz.Gaussian([1.0, 0.0], [1.0, 1.0]), None, integrator=pz.RungeKutta8(1), prior_time=0.0)
    inside = load_plain(problem.spec("transition", "propagate")).run_propagation._function.__globals__
    real, taken = inside["substep"], []
    monkeypatch.setitem(inside, "substep", lambda t, h, x, p: taken.append(t + h) or real(t, h, x, p))
    over, beyond = inside["cross"], []
    monkeypatch.setitem(inside, "cross", lambda t, x, e, p: beyond.append(t) or over(t, x, e, p))
    times, x = np.array([1.2, 1.3]), np.array([[np.cos(1.2), -np.sin(1.2)], [0.0, 0.0]])
    load_plain(problem.spec("transition", "propagate")).run_propagation(2, times, np.array([1, 1]), problem.given_bundle, x)
    assert len(taken) == 3  # the whole step, nearly to the crossing, and the rest
    assert 0.0 < abs(taken[1] - np.arccos(0.3)) < 1e-4 * 0.1
    assert len(beyond) == 1 and abs(beyond[0] - np.arccos(0.3)) < 1e-9 * 0.1
    assert_allclose(x[1], [np.cos(1.3), -np.sin(1.3)], atol=1e-13)
