"""A simulated truth obeys the problem: its noise has the covariance asked for, and is fed back into what follows."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

import piazzi as pz
from tests.laws.problems import b612, linear, network, random_covariance, random_stable, satellite
from tests.references.van_loan import discretize

FIVE_SIGMA = 5.0


@pytest.fixture(scope="module", autouse=True)
def uncompiled():
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PIAZZI_JIT", "0")
        yield


def assert_covariance(samples, expected):
    """Sample covariance of zero-mean rows within five of its own standard deviations, sqrt((C_ii C_jj + C_ij^2) / runs)."""
    found = samples.T @ samples / len(samples)
    spread = np.sqrt((np.outer(np.diag(expected), np.diag(expected)) + expected**2) / len(samples))
    assert (np.abs(found - expected) <= FIVE_SIGMA * spread + 1e-12 * np.abs(expected).max()).all()
    mean = samples.mean(axis=0)
    assert (np.abs(mean) <= FIVE_SIGMA * np.sqrt(np.diag(expected) / len(samples)) + 1e-12).all()


def steps_of(problem, times, rng):
    """What the truth does beyond the dynamics in each interval."""
    tracking = pz.simulate(problem, times, rng)
    x = tracking.truth
    dt = np.diff(times)
    carried = [problem.step(x[k], dt[k], times[k])[0] for k in range(len(dt))]
    return x[1:] - np.array(carried), tracking


def linear_problem(rng, n=3, Q=None, **changes):
    Q = random_covariance(rng, n) if Q is None else Q
    H, R = [rng.standard_normal((2, n))], [random_covariance(rng, 2)]
    return linear(random_stable(rng, n), H, R, Q, pz.Gaussian(np.zeros(n), np.eye(n)), **changes)


@pytest.mark.parametrize("rank", [0, 1, 2, 3])
def test_process_noise_has_covariance_Q(rank):
    """Per step, of any rank: a direction without noise stays without."""
    rng = np.random.default_rng(rank)
    Q = random_covariance(rng, 3, rank)
    w, _ = steps_of(linear_problem(rng, Q=Q), np.arange(2000.0), rng)
    assert_covariance(w, Q)
    quiet = np.linalg.svd(Q)[2][rank:]
    assert_allclose(w @ quiet.T, 0, atol=1e-7)


def test_states_of_very_different_units_all_get_their_noise():
    """Metres beside clock biases in seconds: each variance counts in its own unit."""
    rng = np.random.default_rng(0)
    scale = np.array([1e6, 1.0, 1e-9])
    Q = random_covariance(rng, 3) * np.outer(scale, scale)
    prior = pz.Gaussian(np.zeros(3), np.zeros((3, 3)))
    problem = linear(np.zeros((3, 3)), [np.ones((1, 3))], [np.eye(1)], Q, prior)
    tracking = pz.simulate(problem, np.arange(2000.0), rng)
    assert_covariance(tracking.truth[1:] / scale, Q / np.outer(scale, scale))


def test_integrated_noise_has_van_loans_covariance():
    rng = np.random.default_rng(1)
    A, Q, dt = random_stable(rng, 3) - np.eye(3), random_covariance(rng, 3, 2), 0.7
    prior = pz.Gaussian(np.zeros(3), np.eye(3))
    problem = linear(A, [np.ones((1, 3))], [np.eye(1)], Q, prior, discrete=False, per="second", integrator=pz.RungeKutta4(3))
    w, _ = steps_of(problem, np.arange(1000) * dt, rng)
    assert_covariance(w, discretize(A, Q, dt)[1])


def test_noise_scales_with_irregular_intervals():
    rng = np.random.default_rng(2)
    Q = random_covariance(rng, 2)
    problem = linear_problem(rng, 2, Q, per="second", method="scaled")
    times = np.cumsum(rng.uniform(0.1, 3.0, 2000))
    w, _ = steps_of(problem, times, rng)
    assert_covariance(w / np.sqrt(np.diff(times))[:, None], Q)


def test_noise_is_white():
    """What disturbs one interval says nothing about the next."""
    rng = np.random.default_rng(3)
    Q = random_covariance(rng, 3)
    w, _ = steps_of(linear_problem(rng, Q=Q), np.arange(2000.0), rng)
    assert (np.abs(w[1:].T @ w[:-1] / len(w)) <= FIVE_SIGMA * np.sqrt(np.outer(np.diag(Q), np.diag(Q)) / len(w))).all()


def test_measurements_have_covariance_R_and_see_the_disturbed_truth():
    rng = np.random.default_rng(4)
    problem = linear_problem(rng)
    _, tracking = steps_of(problem, np.arange(2000.0), rng)
    seen = tracking.values - problem.measure("station0", tracking.truth)
    assert_covariance(seen, problem.stations[0].noise)


def test_process_noise_is_fed_back():
    """The state wanders: its variance grows with the number of steps, as that of a random walk."""
    rng = np.random.default_rng(5)
    prior = pz.Gaussian([0.0], [0.0])
    walk = linear(np.eye(1), [np.eye(1)], [np.eye(1)], [2.0], prior)
    ends = np.array([pz.simulate(walk, np.arange(51.0), rng).truth[[10, 50], 0] for _ in range(500)])
    assert_covariance(ends, np.array([[20.0, 20.0], [20.0, 100.0]]))


def test_first_state_is_drawn_from_the_prior():
    rng = np.random.default_rng(6)
    P, mean = random_covariance(rng, 3, rank=2), np.array([5.0, -3.0, 2.0])
    problem = linear(np.eye(3), [np.ones((1, 3))], [np.eye(1)], np.zeros((3, 3)), pz.Gaussian(mean, P))
    starts = np.array([pz.simulate(problem, [0.0], rng).truth[0] for _ in range(1000)])
    assert_covariance(starts - mean, P)


def test_prior_time_before_the_first_epoch_is_travelled():
    rng = np.random.default_rng(7)
    A = random_stable(rng, 2)
    problem = linear(
        A, [np.ones((1, 2))], [np.eye(1)], np.zeros((2, 2)), pz.Gaussian([1.0, 2.0], np.zeros((2, 2))), prior_time=-1.0
    )
    assert_allclose(pz.simulate(problem, [0.0, 1.0], rng).truth, [A @ [1, 2], A @ A @ [1, 2]], rtol=1e-13)


# ---- the truth half --------------------------------------------------------------------------------------------------


def test_fixed_truth_free_of_noise_is_the_orbit_itself():
    problem = b612()
    tracking = pz.simulate(problem, np.arange(20) * 0.1, np.random.default_rng(0))
    x = np.array([11.0, 0.0, 0.0, 10.0])
    for k in range(20):
        assert_allclose(tracking.truth[k], x, rtol=1e-13)
        x, _ = problem.step(x, 0.1)
    other = pz.simulate(b612(Q=(1.0, 1.0, 1.0, 1.0)), np.arange(20) * 0.1, np.random.default_rng(1))
    assert_array_equal(other.truth, tracking.truth)  # whatever the estimators assume, and whatever the seed


def test_noiseless_measurements_are_h_of_the_truth():
    problem = b612(truth=pz.Truth(state=[11.0, 0.0, 0.0, 10.0], measurement_noise=False))
    tracking = pz.simulate(problem, np.arange(20) * 0.1, np.random.default_rng(0))
    assert_allclose(tracking.values[:, 0], np.hypot(tracking.truth[:, 0] - 10, tracking.truth[:, 1]), rtol=1e-13)


def test_truth_may_have_other_parameters_integrator_and_noise():
    quiet = pz.ProcessNoise(np.zeros(4), "step")
    truth = pz.Truth(state=[11.0, 0, 0, 10.0], parameters={"mu": 900.0}, process_noise=quiet, integrator=pz.Taylor(3))
    problem = b612(truth=truth)
    tracking = pz.simulate(problem, np.arange(5) * 0.1, np.random.default_rng(0))
    actual = b612(parameters={"mu": 900.0}, integrator=pz.Taylor(3))
    x = np.array([11.0, 0, 0, 10.0])
    for k in range(5):
        assert_allclose(tracking.truth[k], x, rtol=1e-13)
        x, _ = actual.step(x, 0.1)
    assert problem.parameters["mu"] == 1000.0  # the estimators' half is untouched


def test_truth_of_estimated_constants():
    model = pz.Model(["x"], ["c"], [pz.Sensor("s", ["x"])], {"c": "estimated"})
    numbers = {
        "prior": pz.Gaussian(0.0, 0.0),
        "stations": pz.Station("s", "s", 1.0),
        "parameters": {"c": pz.Gaussian(2.0, 9.0)},
    }
    rng = np.random.default_rng(0)
    drawn = np.array([pz.simulate(pz.Problem(model, **numbers), [0.0], rng).truth[0, 1] for _ in range(600)])
    assert_covariance(drawn[:, None] - 2.0, np.array([[9.0]]))
    fixed = pz.Problem(model, **numbers, truth=pz.Truth(parameters={"c": 5.0}))
    assert_allclose(pz.simulate(fixed, [0.0, 1.0], rng).truth, [[0.0, 5.0], [5.0, 5.0]], atol=1e-12)


def test_same_seed_same_noise_whatever_the_mismatch():
    """A truth half changes what is asked, not which numbers are drawn: studies compare like with like."""
    times = np.arange(30) * 0.1
    a = pz.simulate(b612(), times, np.random.default_rng(3))
    b = pz.simulate(b612(Q=(0.0, 0.0, 0.0, 0.0)), times, np.random.default_rng(3))
    assert_array_equal(a.values, b.values)


# ---- angles, stations, refusals --------------------------------------------------------------------------------------


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=10)
def test_angles_come_wrapped(seed):
    tracking = pz.simulate(satellite(), np.arange(100) * 900.0, np.random.default_rng(seed))
    assert (np.abs(tracking.values) <= np.pi).all()
    expected = np.arctan2(tracking.truth[:, 1], tracking.truth[:, 0])
    error = np.angle(np.exp(1j * (tracking.values[:, 0] - expected)))
    assert np.abs(error).max() < 6 * 0.2 * np.pi / 180


def test_stations_take_turns_as_asked():
    problem = network(np.random.default_rng(0))
    every = pz.simulate(problem, [0.0, 0.5], np.random.default_rng(0))
    assert list(every.row_stations) == ["north", "south", "east", "west"] * 2
    some = pz.simulate(problem, [0.0, 0.5], np.random.default_rng(0), ["east", "south"])
    assert list(some.row_stations) == ["east", "south"] * 2
    missing = np.isnan(some.values)
    assert_array_equal(missing, [[False, True, True], [False, False, False]] * 2)


def test_refusals():
    rng = np.random.default_rng(0)
    for times, match in [
        ([], "there are no times to simulate"),
        ([0.0, np.nan], "time 1 is not finite"),
        ([0.0, 2.0, 1.0], "times must increase: time 2 is 1 s, after 2 s"),
        ([-1e308, 1e308], r"time 1 is at 1e\+308 s, too far after -1e\+308 s"),
        ([0.0, 0.0], "times must increase: time 1 is 0 s, after 0 s"),
    ]:
        with pytest.raises(ValueError, match=match):
            pz.simulate(b612(), times, rng)
    with pytest.raises(ValueError, match="unknown station 'rader'; did you mean 'radar'"):
        pz.simulate(b612(), [0.0], rng, ["rader"])
    with pytest.raises(ValueError, match="unknown parameter 'm'; did you mean 'mu'"):
        pz.simulate(b612(truth=pz.Truth(parameters={"m": 1.0})), [0.0], rng)
    with pytest.raises(ValueError, match="true state of 'y' is nan"):
        pz.simulate(b612(truth=pz.Truth(state=[1.0, np.nan, 0.0, 0.0])), [0.0], rng)
    with pytest.raises(ValueError, match="the problem has no stations"):
        pz.simulate(b612(stations=()), [0.0], rng)


def test_a_truth_that_falls_into_the_centre_is_refused():
    truth = pz.Truth(state=[0.0, 0.0, 0.0, 0.0], process_noise=pz.ProcessNoise(np.zeros(4), "step"))
    with pytest.raises(
        ValueError,
        match=r"the simulated truth is not finite from epoch 1 \(t = 0.1 s\); it started at x = 0, y = 0, vx = 0, vy = 0",
    ):
        pz.simulate(b612(truth=truth), [0.0, 0.1, 0.2], np.random.default_rng(0))
