"""Whole arcs: order, Kepler's closed form, derivatives, and the same orbit however its epochs and interruptions lie."""

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import piazzi as pz
from piazzi.kernels import build, cache
from piazzi.problem import arcs, stepping
from piazzi.problem.arcs import Steps
from tests.model import test_functions
from tests.references import differences, kepler
from tests.solvers import orbits

pytestmark = pytest.mark.usefixtures("uncompiled")

DAY, HOUR = 86400.0, 3600.0
START = orbits.state(2, 0.01)


def plane(integrator, **changes):
    return orbits.orbit(2, integrator, **changes)


@pytest.mark.parametrize(("order", "steps"), [(4, 160), (6, 160), (8, 48), (10, 40), (12, 60)])
@pytest.mark.parametrize("end", [6000.0, 6013.0])
def test_error_falls_with_the_power_of_the_order(order, steps, end):
    """At the end of a grid, and between two of its steps: the arc goes on to 6100 s.

    With twice the steps of the orders 10 and 12 the first steps, of order 8, and rounding are what is left.
    """
    problem = plane(pz.GaussJackson(max_step=10.0, order=order))
    exact = kepler.propagate(START, end, orbits.MU)
    errors = []
    for count in (steps, 2 * steps):
        found = arcs.arc(problem, np.array([0.0, end, 6100.0]), START, Steps(1.0, 6100.0 / count), derivative=False)
        errors.append(np.abs((found.x[1] - exact) / orbits.units(2)).max())
    assert np.log2(errors[-2] / errors[-1]) > order - 0.3


def test_a_day_to_a_millimetre_with_a_third_of_the_evaluations_of_order_8(monkeypatch):
    """Against Kepler's equation, at epochs that no step ends at."""
    monkeypatch.setenv("PIAZZI_JIT", "1")
    times = np.sort(np.random.default_rng(1).uniform(0.0, DAY, 40))
    times[0] = 0.0
    problem = plane(pz.GaussJackson(tolerance=1e-10))
    found = problem.arc(times)
    exact = np.array([kepler.propagate(START, t, orbits.MU) for t in times])
    assert np.hypot(*(found.x - exact).T[:2]).max() < 1e-3
    steps = problem.steps(0.0, times[-1])
    assert steps.grid is not None
    assert times[-1] / steps.grid < 12 * times[-1] / steps.one / 3


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("e", [0.001, 0.2])
def test_a_tolerance_is_kept(d, e, monkeypatch):
    """By order 8 and by the multi-step method, on circles and on an ellipse, against universal functions."""
    monkeypatch.setenv("PIAZZI_JIT", "1")
    first, tolerance = orbits.state(d, e), 1e-10
    two_body = first[:d], first[d:], orbits.MU, DAY / 4
    exact, Phi = np.concatenate(pz.propagate_kepler(*two_body)), pz.kepler_transition(*two_body)
    for method in (pz.RungeKutta8, pz.GaussJackson):
        problem = orbits.orbit(d, method(tolerance=tolerance))
        found = problem.arc([0.0, DAY / 4], first)
        off = (found.x[-1] - exact) / orbits.units(d)
        assert np.abs(off).max() < 2 * tolerance
        size = orbits.units(d)
        assert np.abs((found.Phi[0] - Phi) * size / size[:, None]).max() < 1e-7


def test_the_derivative_is_that_of_the_orbit():
    """Against differences of the arc itself, estimated constant and all, at a grid so coarse that its error shows."""
    problem = orbits.orbit(2, pz.GaussJackson(max_step=100.0, order=8), mu_role="estimated")
    unit = np.array([*orbits.units(2), orbits.MU])
    x, times = np.array([*START, orbits.MU]), np.array([0.0, 5000.0, 6030.0])
    Phi = problem.arc(times, x).Phi
    numeric = differences.jacobian(
        lambda y: problem.arc(times, y * unit, derivative=False).x[-1] / unit, x / unit, np.full(5, 2e-5)
    )
    assert_allclose((Phi[1] @ Phi[0]) * unit / unit[:, None], numeric, rtol=0, atol=1e-7)


def test_the_derivative_is_symplectic():
    """Phi^T J Phi = J for the motion of a Hamiltonian, over every interval and over the arc."""
    J = np.kron([[0.0, 1.0], [-1.0, 0.0]], np.eye(2))
    unit = np.array([1.0, 1.0, 1e-3, 1e-3])  # of the states, with 1000 s as the unit of time: entries are of order one
    whole, J = np.eye(4), J * np.outer(unit, unit) * 1e3
    for Phi in plane(pz.GaussJackson(tolerance=1e-11)).arc(np.linspace(0.0, 20_000.0, 77)).Phi:
        one = Phi * unit / unit[:, None]
        whole = one @ whole
        assert_allclose(one.T @ J @ one, J, rtol=0, atol=1e-9)
    assert_allclose(whole.T @ J @ whole, J, rtol=0, atol=1e-7)


@pytest.mark.parametrize("method", [pz.RungeKutta4(max_step=60.0), pz.RungeKutta8(tolerance=1e-10), pz.DormandPrince()])
def test_an_arc_of_a_one_step_method_is_its_transitions_in_a_row(method):
    problem = plane(method)
    times = np.array([5.0, 300.0, 1000.0, 1000.5, 7000.0])
    found, x = problem.arc(times), problem.mean
    given = problem.with_steps(times)
    for k in range(1, len(times)):
        x, Phi = given.step(x, times[k] - times[k - 1], times[k - 1])
        assert_array_equal(found.x[k], x)
        assert_array_equal(found.Phi[k - 1], Phi)


def test_an_arc_is_the_same_whatever_epochs_it_is_asked_for():
    """Transition matrices multiply to those of longer intervals; epochs may be closer than a step, and hundreds in one."""
    problem = plane(pz.GaussJackson(max_step=60.0))
    ends = np.array([0.0, 9000.0, 12_000.0])
    dense = np.unique(np.concatenate([ends, np.linspace(3000.0, 3100.0, 300), [1.0, 2.0, 11_999.999]]))
    few, many = problem.arc(ends), problem.arc(dense)
    where = np.searchsorted(dense, ends)
    assert_allclose(many.x[where] / orbits.units(2), few.x / orbits.units(2), rtol=0, atol=1e-12)
    whole = np.eye(4)
    for k, Phi in enumerate(many.Phi, start=1):
        whole = Phi @ whole
        if k in where:
            i = int(np.flatnonzero(where == k)[0]) - 1
            unit = orbits.units(2)
            assert_allclose(whole * unit / unit[:, None], few.Phi[i] * unit / unit[:, None], rtol=0, atol=1e-8)
            whole = np.eye(4)


BURNS = [pz.Manoeuvre(4000.0, [30.0, -20.0]), pz.Manoeuvre(7003.3, [5.0, 10.0]), pz.Manoeuvre(7100.0, [-4.0, 2.0])]


@pytest.mark.parametrize(
    "epochs", [[0.0, 9000.0], [0.0, 4000.0, 7003.3, 9000.0], [0.0, 7001.0, 7050.0, 7050.5, 7100.0, 9000.0]]
)
def test_manoeuvres_begin_anew(epochs):
    """One at an epoch belongs to the interval that ends there; between the last two, 97 s apart, order 8 takes over."""
    times = np.array(epochs)
    found = plane(pz.GaussJackson(max_step=40.0), manoeuvres=BURNS).arc(times)
    exact = plane(pz.RungeKutta8(max_step=30.0), manoeuvres=BURNS).arc(times)
    unit = orbits.units(2)
    assert_allclose(found.x / unit, exact.x / unit, rtol=0, atol=1e-11)
    assert_allclose(found.Phi * unit / unit[:, None], exact.Phi * unit / unit[:, None], rtol=0, atol=1e-8)


def lit(integrator, radius):
    """A satellite that sunlight pushes where the Earth's cylinder of shadow is not; its edge is an event."""
    force = [f"-{orbits.MU}*{c}/r**3" for c in "xy"]
    model = pz.Model(
        ["x", "y", "vx", "vy"],
        ["vx", "vy", f"{force[0]} + push*(1 + sign(edge))/2", force[1]],
        parameters=["push"],
        definitions={"r": "sqrt(x**2 + y**2)", "edge": "x + sqrt(x**2 + y**2 - 6378137.0**2)"},
        events=("edge",),
    )
    prior = pz.Gaussian([radius, 0.0, 0.0, np.sqrt(orbits.MU / radius)], [1e4, 1e4, 1.0, 1.0])
    return pz.Problem(model, prior, integrator=integrator, parameters={"push": -1e-7}, prior_time=0.0)


@pytest.mark.parametrize("jit", ["0", pytest.param("1", marks=pytest.mark.slow)])
@pytest.mark.parametrize("end", [4 * HOUR, 37.3 * HOUR])
def test_events_begin_anew(end, jit, monkeypatch):
    """As by short steps of order 8 that end at the same edges, at epochs before, within and after the steps that have them."""
    monkeypatch.setenv("PIAZZI_JIT", jit)
    times = np.sort(np.append(0.0, np.random.default_rng(6).uniform(0.0, end, 60)))
    grid, short = (lit(i, 2.656e7).arc(times) for i in (pz.GaussJackson(max_step=240.0), pz.RungeKutta8(max_step=60.0)))
    assert np.abs(grid.x - short.x).max() < 1e-4
    unit = np.outer([1.0, 1.0, 1e-4, 1e-4], [1.0, 1.0, 1e4, 1e4])  # of positions and velocities
    assert (np.abs(grid.Phi - short.Phi) / unit).max() < 1e-9
    alone = arcs.arc(lit(pz.GaussJackson(max_step=240.0), 2.656e7), times, grid.x[0], Steps(240.0, 240.0), derivative=False)
    assert_allclose(alone.x, grid.x, rtol=1e-12)


def test_a_crossing_costs_the_grid_a_beginning(calls):
    """Two in a revolution of twelve hours: order 8, as accurate in steps three times as long, needs 1.4 times as many."""
    revolution = 43077.0
    times = np.array([0.0, 3 * revolution])
    lit(pz.GaussJackson(max_step=240.0), 2.656e7).arc(times)
    grid = calls["rhs_beside"] + calls["dynamics_beside"]
    calls.clear()
    lit(pz.RungeKutta8(max_step=720.0), 2.656e7).arc(times)
    assert 3 * revolution / 240.0 < grid < (calls["rhs_beside"] + calls["dynamics_beside"]) / 1.4


def test_where_crossings_come_too_often_all_goes_by_order_8(calls):
    """In low orbit a grid of two minutes has 18 steps in the dark and 29 in the light."""
    lit(pz.GaussJackson(max_step=120.0), 6.878e6).arc(np.array([0.0, 10 * 5677.0]))
    often = calls["rhs_beside"]
    calls.clear()
    lit(pz.RungeKutta8(max_step=120.0), 6.878e6).arc(np.array([0.0, 10 * 5677.0]))
    assert 0.9 * calls["rhs_beside"] < often < 1.02 * calls["rhs_beside"]


@pytest.mark.parametrize("integrator", [pz.GaussJackson(max_step=0.02), pz.RungeKutta8(tolerance=1e-11), pz.DormandPrince()])
def test_functions_from_outside_move_as_their_twins_in_symbols(integrator):
    times = np.array([0.0, 0.5, 0.503, 3.0])
    twins = (replace(test_functions.problem(one), integrator=integrator) for one in (True, False))
    outside, inside = (twin.arc(times) for twin in twins)
    assert_allclose(outside.x, inside.x, rtol=0, atol=1e-11)
    assert_allclose(outside.Phi, inside.Phi, rtol=0, atol=1e-9)


def test_states_alone_are_those_with_derivatives():
    problem = plane(pz.GaussJackson(max_step=60.0), manoeuvres=BURNS)
    times = np.linspace(0.0, 9000.0, 100)
    alone, both = problem.arc(times, derivative=False), problem.arc(times)
    assert alone.Phi.shape == (0, 4, 4)
    assert_array_equal(alone.x, both.x)


@pytest.mark.parametrize("integrator", [pz.GaussJackson(max_step=60.0), pz.GaussJackson(tolerance=1e-9)])
def test_short_arcs_and_other_models_go_by_order_8(integrator):
    short = np.array([0.0, 100.0, 500.0])
    problem = plane(integrator)
    assert_array_equal(problem.arc(short).x, plane(pz.RungeKutta8(max_step=problem.steps(0.0, 500.0).one)).arc(short).x)
    decay = pz.Problem(pz.Model(["x"], ["-x"]), pz.Gaussian([1.0], [1.0]), integrator=integrator)
    found = decay.arc([0.0, 1.0])
    assert decay.steps(0.0, 1.0).grid is None
    assert_allclose(found.x[1], np.exp(-1.0), rtol=1e-8 if integrator.tolerance else 1.0)


def test_compiled_is_as_uncompiled(monkeypatch):
    problem, times = plane(pz.GaussJackson(max_step=60.0)), np.array([0.0, 1234.5, 1240.0, 9000.0])
    plain, alone = problem.arc(times), problem.arc(times, derivative=False)
    monkeypatch.setenv("PIAZZI_JIT", "1")
    unit = orbits.units(2)
    assert_allclose(problem.arc(times).x / unit, plain.x / unit, rtol=0, atol=1e-13)
    assert_allclose(problem.arc(times, derivative=False).x / unit, alone.x / unit, rtol=0, atol=1e-13)
    assert_allclose(problem.arc(times).Phi * unit / unit[:, None], plain.Phi * unit / unit[:, None], rtol=0, atol=1e-10)


def test_steps_are_chosen_once_for_a_span_and_told(monkeypatch):
    problem, times = plane(pz.RungeKutta8(tolerance=1e-9)), np.linspace(0.0, 6000.0, 11)
    step = problem.max_step(times)
    monkeypatch.setattr(stepping, "_fewest", None)
    assert problem.max_step(times) == step
    assert_array_equal(problem.intervals(times)[1], np.maximum(np.ceil(np.diff(times, prepend=0.0) / step), 1))
    assert problem.with_steps(times).integrator == pz.RungeKutta8(max_step=step)
    assert plane(pz.RungeKutta4()).with_steps(times).integrator == pz.RungeKutta4()


def test_at_rest_the_transition_matrix_decides():
    """An equilibrium stays exactly where it is, with steps of any length."""
    model = pz.Model(["x", "v"], ["v", "-x"])
    problem = pz.Problem(model, pz.Gaussian([0.0, 0.0], [1.0, 1.0]), integrator=pz.RungeKutta8(tolerance=1e-12))
    Phi = problem.arc([0.0, 20.0]).Phi[0]
    turn = np.array([[np.cos(20.0), np.sin(20.0)], [-np.sin(20.0), np.cos(20.0)]])
    assert np.abs(Phi - turn).max() < 1e-8


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: pz.RungeKutta8(tolerance=0.0), "tolerance is 0.0"),
        (lambda: pz.RungeKutta8(tolerance=2.0), "tolerance is 2.0"),
        (lambda: pz.RungeKutta8(tolerance=float("nan")), "tolerance is nan"),
        (lambda: pz.RungeKutta8(tolerance=1e-9, max_step=3.0), "not both"),
        (lambda: pz.RungeKutta8(substeps=3, tolerance=1e-9), "not both"),
        (lambda: pz.GaussJackson(substeps=3), "not substeps"),
        (lambda: pz.GaussJackson(order=3), "order is 3"),
        (lambda: pz.GaussJackson(max_step=-1.0), "max_step is -1.0"),
        (lambda: pz.RungeKutta8(tolerance=1e-9).counts(np.ones(1)), "give max_step"),
        (lambda: stepping._fewest(lambda count: max((3.0 / count) ** 8, 1e-13), 8, 1e-14), "rounding"),
        (lambda: plane(pz.GaussJackson()).arc([0.0, 0.0]), "increase"),
        (lambda: plane(pz.GaussJackson()).arc([0.0, 1.0], [1.0]), "first state"),
    ],
)
def test_what_cannot_be_is_said(make, says):
    with pytest.raises(ValueError, match=says):
        make()


def test_a_motion_that_is_not_smooth_is_told():
    """Of a kink on the way, the error falls with the step, not with its eighth power."""
    with pytest.raises(ValueError, match="not smooth"):
        stepping._fewest(lambda count: 1.0 / count, 8, 1e-6)


@pytest.mark.parametrize("tolerance", [1e-3, 1e-7, 1e-10])
def test_the_fewest_steps_are_found_by_the_order_that_shows(tolerance):
    count = stepping._fewest(lambda count: (3.0 / count) ** 8, 8, tolerance)
    assert 3.0 * tolerance ** (-1 / 8) <= count <= 3.0 * 1.06 * tolerance ** (-1 / 8) + 8


# ---- who uses arcs -------------------------------------------------------------------------------------------------------


def seen(integrator, **changes):
    """A problem about a low orbit with ranges from two places, its truth fixed, and what is measured."""
    model = pz.Model(
        ["x", "y", "vx", "vy"],
        ["vx", "vy", "-mu*x/sqrt(x**2 + y**2)**3", "-mu*y/sqrt(x**2 + y**2)**3"],
        [pz.Sensor("range", ["sqrt((x - px)**2 + (y - py)**2)"])],
        ["mu"],
        groups={"position": ["x", "y"], "velocity": ["vx", "vy"]},
    )
    places = [pz.Station(f"s{i}", "range", 100.0, {"px": 6.4e6 * np.cos(i), "py": 6.4e6 * np.sin(i)}) for i in range(2)]
    truth = START + np.array([300.0, -200.0, 0.2, 0.1])
    return pz.Problem(
        model,
        pz.Gaussian(START, [1e6, 1e6, 1.0, 1.0]),
        None,
        places,
        {"mu": orbits.MU},
        integrator,
        0.0,
        pz.Truth(truth),
        **changes,
    )


TIMES = np.linspace(30.0, 9000.0, 60)
FINE = pz.RungeKutta8(max_step=30.0)


@pytest.mark.parametrize("burns", [(), BURNS], ids=["smooth", "manoeuvres"])
def test_noiseless_truth_is_an_arc(burns):
    problem = seen(pz.GaussJackson(max_step=40.0), manoeuvres=burns)
    found, exact = (
        pz.simulate(replace(problem, integrator=i), TIMES, np.random.default_rng(3)) for i in (problem.integrator, FINE)
    )
    nodes = np.append(0.0, TIMES)
    assert_array_equal(found.truth, problem.arc(nodes, problem.truth.state, derivative=False).x[1:])
    assert_allclose(found.truth / orbits.units(2), exact.truth / orbits.units(2), rtol=0, atol=1e-11)
    assert_allclose(found.values, exact.values, rtol=0, atol=1e-3)


@pytest.mark.parametrize("burns", [(), BURNS], ids=["smooth", "manoeuvres"])
@pytest.mark.parametrize("integrator", [pz.GaussJackson(max_step=40.0), pz.DormandPrince()], ids=lambda i: type(i).__name__)
def test_batch_along_arcs_finds_what_it_finds_step_by_step(burns, integrator):
    problem = seen(integrator, manoeuvres=burns)
    tracking = pz.simulate(problem, TIMES, np.random.default_rng(3))
    found, same = (pz.BatchLeastSquares().estimate(replace(problem, integrator=i), tracking) for i in (integrator, FINE))
    assert found.success
    assert same.success
    assert found.details.get("grid_step") == integrator.max_step == found.max_step
    sigma = np.sqrt(np.diagonal(same.covariance, axis1=1, axis2=2))
    assert np.abs((found.mean - same.mean) / sigma).max() < 1e-4
    assert_allclose(
        found.covariance / (sigma[:, :, None] * sigma[:, None]),
        same.covariance / (sigma[:, :, None] * sigma[:, None]),
        rtol=0,
        atol=1e-6,
    )
    assert_allclose(found.innovations, same.innovations, rtol=0, atol=1e-2)


def test_estimators_that_stop_at_every_epoch_take_steps_of_order_8():
    problem = seen(pz.GaussJackson(tolerance=1e-10))
    tracking = pz.simulate(problem, TIMES, np.random.default_rng(3))
    one = replace(problem, integrator=pz.RungeKutta8(tolerance=1e-10))
    for estimator in (pz.ExtendedKalmanFilter(), pz.Smoother(), pz.FactorGraph(), pz.SlidingWindow(5)):
        assert_array_equal(estimator.estimate(problem, tracking).mean, estimator.estimate(one, tracking).mean)


@pytest.fixture
def calls(monkeypatch):
    """How often each function of a kernel was called, in kernels loaded from now on."""
    found, load = Counter(), build.module_of

    def counting(name, function):
        def counted(*args):
            found[name] += 1
            return function(*args)

        return counted

    def loaded(source):
        module = load(source)
        steps = ("substep", "substep_jacobian", "trial", "trial_jacobian")
        for name in ("dynamics", "rhs", "dynamics_beside", "rhs_beside", *steps):
            if hasattr(module, name):
                setattr(module, name, counting(name, getattr(module, name)))
        return module

    monkeypatch.setattr(build, "module_of", loaded)
    monkeypatch.setattr(cache, "_loaded", {})
    return found


@pytest.mark.parametrize("integrator", [pz.DormandPrince(), pz.RungeKutta8(max_step=60.0), pz.GaussJackson(max_step=60.0)])
def test_noiseless_simulation_evaluates_no_derivatives(integrator, calls):
    """A stage of a step evaluates the rates of the state once: not again with partials, which nothing asks for."""
    pz.simulate(seen(integrator), TIMES, np.random.default_rng(3))
    assert calls["rhs"] == 0
    steps = calls["trial"] + calls["substep"]
    grid = 9000 // 60 + 1 if integrator.arc_scheme else 0  # and one evaluation at every node
    assert calls["dynamics"] == 12 * steps + grid > 0


@pytest.mark.parametrize("integrator", [pz.DormandPrince(), pz.RungeKutta8(1)])
def test_a_stage_is_evaluated_once_for_value_and_derivative(integrator, calls):
    plane(integrator).step(START, 600.0)
    assert calls["dynamics"] == 0
    assert calls["rhs"] == 12 * (calls["trial_jacobian"] + calls["substep_jacobian"]) > 0


def test_a_step_of_the_grid_costs_one_evaluation(calls):
    """The first nine steps and what lies within them by order 8; then one for each step, whatever epochs lie in between."""
    plane(pz.GaussJackson(max_step=60.0)).arc(np.append(0.0, np.linspace(2000.0, 6000.0, 1000)))
    assert (calls["rhs"], calls["dynamics"]) == (101 + 12 * 9, 0)
