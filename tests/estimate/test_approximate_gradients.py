"""A gravity field whose gradient is of less degree: the same answers of what iterates, and a word of what does not."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import piazzi as pz
from piazzi import earth

FIRST = np.array([6.9e6, 3e5, -2e5, 250.0, 5.3e3, 5.4e3])
OFF = np.array([2e3, -1e3, 1.5e3, 2.0, -1.0, 1.5])
PLACES = ([6.3e6, 5e5, 3e5], [5.5e6, 2.9e6, 1.2e6], [5.8e6, -1e6, 2.4e6])
TIMES = np.linspace(0.0, 900.0, 13)


@pytest.fixture(autouse=True)
def uncompiled(monkeypatch):
    monkeypatch.setenv("PIAZZI_JIT", "0")


def problem(gradient_degree, noise=None, prior_time=None, **sigmas):
    """Ranges from three places to a satellite about a field of degree 2, whose axes stand still."""
    rates = {"x": "vx", "y": "vy", "z": "vz", "vx": "gx", "vy": "gy", "vz": "gz"}
    sensor = pz.Sensor("range", ["sqrt((x - px)**2 + (y - py)**2 + (z - pz)**2)"])
    field = earth.Gravity("EGM2008", degree=2, gradient_degree=gradient_degree)
    model = pz.Model(
        list(rates), rates, [sensor], definitions={"gx, gy, gz": "field(x, y, z)"}, functions={"field": field.signature}
    )
    stations = [
        pz.Station(f"s{i}", "range", 100.0, dict(zip(("px", "py", "pz"), at, strict=True))) for i, at in enumerate(PLACES)
    ]
    prior = pz.Gaussian.from_sigma(FIRST, [3e3] * 3 + [3.0] * 3)
    return pz.Problem(
        model,
        prior,
        noise,
        stations,
        integrator=pz.RungeKutta4(max_step=75.0),
        truth=pz.Truth(FIRST + OFF),
        prior_time=prior_time,
        functions={"field": field},
    )


NOISE = np.diag([0.0, 0.0, 0.0, 1e-8, 1e-8, 1e-8])
CASES = [
    (pz.BatchLeastSquares(), None, None),
    (pz.BatchLeastSquares(), None, -50.0),
    (pz.FactorGraph(), NOISE, None),
    (pz.FactorGraph(start="prior"), NOISE, -50.0),
]


@pytest.mark.parametrize(("estimator", "noise", "prior_time"), CASES)
def test_iterations_end_with_the_whole_gradient(estimator, noise, prior_time):
    """The same states and covariances as with it throughout, in hardly more iterations, of which most are the cheap ones."""
    whole, less = (problem(degree, noise, prior_time) for degree in (None, 0))
    tracking = pz.simulate(whole, TIMES, np.random.default_rng(1))
    expected, found = (estimator.estimate(one, tracking) for one in (whole, less))
    assert expected.success
    assert found.success
    assert found.problem is less
    sigma = np.sqrt(np.diagonal(expected.covariance, axis1=1, axis2=2))
    assert_allclose((found.mean - expected.mean) / sigma, 0.0, rtol=0, atol=1e-6)
    scaled = (found.covariance - expected.covariance) / (sigma[:, :, None] * sigma[:, None])
    assert_allclose(scaled, 0.0, rtol=0, atol=1e-8)
    assert "approximate_iterations" not in expected.details
    assert found.details["approximate_iterations"] >= 1
    assert found.details["start"] == expected.details["start"]
    assert found.iterations <= expected.iterations + 2
    assert found.message == ""


def test_without_the_last_iterations_it_would_be_another_answer():
    """What the test above can tell: the covariances of the gradient of degree 0 differ."""
    whole, less = (problem(degree).with_steps(TIMES) for degree in (None, 0))
    (_, exact), (_, rough) = (one.step(one.mean, 900.0, 0.0) for one in (whole, less))
    assert 1e-4 < np.abs(rough - exact).max() / np.abs(exact).max() < 1e-2


@pytest.mark.parametrize(
    "estimator",
    [pz.ExtendedKalmanFilter(), pz.SquareRootKalmanFilter(), pz.Smoother(), pz.SlidingWindow(3)],
    ids=lambda e: type(e).__name__,
)
def test_what_linearises_once_says_so(estimator):
    whole, less = (problem(degree, NOISE) for degree in (None, 0))
    tracking = pz.simulate(whole, TIMES, np.random.default_rng(1))
    assert estimator.estimate(whole, tracking).message == ""
    found = estimator.estimate(less, tracking)
    assert found.success
    assert "approximate derivatives" in found.message
    assert "field" in found.message
    if found.delayed is not None:
        assert found.delayed.message == found.message


def test_sigma_points_need_no_gradient():
    less = problem(0, NOISE)
    tracking = pz.simulate(less, TIMES, np.random.default_rng(1))
    assert pz.UnscentedKalmanFilter().estimate(less, tracking).message == ""


def test_a_problem_with_exact_derivatives():
    less = problem(0)
    assert less.approximated == ("field",)
    exact = less.with_exact_derivatives()
    assert exact.approximated == ()
    assert exact.model is less.model
    assert_array_equal(exact.functions["field"].data, problem(None).functions["field"].data)
    assert exact.with_exact_derivatives() is exact
    assert replace(less, name="other").approximated == ("field",)
