"""Every method converges at its theoretical order, state and derivative; its derivative is that of the step taken."""

import mpmath
import numpy as np
import pytest
from numpy.testing import assert_allclose

import piazzi as pz
from piazzi import kernels
from tests.references import differences
from tests.solvers import orbits

pytestmark = pytest.mark.usefixtures("uncompiled")

# method, order, substeps between rounding and the asymptotic regime
METHODS = [
    (kernels.Euler, 1, (256, 512, 1024)),
    (kernels.Taylor, 1, (256, 512, 1024)),
    (kernels.Midpoint, 2, (64, 128, 256)),
    (kernels.Heun, 2, (64, 128, 256)),
    (kernels.Ralston, 2, (64, 128, 256)),
    (kernels.RungeKutta4, 4, (16, 32, 64)),
    (kernels.DormandPrince5, 5, (48, 96, 144)),
    (kernels.RungeKutta8, 8, (8, 12, 18)),
]
NAMES = [m[0].__name__ for m in METHODS]
SPAN = 2.0


def exact(x, c, k=2.0, digits=22) -> np.ndarray:
    """The driven pendulum after `SPAN` seconds by mpmath's Taylor series."""
    with mpmath.workdps(digits):

        def rate(t, y):
            return [y[1], -k * mpmath.sin(y[0]) - c * y[1] + mpmath.exp(-t) * mpmath.cos(3 * t)]

        solution = mpmath.odefun(rate, 0, [mpmath.mpf(float(v)) for v in x], tol=mpmath.mpf(10) ** -17)
        return np.array([float(v) for v in solution(SPAN)])


@pytest.fixture(scope="module")
def truth():
    x = np.array([0.4, -0.3])
    return x, exact(x, mpmath.mpf("0.2"))


def slope(counts, errors) -> float:
    """Least-squares slope of log error against log step."""
    return -np.polyfit(np.log(counts), np.log(errors), 1)[0]


@pytest.mark.parametrize(("method", "order", "counts"), METHODS, ids=NAMES)
def test_error_falls_with_the_power_of_the_order(method, order, counts, truth):
    x, after = truth
    errors = [np.abs(orbits.driven(method(n)).step([*x, 0.2], SPAN)[0][:2] - after).max() for n in counts]
    assert slope(counts, errors) == pytest.approx(order, abs=0.25)


@pytest.mark.parametrize(("method", "order", "counts"), METHODS, ids=NAMES)
def test_error_of_the_derivative_falls_with_it(method, order, counts):
    """The derivative of the step converges at the same order, here to that of a much finer one of order 8."""
    reference = orbits.driven(kernels.RungeKutta8(100)).step([0.4, -0.3, 0.2], SPAN)[1]
    errors = [np.abs(orbits.driven(method(n)).step([0.4, -0.3, 0.2], SPAN)[1] - reference).max() for n in counts]
    assert slope(counts, errors) == pytest.approx(order, abs=0.35)


def test_a_user_s_tableau_has_its_own_order(truth):
    """Kutta's method of order 3, given as numbers."""
    x, after = truth
    counts = (32, 64, 128)
    method = {"a": [[], [0.5], [-1, 2]], "b": [1 / 6, 2 / 3, 1 / 6]}
    errors = [
        np.abs(orbits.driven(pz.RungeKutta(**method, substeps=n)).step([*x, 0.2], SPAN)[0][:2] - after).max() for n in counts
    ]
    assert slope(counts, errors) == pytest.approx(3, abs=0.2)


SOLVERS = [
    *(method(3) for method, _, _ in METHODS),
    kernels.RungeKutta([[], [0.5], [-1, 2]], [1 / 6, 2 / 3, 1 / 6], substeps=3),
    kernels.DormandPrince(1e-6, 1e-6),
    kernels.DormandPrince(1e-6, 1e-6, substeps=3),
    kernels.DormandPrince(1e-12, 1e-12),
]


@pytest.mark.parametrize("solver", SOLVERS, ids=lambda s: type(s).__name__)
def test_derivative_is_that_of_the_step_taken(solver):
    """Against central differences of the step itself, however coarse it is, with time, and with an estimated constant."""
    problem = orbits.driven(solver)
    x = np.array([0.4, -0.3, 0.2])
    _, Phi = problem.step(x, SPAN, 0.3)
    # the steps of an adaptive method are frozen in its derivative, and jump with the state by less than the tolerance
    atol = 1e-9 if not isinstance(solver, kernels.DormandPrince) else 3e-9 + 100 * solver.rtol
    assert_allclose(Phi, differences.jacobian(lambda y: problem.step(y, SPAN, 0.3)[0], x, np.full(3, 1e-3)), rtol=0, atol=atol)


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize(
    "solver", [*(method(3) for method, _, _ in METHODS), kernels.DormandPrince(1e-12, 1e-12), kernels.Kepler()],
    ids=lambda s: type(s).__name__,
)  # fmt: skip
def test_derivative_on_an_orbit(solver, d):
    problem = orbits.orbit(d, solver)
    x, unit = orbits.state(d, 0.1), orbits.units(d)
    _, Phi = problem.step(x, 900.0)
    numeric = differences.jacobian(lambda y: problem.step(y * unit, 900.0)[0] / unit, x / unit, np.full(2 * d, 2e-4))
    assert_allclose(Phi * unit / unit[:, None], numeric, rtol=0, atol=2e-9)
