"""Phi is the derivative of the step that was taken, F and H those of the equations: against SymPy and central differences."""

import numpy as np
import pytest
import sympy as sp
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

import piazzi as pz
from tests.laws.problems import MU_EARTH, b612, linear, network, random_stable, satellite
from tests.references import differences, kepler

pytestmark = pytest.mark.usefixtures("uncompiled")

SEEDS = st.integers(0, 2**32 - 1)


def driven(integrator, **changes):
    """Rates that depend on time, on a fixed constant and on two estimated ones; every state is of another kind."""
    model = pz.Model(
        ["q", "v", "theta"],
        ["v", "-k*sin(q) - damping*v + cos(t*theta)", "exp(-t)*q*damping - theta**3/(1 + v**2)"],
        [
            pz.Sensor(
                "place", {"angle": "atan2(sin(q), bias + cos(q))", "rate": "v*sqrt(1 + theta**2) + t*scale"}, angles=["angle"]
            )
        ],
        {"k": "fixed", "damping": "estimated", "bias": "estimated"},
    )
    estimated = {"damping": pz.Gaussian(0.3, 0.01), "bias": pz.Gaussian(0.2, 0.04)}
    return pz.Problem(
        model, pz.Gaussian([0.5, -0.2, 0.7], np.eye(3)), None, [pz.Station("s", "place", np.eye(2), {"scale": 0.4})],
        {"k": 1.7, **estimated}, integrator, **changes,
    )  # fmt: skip


def stepped(**changes):
    """A model that is a step itself, with the length of the step and an estimated constant in it."""
    model = pz.Model(
        ["a", "b"],
        ["a + dt*b*c - dt**2*sin(a)/2", "b*exp(-dt*c) + t*dt"],
        [pz.Sensor("sum", ["a + b*c"])],
        {"c": "estimated"},
        discrete=True,
    )
    return pz.Problem(
        model, pz.Gaussian([0.4, -0.3], np.eye(2)), None, pz.Station("s", "sum", 1.0), {"c": pz.Gaussian(0.8, 1.0)}, **changes
    )


STEPS = {
    "driven, taylor": lambda: driven(pz.Taylor(3)),
    "driven, rk4": lambda: driven(pz.RungeKutta4(2)),
    "discrete": stepped,
    "network, rk4": lambda: network(np.random.default_rng(0), integrator=pz.RungeKutta4(3)),
    "network, taylor": lambda: network(np.random.default_rng(0), integrator=pz.Taylor(4)),
}


@pytest.mark.parametrize("name", STEPS)
@given(SEEDS)
@settings(max_examples=10)
def test_phi_is_the_derivative_of_the_step(name, seed):
    """Even where one substep is so long that the step is far from the exact flow, and at any time."""
    problem, rng = STEPS[name](), np.random.default_rng(seed)
    x = problem.mean + 0.1 * rng.standard_normal(problem.model.n)
    t, dt = rng.uniform(-1, 2), rng.uniform(0.1, 1.5)
    _, Phi = problem.step(x, dt, t)
    numeric = differences.jacobian(lambda v: problem.step(v, dt, t)[0], x, np.full(len(x), 1e-3))
    assert_allclose(Phi, numeric, rtol=1e-7, atol=1e-8)


@pytest.mark.parametrize(
    "make", [lambda: satellite(pz.Taylor(15)), lambda: satellite(pz.RungeKutta4(3)), b612], ids=["taylor", "rk4", "b612"]
)
def test_phi_is_the_derivative_of_the_step_on_the_founding_problems(make):
    problem = make()
    scale = np.array([1e3, 1e3, 1.0, 1.0]) if problem.mean[1] > 1e3 else np.full(4, 1e-3)
    dt = 15.0 if problem.mean[1] > 1e3 else 0.1
    _, Phi = problem.step(problem.mean, dt)
    numeric = differences.jacobian(lambda v: problem.step(v, dt)[0], problem.mean, scale)
    assert_allclose(Phi / (scale[:, None] / scale), numeric / (scale[:, None] / scale), rtol=1e-8, atol=1e-8)


@given(SEEDS)
@settings(max_examples=15)
def test_rates_and_measurements_equal_sympys(seed):
    """f, F, h and H against SymPy's own derivative, evaluated in 30 digits, and against central differences."""
    problem, rng = driven(pz.RungeKutta4(1)), np.random.default_rng(seed)
    x, t = problem.mean + 0.2 * rng.standard_normal(5), rng.uniform(-2, 2)
    q, v, theta, damping, bias, time, k, scale = symbols = sp.symbols("q v theta damping bias t k scale", real=True)
    f = sp.Matrix(
        [v, -k * sp.sin(q) - damping * v + sp.cos(time * theta), sp.exp(-time) * q * damping - theta**3 / (1 + v**2), 0, 0]
    )
    h = sp.Matrix([sp.atan2(sp.sin(q), bias + sp.cos(q)), v * sp.sqrt(1 + theta**2) + time * scale])
    numbers = dict(zip(symbols, [*map(sp.Float, x), sp.Float(t), sp.Float(1.7), sp.Float(0.4)], strict=True))
    here = [(problem.dynamics(x, t), f), (problem.dynamics_jacobian(x, t), f.jacobian(symbols[:5]))]
    here += [(problem.measure("s", x, t), h), (problem.measurement_jacobian("s", x, t), h.jacobian(symbols[:5]))]
    for ours, formula in here:
        exact = np.array(formula.evalf(30, subs=numbers).tolist(), dtype=float).reshape(ours.shape)
        assert_allclose(ours, exact, rtol=1e-12, atol=1e-13)
    steps = np.full(5, 1e-3)
    assert_allclose(here[1][0], differences.jacobian(lambda y: problem.dynamics(y, t), x, steps), rtol=1e-7, atol=1e-8)
    assert_allclose(here[3][0], differences.jacobian(lambda y: problem.measure("s", y, t), x, steps), rtol=1e-7, atol=1e-8)


@given(SEEDS)
@settings(max_examples=10)
def test_every_station_measures_from_its_own_place(seed):
    rng = np.random.default_rng(seed)
    problem = network(rng)
    x = problem.mean + 0.3 * rng.standard_normal(4)
    for station in problem.stations:
        H = problem.measurement_jacobian(station.name, x)
        numeric = differences.jacobian(lambda y, s=station: problem.measure(s.name, y), x, np.full(4, 1e-3))
        assert_allclose(H, numeric, rtol=1e-6, atol=1e-7)
        offset = x[:2] - [station.numbers["mx"], station.numbers["my"]]
        place = {"range": 0, "radar": 0, "doppler": 2}[station.sensor]
        assert_allclose(problem.measure(station.name, x)[place], np.hypot(*offset), rtol=1e-14)


def test_many_states_equal_one_by_one():
    problem = driven(pz.RungeKutta4(2))
    rng = np.random.default_rng(0)
    x, t = problem.mean + rng.standard_normal((7, 5)), rng.uniform(0, 3, 7)
    for many, one in [
        (problem.dynamics(x, t), lambda i: problem.dynamics(x[i], t[i])),
        (problem.dynamics_jacobian(x, t), lambda i: problem.dynamics_jacobian(x[i], t[i])),
        (problem.measure("s", x, t), lambda i: problem.measure("s", x[i], t[i])),
        (problem.measurement_jacobian("s", x, t), lambda i: problem.measurement_jacobian("s", x[i], t[i])),
        (problem.step(x, 0.3, t)[0], lambda i: problem.step(x[i], 0.3, t[i])[0]),
        (problem.step(x, 0.3, t)[1], lambda i: problem.step(x[i], 0.3, t[i])[1]),
    ]:
        assert_allclose(many, [one(i) for i in range(7)], rtol=0, atol=0)


# ---- the steps themselves --------------------------------------------------------------------------------------------


def error_after(integrator, problem_of, state, dt, exact):
    x, _ = problem_of(integrator).step(state, dt)
    return np.abs(x - exact).max()


@pytest.mark.parametrize(("method", "order"), [(pz.Taylor, 1), (pz.RungeKutta4, 4)])
def test_error_falls_with_the_order_of_the_method(method, order):
    state, dt = np.array([2.0, 0.1, 0.05, 0.7]), 1.0
    exact = kepler.propagate(state, dt, 1.0)
    coarse, fine = (
        error_after(method(s), lambda i: network(np.random.default_rng(0), integrator=i), state, dt, exact) for s in (16, 32)
    )
    assert coarse / fine == pytest.approx(2**order, rel=0.15)


def test_two_body_motion_keeps_energy_and_momentum_and_closes_after_a_period():
    """Kepler's ellipse with RK4 in small steps, sampled along one revolution, and Phi as the derivative of the exact flow."""
    start = np.array([12.0, 0.0, 1.0, 9.0])
    T = kepler.period(start, 1000.0)
    problem, x = b612(integrator=pz.RungeKutta4(400)), start
    for quarter in range(1, 5):
        x, _ = problem.step(x, T / 4)
        assert_allclose(x, kepler.propagate(start, quarter * T / 4, 1000.0), rtol=0, atol=2e-7)
        assert kepler.energy(x, 1000.0) == pytest.approx(kepler.energy(start, 1000.0), rel=1e-9)
        assert kepler.angular_momentum(x) == pytest.approx(kepler.angular_momentum(start), rel=1e-9)
    assert_allclose(x, start, rtol=0, atol=2e-7)
    _, Phi = problem.step(start, T / 4)
    flow = differences.jacobian(lambda y: kepler.propagate(y, T / 4, 1000.0), start, np.full(4, 1e-3))
    assert_allclose(Phi, flow, rtol=1e-6, atol=1e-6)


def test_satellite_goes_round_in_keplers_time():
    r = 2e7
    start = np.array([0.0, r, np.sqrt(MU_EARTH / r), 0.0])
    T = kepler.period(start, MU_EARTH)
    assert pytest.approx(2 * np.pi * np.sqrt(r**3 / MU_EARTH)) == T
    x, _ = satellite(pz.RungeKutta4(max_step=20.0)).step(start, T)
    assert_allclose(x / [r, r, 4500, 4500], start / [r, r, 4500, 4500], rtol=0, atol=1e-6)


@given(st.integers(1, 9), SEEDS)
@settings(max_examples=10)
def test_transition_matrices_chain(n, seed):
    """Two steps one after the other equal one of twice the length, of twice as many substeps."""
    rng = np.random.default_rng(seed)
    A = random_stable(rng, n)
    parts = ([np.ones((1, n))], [np.eye(1)], np.zeros(n), pz.Gaussian(np.zeros(n), np.eye(n)))
    one, two = (linear(A, *parts, discrete=False, integrator=pz.RungeKutta4(s)) for s in (3, 6))
    x = rng.standard_normal(n)
    middle, first = one.step(x, 0.3)
    end, second = one.step(middle, 0.3)
    whole, Phi = two.step(x, 0.6)
    assert_allclose(end, whole, rtol=1e-12, atol=1e-13)
    assert_allclose(second @ first, Phi, rtol=1e-12, atol=1e-13)
