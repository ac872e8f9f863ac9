"""Every method converges at its theoretical order, in state, derivative and noise; its derivative is that of the step taken."""

import mpmath
import numpy as np
import pytest
from numpy.testing import assert_allclose

import piazzi as pz
from piazzi import kernels
from piazzi.kernels import quadrature, tableaus
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
NOISE = np.diag([0.5, 0.0])  # of the angle: with noise of the rate, order 5's leading error changes sign near `SPAN`


@pytest.fixture(scope="module")
def truth():
    """The driven pendulum after `SPAN` seconds, its derivative and its process noise, by mpmath's Taylor series.

    The noise is the solution of Lyapunov's equation P' = F P + P F^T + Q along the motion, from P = 0.
    """
    k, x = 2, [0.4, -0.3, 0.2]
    with mpmath.workdps(20):

        def rate(t, y):
            """State; columns of its derivative by q, w and c, those of q' = w, w' = -k sin q - c w + ...; P as qq, qw, ww."""
            q, w, c = y[0], y[1], mpmath.mpf(x[2])
            out = [w, -k * mpmath.sin(q) - c * w + mpmath.exp(-t) * mpmath.cos(3 * t)]
            for i in (2, 4, 6):
                out += [y[i + 1], -k * mpmath.cos(q) * y[i] - c * y[i + 1] - (w if i == 6 else 0)]
            a, (qq, qw, ww) = -k * mpmath.cos(q), y[8:]
            return [*out, 2 * qw + NOISE[0, 0], ww + a * qq - c * qw + NOISE[0, 1], 2 * (a * qw - c * ww) + NOISE[1, 1]]

        start = [mpmath.mpf(v) for v in (*x[:2], 1, 0, 0, 1, 0, 0, 0, 0, 0)]
        y = np.array([float(v) for v in mpmath.odefun(rate, 0, start, tol=mpmath.mpf("1e-16"))(SPAN)])
    return np.array(x), y[:2], y[2:8].reshape(3, 2).T, y[[8, 9, 9, 10]].reshape(2, 2)


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
    x, after, _, _ = truth

    def error(n):
        return np.abs(orbits.driven(method(n)).step(x, SPAN)[0][:2] - after).max()

    assert order_seen(error) == pytest.approx(order, abs=0.2)


@pytest.mark.parametrize(("method", "order"), METHODS, ids=NAMES)
def test_error_of_the_derivative_falls_with_it(method, order, truth):
    x, _, derivative, _ = truth

    def error(n):
        return np.abs(orbits.driven(method(n)).step(x, SPAN)[1][:2] - derivative).max()

    assert order_seen(error) == pytest.approx(order, abs=0.2)


def noise_error(solver, truth) -> float:
    x, _, _, noise = truth
    problem = orbits.driven(solver, process_noise=NOISE)
    return float(np.linalg.norm(pz.predict(problem, pz.Gaussian(x[:2], np.eye(2)), 0.0, SPAN).Q[:2, :2] - noise))


@pytest.mark.parametrize(("method", "order"), METHODS, ids=NAMES)
def test_error_of_the_noise_falls_with_it(method, order, truth):
    assert order_seen(lambda n: noise_error(method(n), truth)) == pytest.approx(order, abs=0.2)


@pytest.mark.parametrize("rtol", [1e-3, 1e-6, 1e-9, 1e-12])
def test_error_of_adaptive_noise_keeps_to_the_tolerance(rtol, truth):
    assert noise_error(kernels.DormandPrince(rtol, rtol), truth) < 10 * rtol


@pytest.mark.parametrize(("order", "degree"), [(6, 5), (8, 7), (10, 9)])
def test_rules_integrate_polynomials_up_to_their_order(order, degree):
    """The defining property: x^m has the mean 1 / (m + 1) on [0, 1] for m below the order, and not beyond."""
    nodes, weights = map(np.array, quadrature.lobatto(order))
    off = [abs(weights @ nodes**m - 1 / (m + 1)) for m in range(order + 1)]
    assert max(off[: degree + 1]) < 3e-16
    assert off[order] > 1e-8
    assert weights.min() > 0
    assert (nodes[0], nodes[-1]) == (0.0, 1.0)


def test_a_user_s_tableau_has_its_own_order(truth):
    """Kutta's method of order 3, given as numbers; in the noise too, and so has one of order 5 in six stages."""
    x, after, _, _ = truth
    method = {"a": [[], [0.5], [-1, 2]], "b": [1 / 6, 2 / 3, 1 / 6]}

    def error(n):
        return np.abs(orbits.driven(pz.RungeKutta(**method, substeps=n)).step(x, SPAN)[0][:2] - after).max()

    assert order_seen(error) == pytest.approx(3, abs=0.2)
    assert order_seen(lambda n: noise_error(pz.RungeKutta(**method, substeps=n), truth)) == pytest.approx(3, abs=0.2)
    a, b, c = tableaus.DORMAND_PRINCE_5
    assert order_seen(lambda n: noise_error(pz.RungeKutta(a, b, c, substeps=n), truth)) == pytest.approx(5, abs=0.2)


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
