"""Every input of a problem is checked at the door: what was wrong, the value, where, and the nearest valid name."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

import piazzi as pz
from piazzi.problem.evaluation import MOST_KINDS
from tests.laws.problems import b612, random_covariance, satellite

NAN, INF = np.nan, np.inf
MODEL = pz.Model(
    ["x", "v"],
    ["v", "-k*x/abs(x)**3"],
    [pz.Sensor("range", ["hypot(x - mx, h)"]), pz.Sensor("pair", {"place": "x", "speed": "v"})],
    {"k": "fixed", "bias": "estimated"},
)


def problem(**changes):
    given = {
        "prior": pz.Gaussian([1.0, 0.5], np.eye(2)),
        "process_noise": np.zeros((2, 2)),
        "stations": [pz.Station("radar", "range", 0.01, {"mx": 0.0, "h": 1.0}), pz.Station("camera", "pair", np.eye(2))],
        "parameters": {"k": 1.0, "bias": pz.Gaussian(0.0, 1.0)},
    }
    return pz.Problem(MODEL, **(given | changes))


def radar(**changes):
    return pz.Station(**({"name": "radar", "sensor": "range", "noise": 0.01, "numbers": {"mx": 0.0, "h": 1.0}} | changes))


def prior(mean=(1.0, 0.5), covariance=((1.0, 0.0), (0.0, 1.0))):
    return {"prior": pz.Gaussian(mean, covariance)}


BAD = {
    # wrong shapes
    "short mean": (prior(mean=[1.0]), r"prior mean has 1 values; it needs 2 \(x, v\)"),
    "long mean": (prior(mean=[1.0, 2.0, 3.0]), "prior mean has 3 values; it needs 2"),
    "matrix as mean": (prior(mean=np.eye(2)), "prior mean has 4 values; it needs 2"),
    "covariance of another size": (prior(covariance=np.eye(3)), r"prior covariance has shape \(3, 3\); it must be \(2, 2\)"),
    "covariance of one number": (prior(covariance=2.0), r"prior covariance has shape \(\); it must be \(2, 2\)"),
    "Q of another size": ({"process_noise": np.eye(4)}, r"process noise Q has shape \(4, 4\); it must be \(2, 2\)"),
    "R of another size": (
        {"stations": [pz.Station("camera", "pair", np.eye(3))]},
        r"R of station 'camera' has shape \(3, 3\); it must be \(2, 2\)",
    ),
    "R of one number for two": (
        {"stations": [pz.Station("camera", "pair", 1.0)]},
        r"R of station 'camera' has shape \(\); .*\(place, speed\)",
    ),
    # asymmetric and indefinite
    "asymmetric prior": (
        prior(covariance=[[1, 0.5], [0.1, 1]]),
        r"prior covariance is not symmetric: \(x, v\) is 0.5 and \(v, x\) is 0.1",
    ),
    "indefinite prior": (prior(covariance=[[1, 2], [2, 1]]), "prior covariance must be positive semidefinite: .* -1"),
    "negative variance": (
        prior(covariance=[-1, 1]),
        "prior covariance must be positive semidefinite: the variance of 'x' is -1",
    ),
    "correlated with nothing": (
        prior(covariance=[[0, 0.5], [0.5, 1]]),
        r"prior covariance must be .*\(x, v\) is 0.5 beside a zero variance",
    ),
    "asymmetric Q": ({"process_noise": [[1, 0.5], [0, 1]]}, "process noise Q is not symmetric"),
    "indefinite Q": (
        {"process_noise": [0.0, -1.0]},
        "process noise Q must be positive semidefinite: the variance of 'v' is -1",
    ),
    "negative R": (
        {"stations": [radar(noise=-0.01)]},
        "R of station 'radar' must be positive definite: the variance of 'range' is -0.01",
    ),
    "zero R": (
        {"stations": [radar(noise=0.0)]},
        "R of station 'radar' must be positive definite: the variance of 'range' is 0",
    ),
    "singular R": (
        {"stations": [pz.Station("camera", "pair", np.ones((2, 2)))]},
        "R of station 'camera' must be positive definite: the smallest",
    ),
    # NaN and infinity
    "NaN in mean": (prior(mean=[1.0, NAN]), "prior mean of 'v' is nan; it must be finite"),
    "infinite mean": (prior(mean=[INF, 1.0]), "prior mean of 'x' is inf; it must be finite"),
    "NaN in covariance": (prior(covariance=[[1, NAN], [NAN, 1]]), r"prior covariance has nan at \(x, v\); it must be finite"),
    "infinite covariance": (prior(covariance=[INF, 1]), r"prior covariance has inf at \(x, x\)"),
    "NaN in Q": ({"process_noise": [NAN, 1.0]}, r"process noise Q has nan at \(x, x\)"),
    "NaN in R": ({"stations": [radar(noise=NAN)]}, r"R of station 'radar' has nan at \(range, range\)"),
    "NaN parameter": (
        {"parameters": {"k": NAN, "bias": pz.Gaussian(0, 1)}},
        "parameter 'k' is nan; it must be one finite number",
    ),
    "NaN in a constant's belief": (
        {"parameters": {"k": 1.0, "bias": pz.Gaussian(NAN, 1)}},
        "parameter mean of 'bias' is nan; it must be finite",
    ),
    "negative variance of a constant": (
        {"parameters": {"k": 1.0, "bias": pz.Gaussian(0, -1)}},
        "parameter variance must be positive semidefinite: the variance of 'bias' is -1",
    ),
    "infinite number": (
        {"stations": [radar(numbers={"mx": INF, "h": 1.0})]},
        "'mx' of station 'radar' is inf; it must be one finite number",
    ),
    "NaN prior time": ({"prior_time": NAN}, "prior_time is nan; it must be finite"),
    # not numbers at all
    "text in mean": (prior(mean=["1.0", "a"]), "prior mean is not made of real numbers"),
    "complex covariance": (
        prior(covariance=np.eye(2) * 1j),
        "prior covariance is not made of real numbers: it has type complex128",
    ),
    "ragged matrix": (prior(covariance=[[1, 0], [1]]), "prior covariance is not made of real numbers"),
    "objects": (prior(mean=[None, 1.0]), "prior mean is not made of real numbers: it has type object"),
    "text as parameter": ({"parameters": {"k": "1.0", "bias": pz.Gaussian(0, 1)}}, "parameter 'k' is not made of real numbers"),
    "two numbers as one": (
        {"parameters": {"k": [1.0, 2.0], "bias": pz.Gaussian(0, 1)}},
        r"parameter 'k' is \[1.0, 2.0\]; it must be one finite",
    ),
    # names
    "unknown parameter": (
        {"parameters": {"kk": 1.0, "k": 1.0, "bias": pz.Gaussian(0, 1)}},
        "unknown parameter 'kk'; did you mean 'k'",
    ),
    "no value": ({"parameters": {"bias": pz.Gaussian(0, 1)}}, "parameter 'k' has no value"),
    "a number for an estimated one": (
        {"parameters": {"k": 1.0, "bias": 0.0}},
        r"parameter 'bias' is estimated: give Gaussian\(mean, variance\), not 0.0",
    ),
    "unknown sensor": ({"stations": [radar(sensor="rnge")]}, "unknown sensor 'rnge'; did you mean 'range'"),
    "unknown number": (
        {"stations": [radar(numbers={"mx": 0.0, "h": 1.0, "my": 0.0})]},
        "gives 'my', which sensor 'range' does not use; known: h, mx",
    ),
    "missing number": (
        {"stations": [radar(numbers={"h": 1.0})]},
        "station 'radar' gives no value for 'mx', which sensor 'range' uses",
    ),
    "two of one name": ({"stations": [radar(), radar()]}, "two stations are called 'radar'"),
    "integrator of the wrong kind": (
        {"integrator": pz.Discrete()},
        "integrator Discrete does not fit: the model is continuous",
    ),
    # singular
    "at the centre": (
        prior(mean=[0.0, 1.0]),
        r"the dynamics of 'v' have no finite value at the prior mean \(x = 0, v = 1, bias = 0\)",
    ),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_input_is_refused_in_one_line(name):
    changes, match = BAD[name]
    with pytest.raises(ValueError, match=match) as error:
        problem(**changes)
    assert "\n" not in str(error.value)


def test_centre_of_the_earth_is_no_prior():
    with pytest.raises(ValueError, match="the dynamics of 'vx' have no finite value at the prior mean"):
        satellite(prior=pz.Gaussian(np.zeros(4), np.eye(4)))


def test_measurement_without_a_value_at_the_prior_mean():
    model = pz.Model(["x"], ["-x"], [pz.Sensor("depth", ["log(x)"])])
    with pytest.raises(ValueError, match="component 'depth' of station 'buoy' has no finite value at the prior mean"):
        pz.Problem(model, pz.Gaussian(-1.0, 1.0), stations=pz.Station("buoy", "depth", 1.0))


def test_measurement_without_a_derivative_at_the_prior_mean():
    """A radar that stands where the prior says the target is: the range is zero and has no direction."""
    with pytest.raises(
        ValueError, match=r"station 'radar' has no derivative at the prior mean \(x = 10, y = 0, vx = 0, vy = 9\)"
    ) as error:
        at_radar = b612(prior=pz.Gaussian([10.0, 0.0, 0.0, 9.0], np.eye(4)))
        pz.ExtendedKalmanFilter().estimate(at_radar, pz.Tracking([0.0, 0.1], [1.0, 1.0]))
    assert "\n" not in str(error.value)


def test_enumerations_name_their_values():
    with pytest.raises(ValueError, match="per is 'hour'; it must be one of second, step"):
        pz.ProcessNoise(np.eye(2), "hour")
    with pytest.raises(ValueError, match="method is 'exact'; it must be one of integral, scaled"):
        pz.ProcessNoise(np.eye(2), "second", "exact")
    with pytest.raises(ValueError, match="update is 'both'; it must be one of auto, joint, components"):
        pz.ExtendedKalmanFilter("both")
    for arguments, match in [
        ({"substeps": 0}, "substeps is 0; it must be a whole number of 1 or more"),
        ({"substeps": 2.5}, "substeps is 2.5"),
        ({"substeps": 3, "max_step": 1.0}, "give either substeps or max_step"),
        ({"max_step": -1.0}, "max_step is -1.0 s; it must be positive"),
        ({"max_step": NAN}, "max_step is nan"),
    ]:
        with pytest.raises(ValueError, match=match):
            pz.RungeKutta4(**arguments)


# ---- what is accepted ------------------------------------------------------------------------------------------------


def test_numbers_may_come_in_many_forms():
    a = problem(
        prior=pz.Gaussian([1, 0], [1, 4]), stations=pz.Station("radar", "range", [[0.01]], {"mx": 0, "h": np.float32(1)})
    )
    b = problem(prior=pz.Gaussian(np.array([1, 0]), np.diag([1, 4])), stations=[radar()])
    assert_array_equal(a.covariance, b.covariance)
    assert_array_equal(a.station_noise, b.station_noise)
    assert_array_equal(a.mean, [1.0, 0.0, 0.0])
    assert_array_equal(pz.Gaussian.from_sigma([0, 0], [2, 3]).covariance, np.diag([4, 9]))


def test_zero_and_semidefinite_covariances_are_accepted():
    p = problem(prior=pz.Gaussian([1, 0], np.zeros((2, 2))), process_noise=np.ones((2, 2)))
    assert not p.prior.covariance.any()
    assert_array_equal(p.process_noise.covariance[:2, :2], np.ones((2, 2)))


@given(st.integers(1, 9), st.integers(0, 2**32 - 1), st.floats(-12, 12), st.floats(-12, 12))
def test_covariances_in_any_units_are_accepted(n, seed, low, high):
    """Rounding of a product A A^T, and states whose units differ by many orders, are no reason to refuse."""
    rng = np.random.default_rng(seed)
    scale = 10 ** rng.uniform(min(low, high), max(low, high), n)
    P = random_covariance(rng, n, rank=int(rng.integers(1, n + 1))) * np.outer(scale, scale)
    P = P * (1 + 1e-13 * rng.standard_normal(P.shape))
    model = pz.Model([f"x{i}" for i in range(n)], ["0"] * n)
    kept = pz.Problem(model, pz.Gaussian(np.zeros(n), P)).covariance
    assert_array_equal(kept, kept.T)
    assert_allclose(kept, P, rtol=1e-12)


@given(st.integers(2, 6), st.integers(0, 2**32 - 1))
def test_indefinite_covariances_are_refused_in_any_units(n, seed):
    rng = np.random.default_rng(seed)
    scale, vectors = 10 ** rng.uniform(-8, 8, n), np.linalg.qr(rng.standard_normal((n, n)))[0]
    P = (vectors * np.linspace(-0.3, 1, n)) @ vectors.T
    model = pz.Model([f"x{i}" for i in range(n)], ["0"] * n)
    with pytest.raises(ValueError, match="must be positive semidefinite"):
        pz.Problem(model, pz.Gaussian(np.zeros(n), (P + P.T) / 2 * np.outer(scale, scale)))


def test_what_a_problem_holds_cannot_change_under_it():
    mean, P = np.array([1.0, 0.5]), np.eye(2)
    p = problem(prior=pz.Gaussian(mean, P))
    mean[0], P[0, 0] = 99.0, 99.0
    assert p.mean[0] == 1.0
    assert p.covariance[0, 0] == 1.0
    for array in (p.mean, p.covariance, p.given, p.station_noise, p.station_numbers, p.process_noise.covariance, p.prior.mean):
        with pytest.raises(ValueError, match="read-only"):
            array[...] = 0.0


def test_estimated_constants_join_the_state():
    p = problem(parameters={"k": 1.0, "bias": pz.Gaussian(0.25, 4.0)})
    assert_array_equal(p.mean, [1.0, 0.5, 0.25])
    assert_array_equal(p.covariance, np.diag([1.0, 1.0, 4.0]))
    assert_array_equal(p.given, [1.0])


def test_considered_parameters_are_given_by_their_mean():
    model = pz.Model(["x"], ["-k*x"], parameters={"k": "considered"})
    assert_array_equal(pz.Problem(model, pz.Gaussian(1.0, 1.0), parameters={"k": pz.Gaussian(0.3, 0.01)}).given, [0.3])


def test_stations_are_laid_out_for_the_kernels():
    p = problem()
    assert_array_equal(p.station_sensor, [0, 1])
    assert_array_equal(p.station_noise[0], [[0.01, 0.0], [0.0, 1.0]])
    assert_array_equal(p.station_numbers[0], [1.0, 0.0])  # h, mx
    assert_array_equal(p.station_correlated, [0, 0])
    assert problem(stations=[pz.Station("camera", "pair", [[1, 0.5], [0.5, 1]])]).station_correlated[0] == 1
    with pytest.raises(ValueError, match="unknown station 'rader'; did you mean 'radar'"):
        p.station_index("rader")


def test_prior_after_the_first_measurement_is_refused():
    with pytest.raises(ValueError, match="the prior is at 5 s, after the first measurement at 0 s"):
        pz.ExtendedKalmanFilter().estimate(b612(prior_time=5.0), pz.Tracking([0.0, 1.0], [1.0, 1.0]))


def test_prior_too_long_before_the_first_measurement_is_refused():
    with pytest.raises(ValueError, match=r"the first measurement is at 1e\+308 s, too far after -1e\+308 s"):
        pz.ExtendedKalmanFilter().estimate(b612(prior_time=-1e308), pz.Tracking([1e308], [1.0]))


@given(st.lists(st.floats(1e-3, 1e5), min_size=1, max_size=20), st.floats(1e-2, 1e3))
def test_no_substep_is_longer_than_asked(intervals, step):
    dt = np.array(intervals)
    counts = pz.RungeKutta4(max_step=step).counts(dt)
    assert (counts >= 1).all()
    assert (dt / counts <= step * (1 + 1e-11)).all()
    assert (counts - 1 < dt / step * (1 + 1e-11)).all()


def test_whole_number_of_steps_stays_whole():
    assert_array_equal(pz.Taylor(max_step=0.1).counts(np.arange(1, 50) * 0.1), np.arange(1, 50))


def test_kernels_that_are_loaded_stay_loaded_however_many_kinds_of_problems_come(monkeypatch):
    """Kinds for which no kernel was wanted are forgotten."""
    monkeypatch.setattr("piazzi.problem.evaluation._SPECS", kinds := {})
    monkeypatch.setattr("piazzi.problem.evaluation._ROOM", [MOST_KINDS])

    def kind(i):
        model = pz.Model(["x"], [f"-{i}*x"], [pz.Sensor("position", ["x"])])
        return pz.Problem(model, pz.Gaussian(1.0, 1.0), stations=pz.Station("here", "position", 1.0))

    wanted = [kind(i).spec("transition", "rates") for i in range(1, 4)]
    for i in range(4, 4 + 2 * MOST_KINDS):
        kind(i)
    assert [kind(i).spec("transition", "rates") for i in range(1, 4)] == wanted
    assert len(kinds) <= MOST_KINDS + 1


def test_another_prior_leaves_what_follows_of_the_new_one():
    old, new = problem(), pz.Gaussian([2.0, -0.5], 4.0 * np.eye(2))
    old.prior_bundle, old.given_bundle  # noqa: B018  # worked out, so that they could stay
    found, made = (
        old.with_prior(new, 3.0),
        pz.Problem(**{f: getattr(old, f) for f in old.__dataclass_fields__} | {"prior": new, "prior_time": 3.0}),
    )
    for name in ("mean", "covariance", "given"):
        assert_array_equal(getattr(found, name), getattr(made, name))
    assert_array_equal(found.prior_bundle.mean, made.mean)
    assert found.prior_start(np.array([7.0])) == 3.0
    assert found.specs is old.specs
    assert (old.prior_time, old.mean[0]) == (None, 1.0)
    with pytest.raises(ValueError, match="prior mean has 1 values"):
        old.with_prior(pz.Gaussian([1.0], np.eye(1)), None)
    with pytest.raises(ValueError, match="prior_time is nan"):
        old.with_prior(new, NAN)
