"""Arrays in any layout, and noise below the rounding of what is measured."""

import numpy as np
import pytest
from numpy.testing import assert_array_equal

import piazzi as pz

pytestmark = pytest.mark.usefixtures("uncompiled")

K, P0 = 7, np.array([[2.0, 0.5], [0.5, 3.0]])
Z = np.random.default_rng(0).standard_normal((K, 2))
LAYOUTS = {
    "transposed": lambda a: np.ascontiguousarray(a.T).T,
    "fortran": np.asfortranarray,
    "strided": lambda a: np.repeat(np.repeat(a, 2, axis=0), 3, axis=-1)[::2, ::3] if a.ndim == 2 else np.repeat(a, 3)[::3],
    "reversed": lambda a: np.ascontiguousarray(a[::-1])[::-1],
    "column of a table": lambda a: np.hstack([a, a])[:, : a.shape[1]] if a.ndim == 2 else np.column_stack([a, a])[:, 0],
    "big endian": lambda a: a.astype(">f8"),
    "single precision": lambda a: a.astype("f4").astype("f8", order="F"),
}
ESTIMATORS = [
    pz.ExtendedKalmanFilter(), pz.UnscentedKalmanFilter(), pz.SquareRootKalmanFilter(), pz.Smoother(), pz.FactorGraph(),
    pz.SlidingWindow(3),
]  # fmt: skip


def given(layout=lambda a: a):
    """A problem and its tracking, every array in some layout."""
    model = pz.Model(["x", "v"], ["v", "-x"], [pz.Sensor("s", ["x", "v"])], groups={"position": ["x"], "velocity": ["v"]})
    problem = pz.Problem(
        model,
        pz.Gaussian(layout(np.array([0.3, -0.2])), layout(P0)),
        pz.ProcessNoise(layout(0.1 * P0)),
        [pz.Station("a", "s", layout(0.5 * P0))],
        integrator=pz.RungeKutta4(2),
        manoeuvres=[pz.Manoeuvre(2.5, layout(np.array([1.0])), np.array([[0.1]]))],
    )
    return problem, pz.Tracking(layout(np.arange(K) * 1.0), layout(Z), truth=layout(Z + 1))


@pytest.mark.parametrize("name", LAYOUTS)
@pytest.mark.parametrize("estimator", ESTIMATORS, ids=lambda e: type(e).__name__)
def test_the_layout_of_an_array_changes_no_bit(name, estimator):
    layout = LAYOUTS[name]
    same = (lambda a: a.astype("f4").astype("f8")) if name == "single precision" else (lambda a: a)
    one, other = (estimator.estimate(*given(of)) for of in (same, layout))
    assert_array_equal(other.mean, one.mean)
    assert_array_equal(other.covariance, one.covariance)


@pytest.mark.parametrize("name", LAYOUTS)
def test_functions_of_states_take_any_layout(name):
    problem, _ = given()
    x = Z if name != "single precision" else Z.astype("f4").astype("f8")
    laid = LAYOUTS[name](x)
    for function in (problem.dynamics, problem.dynamics_jacobian, lambda y: problem.step(y, 0.5)[1]):
        assert_array_equal(function(laid), function(x))
    assert_array_equal(problem.measure("a", laid), problem.measure("a", x))
    if name != "single precision":
        seen = [pz.observability(*both).information.singular_values for both in (given(), given(LAYOUTS[name]))]
        assert_array_equal(*seen)


# ---- noise below rounding --------------------------------------------------------------------------------------------


def ranges(variance, value=7e6):
    model = pz.Model(["x", "v"], ["v", "0"], [pz.Sensor("r", ["x"])])
    problem = pz.Problem(model, pz.Gaussian([value, 0], [1e-6, 1e-6]), None, [pz.Station("radar", "r", variance)])
    return problem, pz.Tracking([0.0, 1.0, 2.0], [value, np.nan, value])


@pytest.mark.parametrize("estimator", ESTIMATORS, ids=lambda e: type(e).__name__)
def test_noise_below_the_rounding_of_a_measurement_is_refused(estimator):
    """A double of 7e6 is known to 1.6e-9: a sigma of 1e-10 cannot be meant."""
    wanted = r"row 0 \(t = 0 s\): station 'radar' measured 7e\+06, which a number holds to 1.6e-09, with noise of sigma 1e-10"
    with pytest.raises(ValueError, match=wanted):
        estimator.estimate(*ranges(1e-20))
    assert estimator.estimate(*ranges(1e-16)).success


@pytest.mark.parametrize("estimator", [pz.ExtendedKalmanFilter(), pz.UnscentedKalmanFilter(), pz.SlidingWindow(3)])
def test_live_it_is_refused_too_and_changes_nothing(estimator):
    problem, _ = ranges(1e-20)
    live = estimator.start(problem)
    with pytest.raises(ValueError, match="'radar' measured 7e"):
        live.update("radar", 7e6, 0.0)
    live.update("radar", 1e-3, 0.0)
    assert np.isfinite(live.mean).all()


def test_small_values_may_have_small_noise():
    """What counts is the size of the values, not of the noise."""
    problem, _ = ranges(1e-200, value=1e-90)
    assert pz.ExtendedKalmanFilter().estimate(problem, pz.Tracking([0.0], [1e-90])).success
