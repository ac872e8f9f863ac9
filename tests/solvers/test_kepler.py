"""Kepler's closed form against what conics do, against other solvers, and where it must not be used."""

import mpmath
import numpy as np
import pytest
from numpy.testing import assert_allclose

import piazzi as pz
from piazzi import kernels
from piazzi.orbit import kepler_transition, propagate_kepler
from tests.references import differences
from tests.references import kepler as ellipse
from tests.solvers import orbits

MU = orbits.MU
PERIOD = 2 * np.pi * np.sqrt((7e6 / (1 - 0.1)) ** 3 / MU)


def relative(a, b, d):
    """Largest error of position and of velocity, each relative to its length."""
    return max(np.linalg.norm((a - b)[s]) / np.linalg.norm(b[s]) for s in (slice(0, d), slice(d, 2 * d)))


# ---- the motion ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("solver", "d"),
    [
        (kernels.DormandPrince(1e-13, 1e-13), 2),
        (kernels.DormandPrince(1e-13, 1e-13), 3),
        (kernels.RungeKutta8(2000), 2),
        (kernels.RungeKutta4(100_000), 2),
        (kernels.DormandPrince5(20_000), 2),
    ],
    ids=lambda v: type(v).__name__ if not isinstance(v, int) else f"{v}-D",
)
def test_two_body_over_ten_orbits(solver, d):
    x = orbits.state(d, 0.1)
    after, _ = orbits.orbit(d, solver).step(x, 10 * PERIOD + 1234.0)
    kepler, _ = orbits.orbit(d, kernels.Kepler()).step(x, 10 * PERIOD + 1234.0)
    assert relative(after, kepler, d) < 1e-9
    if d == 2:
        assert relative(after, ellipse.propagate(x, 10 * PERIOD + 1234.0, MU), 2) < 1e-9


def by_taylor_series(x, dt, digits=30):
    """The same motion in high precision, by the Taylor series of Kepler's problem (mpmath)."""
    d = len(x) // 2
    with mpmath.workdps(digits):
        scale, speed = mpmath.mpf(7e6), mpmath.sqrt(mpmath.mpf(MU) / mpmath.mpf(7e6))
        y = [mpmath.mpf(float(v)) / scale for v in x[:d]] + [mpmath.mpf(float(v)) / speed for v in x[d:]]

        def rate(t, y):
            r3 = mpmath.sqrt(sum(v * v for v in y[:d])) ** 3
            return [*y[d:], *(-v / r3 for v in y[:d])]

        after = mpmath.odefun(rate, 0, y, tol=mpmath.mpf(10) ** -20)(mpmath.mpf(dt) * speed / scale)
        return np.array([float(v * scale) for v in after[:d]] + [float(v * speed) for v in after[d:]])


CONICS = [0.0, 0.1, 0.9, 1 - 1e-9, 1.0, 1 + 1e-9, 1.5, 4.0]


@pytest.mark.parametrize("e", CONICS)
@pytest.mark.parametrize("dt", [1.0, 4000.0])
def test_any_conic_against_thirty_digits(e, dt):
    x = orbits.state(2, e, nu=-0.5)
    r, v = propagate_kepler(x[:2], x[2:], MU, dt)
    assert relative(np.concatenate([r, v]), by_taylor_series(x, dt), 2) < 3e-14


@pytest.mark.parametrize("e", [*CONICS, 0.999])
@pytest.mark.parametrize("dt", [1e-3, 1.0, 1e3, 1e5, 1e7])
def test_invariants_and_the_way_back(e, dt):
    """Energy, angular momentum and the eccentricity vector stay; backwards one arrives where one left."""
    x = orbits.state(3, e, nu=1.1)
    r, v = propagate_kepler(x[:3], x[3:], MU, dt)

    def invariants(r, v):
        h = np.cross(r, v)
        energy = (v @ v / 2 - MU / np.linalg.norm(r)) * 7e6 / MU
        return np.concatenate([[energy], h / np.sqrt(MU * 7e6), np.cross(v, h) / MU - r / np.linalg.norm(r)])

    turns = dt / PERIOD
    assert_allclose(invariants(r, v), invariants(x[:3], x[3:]), rtol=0, atol=1e-13 * (10 + turns))
    back = np.concatenate(propagate_kepler(r, v, MU, -dt))
    assert relative(back, x, 3) < 1e-12 * (10 + 10 * turns)


def test_a_fall_towards_the_centre_and_a_body_at_rest():
    """Without angular momentum: thrown straight up it comes back; let go it falls, as long as the textbook says."""
    up = np.array([7e6, 0.0, 5000.0, 0.0])
    r0, v0 = 7e6, 5000.0
    top = 1 / (1 / r0 - v0**2 / (2 * MU))
    r, v = propagate_kepler([top, 0.0], [0.0, 0.0], MU, np.pi / np.sqrt(8) * 0.5 * np.sqrt(top**3 / MU))
    # from rest at distance a: t = sqrt(a^3 / 2 mu) (acos(sqrt(u)) + sqrt(u (1 - u))) with u = r / a (free-fall equation)
    u = r[0] / top
    fall = np.sqrt(top**3 / (2 * MU)) * (np.arccos(np.sqrt(u)) + np.sqrt(u * (1 - u)))
    assert fall == pytest.approx(np.pi / np.sqrt(8) * 0.5 * np.sqrt(top**3 / MU), rel=1e-12)
    u0 = r0 / top
    rise = np.sqrt(top**3 / (2 * MU)) * (np.arccos(np.sqrt(u0)) + np.sqrt(u0 * (1 - u0)))
    r, v = propagate_kepler(up[:2], up[2:], MU, 2 * rise)
    assert_allclose([*r, *v], [7e6, 0.0, -5000.0, 0.0], rtol=1e-12, atol=1e-6)


def test_a_whole_number_of_turns_comes_back():
    x = orbits.state(2, 0.1)
    period = ellipse.period(x, MU)
    for turns in (1, 10, 1000):
        r, v = propagate_kepler(x[:2], x[2:], MU, turns * period)
        assert relative(np.concatenate([r, v]), x, 2) < 1e-14 * (10 + 10 * turns)


# ---- its derivative --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("e", [0.0, 0.1, 0.7, 1.0, 1.5])
@pytest.mark.parametrize("span", [0.01, 0.3, 2.7, 10.0])
def test_transition_matrix_solves_the_variational_equations(d, e, span):
    x, unit, dt = orbits.state(d, e), orbits.units(d), span * PERIOD
    _, Phi = orbits.orbit(d, kernels.Kepler()).step(x, dt)
    _, integrated = orbits.orbit(d, kernels.DormandPrince(2e-15, 1e-15)).step(x, dt)
    a, b = (m * unit / unit[:, None] for m in (Phi, integrated))
    assert np.abs(a - b).max() < 1e-8 * np.abs(a).max()
    alone = kepler_transition(x[:d], x[d:], MU, dt) * unit / unit[:, None]
    assert_allclose(alone, a, rtol=0, atol=1e-11 * np.abs(a).max())


@pytest.mark.parametrize("e", [0.0, 0.3, 1.0, 2.0])
@pytest.mark.parametrize("dt", [-3000.0, 10.0, 2e4])
def test_transition_matrix_is_symplectic_and_inverts_backwards(e, dt):
    x, unit = orbits.state(3, e), orbits.units(3)
    scaled = kepler_transition(x[:3], x[3:], MU, dt) * unit / unit[:, None]
    J = np.block([[np.zeros((3, 3)), np.eye(3)], [-np.eye(3), np.zeros((3, 3))]])
    size = np.abs(scaled).max() ** 2
    assert_allclose(scaled.T @ J @ scaled, J, rtol=0, atol=1e-13 * size)
    r, v = propagate_kepler(x[:3], x[3:], MU, dt)
    back = kepler_transition(r, v, MU, -dt) * unit / unit[:, None]
    assert_allclose(back @ scaled, np.eye(6), rtol=0, atol=1e-12 * size)


@pytest.mark.usefixtures("uncompiled")
@pytest.mark.parametrize("e", [0.1, 1.0, 1.5])
def test_partials_by_an_estimated_gravity(e):
    problem = orbits.orbit(2, kernels.Kepler(), "estimated")
    unit = np.array([*orbits.units(2), MU])
    x = np.array([*orbits.state(2, e), MU])
    after, Phi = problem.step(x, 2500.0)
    numeric = differences.jacobian(lambda y: problem.step(y * unit, 2500.0)[0] / unit, x / unit, np.full(5, 2e-4))
    assert_allclose(Phi * unit / unit[:, None], numeric, rtol=0, atol=1e-8)
    assert after[4] == MU
    _, integrated = orbits.orbit(2, kernels.DormandPrince(1e-13, 1e-13), "estimated").step(x, 2500.0)
    assert_allclose(Phi * unit / unit[:, None], integrated * unit / unit[:, None], rtol=0, atol=1e-9)


# ---- as an integrator ------------------------------------------------------------------------------------------------


@pytest.mark.usefixtures("uncompiled")
def test_estimators_agree_with_those_of_small_steps():
    """EKF, graph and window with Kepler and with many small steps; the noise's quadrature is refined on both sides."""
    times = np.cumsum(np.random.default_rng(0).uniform(10, 120, 12))
    noise = pz.ProcessNoise([0.0, 0.0, 1e-4, 1e-4])
    problems = [orbits.orbit(2, solver, process_noise=noise) for solver in (kernels.Kepler(), kernels.RungeKutta8(4))]
    tracking = pz.simulate(problems[0], times, np.random.default_rng(1))
    for estimator in (pz.ExtendedKalmanFilter(), pz.FactorGraph(), pz.SlidingWindow(5)):
        one, other = (estimator.estimate(p, tracking) for p in problems)
        assert one.success, one.message
        sigma = np.sqrt(np.diagonal(other.covariance, axis1=1, axis2=2))
        assert np.abs((one.mean - other.mean) / sigma).max() < 1e-5


@pytest.mark.usefixtures("uncompiled")
def test_a_constant_state_passes_through_and_groups_may_be_named_otherwise():
    problem = orbits.orbit(2, kernels.Kepler(position=("x", "y"), velocity=["vx", "vy"], mu=MU), extra=True)
    x = np.array([*orbits.state(2, 0.1), 3.0])
    after, Phi = problem.step(x, 100.0)
    plain, Phi4 = orbits.orbit(2, kernels.Kepler()).step(x[:4], 100.0)
    assert_allclose(after, [*plain, 3.0], rtol=1e-15)
    assert_allclose(Phi, np.block([[Phi4, np.zeros((4, 1))], [np.zeros((1, 4)), np.ones((1, 1))]]), rtol=1e-14)


def changed(**changes):
    base = orbits.model(2)
    numbers = {
        "states": base.states,
        "dynamics": base.dynamics,
        "sensors": base.sensors,
        "parameters": base.parameters,
        "groups": dict(base.groups),
    }
    return pz.Model(**(numbers | changes))


BASE = list(orbits.model(2).dynamics)


@pytest.mark.parametrize(
    ("model", "solver", "message"),
    [
        (changed(dynamics=[*BASE[:2], BASE[2] + " - 1e-9*vx", BASE[3]]), kernels.Kepler(), "the rate of 'vx' is"),
        (
            changed(dynamics=[*BASE[:3], BASE[3] + "*(1 + 1e-3*(7e6/sqrt(x**2 + y**2))**2)"]),
            kernels.Kepler(),
            "the rate of 'vy'",
        ),
        (changed(dynamics=[*BASE[:2], BASE[2], BASE[3] + " + 1e-7*sin(t)"]), kernels.Kepler(), "the rate of 'vy'"),
        (changed(dynamics=["vx*1.0001", *BASE[1:]]), kernels.Kepler(), "the rate of 'x' is"),
        (changed(groups={}), kernels.Kepler(), "no group 'position'"),
        (orbits.model(2), kernels.Kepler("m"), "mu is 'm', which is not a parameter"),
        (orbits.model(2), kernels.Kepler(position=("x", "q")), "'q', which is not a state"),
        (orbits.model(2), kernels.Kepler(position=("x",)), "as many velocities as positions"),
        (orbits.model(2), kernels.Kepler(3.9e14), "the rate of 'vx' is"),
    ],
)
def test_other_dynamics_are_refused(model, solver, message):
    with pytest.raises(ValueError, match=message):
        pz.Problem(model, pz.Gaussian([7e6, 1e6, -1e3, 7e3], np.eye(4)), parameters={"mu": MU}, integrator=solver)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (([1.0, 0.0], [0.0], 1.0, 1.0), "same number of components"),
        (([0.0, 0.0], [0.0, 1.0], 1.0, 1.0), "r is zero"),
        (([1.0, 0.0], [0.0, 1.0], -1.0, 1.0), "mu is -1.0"),
        (([1.0, np.nan], [0.0, 1.0], 1.0, 1.0), "r is .* finite"),
    ],
)
def test_a_state_that_cannot_move_is_refused(arguments, message):
    with pytest.raises(ValueError, match=message):
        propagate_kepler(*arguments)


def test_many_states_at_once():
    x = np.array([orbits.state(3, e) for e in (0.1, 0.5, 1.2)])
    r, v = propagate_kepler(x[:, None, :3], x[:, None, 3:], MU, np.array([10.0, 20.0]))
    assert r.shape == v.shape == (3, 2, 3)
    assert_allclose(r[2, 1], propagate_kepler(x[2, :3], x[2, 3:], MU, 20.0)[0], rtol=0)


# ---- process noise ---------------------------------------------------------------------------------------------------


def integrated(x, dt, Q) -> np.ndarray:
    """Integral of Phi Q Phi^T to the end of `dt`, by ten nodes of Gauss and Legendre per tenth of the local time scale."""
    motion, d = orbits.orbit(len(x) // 2, kernels.Kepler()), len(x) // 2
    nodes, weights = np.polynomial.legendre.leggauss(10)
    total, at = np.zeros_like(Q), 0.0
    while at < dt:
        r, v = np.linalg.norm(x[:d]), np.linalg.norm(x[d:])
        h = min(0.1 * min(r / v, np.sqrt(r**3 / MU)), dt - at)
        for node, weight in zip(nodes, weights, strict=True):
            inside, _ = motion.step(x, h * (1 + node) / 2)
            _, E = motion.step(inside, dt - at - h * (1 + node) / 2)
            total += weight * h / 2 * E @ Q @ E.T
        x, _ = motion.step(x, h)
        at += h
    return total


@pytest.mark.parametrize("e", [0.0, 0.1, 0.7, 0.95, 1.0, 1.5])
@pytest.mark.parametrize("dt", [60.0, 600.0, 21600.0])
def test_noise_over_any_interval(e, dt):
    """From before periapsis, past it, over as much as six hours: four turns of the circular orbit."""
    x, Q = orbits.state(2, e, nu=-1.0), np.diag([0.0, 0.0, 1.0, 2.0])
    problem = orbits.orbit(2, kernels.Kepler(), process_noise=Q, prior=pz.Gaussian(x, np.eye(4)))
    expected = integrated(x, dt, Q)
    size = np.sqrt(np.diag(expected))
    found = pz.predict(problem, problem.prior, 0.0, dt)
    assert_allclose(found.Q / np.outer(size, size), expected / np.outer(size, size), rtol=0, atol=1e-8)
    assert np.linalg.eigvalsh(found.Q / np.outer(size, size)).min() > -1e-14
    assert_allclose(found.mean, problem.step(x, dt)[0], rtol=1e-13)


def test_noise_in_parts_is_the_noise_of_the_whole():
    x, Q = orbits.state(3, 0.6), np.diag([0.0] * 3 + [1.0, 2.0, 3.0])
    one, many = (
        pz.predict(orbits.orbit(3, solver, process_noise=Q), pz.Gaussian(x, np.eye(6)), 0.0, 20000.0).Q
        for solver in (kernels.Kepler(), kernels.Kepler(max_step=50.0))
    )
    size = np.sqrt(np.diag(many))
    assert_allclose(one / np.outer(size, size), many / np.outer(size, size), rtol=0, atol=1e-8)


def test_noise_over_more_turns_than_can_be_integrated_is_not_a_number():
    problem = orbits.orbit(2, kernels.Kepler(max_step=1e-3), process_noise=np.diag([0.0, 0.0, 1.0, 1.0]))
    predicted = pz.predict(problem, problem.prior, 0.0, 1001.0)
    assert np.isfinite(predicted.mean).all()
    assert np.isnan(predicted.Q).all()
