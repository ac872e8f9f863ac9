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

METHODS = [
    (kernels.Euler, 1),
    (kernels.Taylor, 1),
    (kernels.Midpoint, 2),
    (kernels.Heun, 2),
    (kernels.Ralston, 2),
    (kernels.RungeKutta4, 4),
    (kernels.DormandPrince5, 5),
    (kernels.RungeKutta8, 8),
]
NAMES = [m[0].__name__ for m in METHODS]
SPAN = 2.0


@pytest.fixture(scope="module")
def truth():
    """The driven pendulum after `SPAN` seconds and its derivative by state and constant, by mpmath's Taylor series."""
    k, x = 2, [0.4, -0.3, 0.2]
    with mpmath.workdps(20):

        def rate(t, y):
            """State, then the columns of its derivative by q, w and c: those of q' = w, w' = -k sin q - c w + ..."""
            q, w, c = y[0], y[1], mpmath.mpf(x[2])
            out = [w, -k * mpmath.sin(q) - c * w + mpmath.exp(-t) * mpmath.cos(3 * t)]
            for i in (2, 4, 6):
                out += [y[i + 1], -k * mpmath.cos(q) * y[i] - c * y[i + 1] - (w if i == 6 else 0)]
            return out

        start = [mpmath.mpf(v) for v in (*x[:2], 1, 0, 0, 1, 0, 0)]
        y = np.array([float(v) for v in mpmath.odefun(rate, 0, start, tol=mpmath.mpf("1e-16"))(SPAN)])
    return np.array(x), y[:2], y[2:].reshape(3, 2).T


def order_seen(error) -> float:
    """Order of convergence: log2 of the ratio of the errors with n and 2n substeps, as fine as rounding allows.

    For an error C h^p (1 + c h + ...) that ratio is 2^p (1 + O(h)), so the finest pair says most.  The same rule for every
    method: from 4 substeps, twice as many until 1024, or until the error falls below 1e-12, a hundred times what rounding
    leaves of a result of order one; the pair is the last above that.
    """
    errors, n = [error(4)], 8
    while n <= 1024 and (e := error(n)) > 1e-12:
        errors.append(e)
        n *= 2
    return float(np.log2(errors[-2] / errors[-1]))


@pytest.mark.parametrize(("method", "order"), METHODS, ids=NAMES)
def test_error_falls_with_the_power_of_the_order(method, order, truth):
    x, after, _ = truth

    def error(n):
        return np.abs(orbits.driven(method(n)).step(x, SPAN)[0][:2] - after).max()

    assert order_seen(error) == pytest.approx(order, abs=0.2)


@pytest.mark.parametrize(("method", "order"), METHODS, ids=NAMES)
def test_error_of_the_derivative_falls_with_it(method, order, truth):
    x, _, derivative = truth

    def error(n):
        return np.abs(orbits.driven(method(n)).step(x, SPAN)[1][:2] - derivative).max()

    assert order_seen(error) == pytest.approx(order, abs=0.2)


def test_a_user_s_tableau_has_its_own_order(truth):
    """Kutta's method of order 3, given as numbers."""
    x, after, _ = truth
    method = {"a": [[], [0.5], [-1, 2]], "b": [1 / 6, 2 / 3, 1 / 6]}

    def error(n):
        return np.abs(orbits.driven(pz.RungeKutta(**method, substeps=n)).step(x, SPAN)[0][:2] - after).max()

    assert order_seen(error) == pytest.approx(3, abs=0.2)


SOLVERS = [
    *(method(3) for method, _ in METHODS),
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
    "solver", [*(method(3) for method, _ in METHODS), kernels.DormandPrince(1e-12, 1e-12), kernels.Kepler()],
    ids=lambda s: type(s).__name__,
)  # fmt: skip
def test_derivative_on_an_orbit(solver, d):
    problem = orbits.orbit(d, solver)
    x, unit = orbits.state(d, 0.1), orbits.units(d)
    _, Phi = problem.step(x, 900.0)
    numeric = differences.jacobian(lambda y: problem.step(y * unit, 900.0)[0] / unit, x / unit, np.full(2 * d, 2e-4))
    assert_allclose(Phi * unit / unit[:, None], numeric, rtol=0, atol=2e-9)
