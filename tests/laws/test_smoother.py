"""The smoother: on linear problems Rauch, Tung and Striebel's, least squares and the graph; else along the filter's path."""

import mpmath
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

import piazzi as pz
from tests.laws.graphs import LinearCase, passes, spacecraft
from tests.laws.problems import MU_EARTH, assert_same_estimate, b612, linear, random_covariance, random_stable, satellite
from tests.laws.test_graph_linear import assert_graph_is
from tests.references import dense, smoother, textbook

SEEDS = st.integers(0, 2**32 - 1)
SIZES = st.integers(1, 9)
SENSORS = st.lists(st.integers(1, 3), min_size=1, max_size=3)
SMOOTHER = pz.Smoother(cross_covariances=True)


@pytest.mark.usefixtures("uncompiled")
class TestLinear:
    """Several stations, several rows an epoch, missing components, correlated R."""

    @given(SIZES, SENSORS, SEEDS)
    @settings(max_examples=15)
    def test_it_is_the_textbook_one(self, n, widths, seed):
        case = LinearCase(n, widths, seed)
        assert_graph_is(SMOOTHER.estimate(case.problem, case.tracking), smoother.rauch_tung_striebel(*case.chain), 1e-7)

    @given(SIZES, SENSORS, st.integers(0, 9), SEEDS)
    @settings(max_examples=20)
    def test_it_is_dense_least_squares_and_the_graph(self, n, widths, rank, seed):
        """With full, singular and zero process noise, correlated."""
        case = LinearCase(n, widths, seed, rank=rank if rank < n else None)
        estimate = SMOOTHER.estimate(case.problem, case.tracking)
        assert_graph_is(estimate, dense.smooth(*case.chain), 1e-7)
        assert_same_estimate(estimate, pz.FactorGraph().estimate(case.problem, case.tracking), 1e-7)

    @given(st.integers(1, 5), SENSORS, SEEDS)
    @settings(max_examples=10)
    def test_further_passes_change_nothing(self, n, widths, seed):
        case = LinearCase(n, widths, seed)
        once = SMOOTHER.estimate(case.problem, case.tracking)
        again = pz.Smoother(iterations=3, cross_covariances=True).estimate(case.problem, case.tracking)
        assert_same_estimate(again, once, 1e-7)
        assert_allclose(again.details["cross_covariances"], once.details["cross_covariances"], rtol=0, atol=1e-7)
        assert_allclose(again.innovations, once.innovations, rtol=0, atol=1e-7)

    @given(st.integers(1, 5), SENSORS, st.integers(0, 2), SEEDS)
    @settings(max_examples=15)
    def test_a_state_known_at_the_start(self, n, widths, rank, seed):
        case = LinearCase(n, widths, seed, rank=min(rank, n), sure=True)
        estimate, oracle = SMOOTHER.estimate(case.problem, case.tracking), dense.smooth(*case.chain)
        assert estimate.success, estimate.message
        assert_allclose(estimate.mean, oracle.mean, rtol=0, atol=1e-8)
        assert_allclose(estimate.covariance, oracle.covariance, rtol=0, atol=1e-8)
        assert estimate.mean[0, 0] == case.m[0]

    @pytest.mark.parametrize("epochs", [20, 30, 40, 60])
    def test_a_system_that_forgets_its_start(self, epochs):
        """Predicted covariances become singular to rounding: the textbook's inverse of them fails here without a sign."""
        c, s = np.cos(0.7), np.sin(0.7)
        V = np.array([[c, -s], [s, c]])
        A, H, P, z = V @ np.diag([0.5, 0.95]) @ V.T, np.array([[1.0, -0.4]]), np.eye(2), np.sin(np.arange(epochs))[:, None]
        R, Q = np.array([[0.01]]), np.zeros((2, 2))
        problem = linear(A, [H], [R], Q, pz.Gaussian(np.zeros(2), P))
        estimate = SMOOTHER.estimate(problem, pz.Tracking(np.arange(float(epochs)), z))
        chain = np.zeros(2), P, [A] * (epochs - 1), [Q] * (epochs - 1), [dense.Seen(v, H, R) for v in z]
        oracle = dense.smooth(*chain)
        assert_graph_is(estimate, oracle, 1e-10)
        if epochs == 30:
            wrong = smoother.rauch_tung_striebel(*chain)
            assert np.abs(wrong.covariance - oracle.covariance).max() > oracle.covariance.max()

    @pytest.mark.parametrize("epochs", [1, 2, 3])
    @pytest.mark.parametrize("prior_time", [None, -0.4])
    def test_few_epochs_and_a_prior_before_them(self, epochs, prior_time):
        """Continuous dynamics with integrated noise; the transition and noise of the oracle come from `predict`."""
        rng = np.random.default_rng(epochs)
        n, H, R = 3, rng.standard_normal((2, 3)), random_covariance(rng, 2)
        A, Q, P = random_stable(rng, n), random_covariance(rng, n, 1), random_covariance(rng, n)
        m, z, times = rng.standard_normal(n), rng.standard_normal((epochs, 2)), np.cumsum(rng.uniform(0.2, 1.0, epochs))
        problem = linear(A, [H], [R], Q, pz.Gaussian(m, P), discrete=False, per="second", prior_time=prior_time)
        nodes = times if prior_time is None else np.append(prior_time, times)
        steps = [pz.predict(problem, problem.prior, t, dt) for t, dt in zip(nodes, np.diff(nodes), strict=False)]
        skip = len(nodes) - epochs
        seen = [None] * skip + [dense.Seen(v, H, R) for v in z]
        oracle = dense.smooth(m, P, [s.Phi for s in steps], [s.Q for s in steps], seen)
        wanted = dense.Trajectory(oracle.mean[skip:], oracle.joint[skip:, :, skip:])
        assert_graph_is(SMOOTHER.estimate(problem, pz.Tracking(times, z)), wanted, 1e-9)

    @pytest.mark.parametrize("start", [0.0, 5.0])
    def test_constants_several_stations_and_a_prior_before_the_first_epoch(self, start):
        """Dense least squares of the problem as the filter linearised it, in deviations from its predictions."""
        problem = spacecraft(prior_time=0.0)
        tracking = passes(problem, 10, start=start)
        estimate, ekf = SMOOTHER.estimate(problem, tracking), pz.ExtendedKalmanFilter("components").estimate(problem, tracking)
        predictions, chain = linearised_along(problem, tracking, ekf)
        deviations = dense.smooth(*chain)
        n = problem.model.n
        oracle = textbook.Run(predictions + deviations.mean[1:, :n], deviations.covariance[1:, :n, :n], [], [])
        assert estimate.success, estimate.message
        assert_same_estimate(estimate, oracle, 1e-6)
        assert_array_equal(estimate.mean[-1], ekf.mean[-1])
        assert_array_equal(estimate.covariance[-1], ekf.covariance[-1])


def linearised_along(problem, tracking, ekf):
    """The filter's predictions (K, n), and the problem of the deviations from them, with a one below each, for `dense`."""
    n, t, before = problem.model.n, problem.prior_time, problem.prior
    transitions, noises, seen, predictions, last = [], [], [None], [], problem.mean
    for k, time in enumerate(tracking.times):
        step = pz.predict(problem, before, t, time - t)
        T = np.eye(n + 1)
        T[:n, :n], T[:n, n] = step.Phi, step.Phi @ (last - before.mean if k else np.zeros(n))
        transitions.append(T)
        noises.append(np.pad(step.Q, (0, 1)))
        rows = range(tracking.first_row[k], tracking.first_row[k + 1])
        stations = [problem.stations[problem.station_index(str(tracking.row_stations[r]))] for r in rows]
        H = np.vstack([problem.measurement_jacobian(s.name, step.mean, time) for s in stations])
        nu = np.concatenate([ekf.innovations[r, : len(s.noise)] for r, s in zip(rows, stations, strict=True)])
        R = np.zeros((len(nu), len(nu)))
        for s, end in zip(stations, np.cumsum([len(s.noise) for s in stations]), strict=True):
            R[end - len(s.noise) : end, end - len(s.noise) : end] = s.noise
        seen.append(dense.Seen(nu, np.pad(H, ((0, 0), (0, 1))), R))
        predictions.append(step.mean)
        before, last, t = pz.Gaussian(ekf.mean[k], ekf.covariance[k]), step.mean, time
    return np.array(predictions), (np.eye(n + 1)[n], np.pad(problem.covariance, (0, 1)), transitions, noises, seen)


def extended_smoother(problem, tracking, step, Q):
    """Rauch, Tung and Striebel's backward pass along an extended Kalman filter, with explicit inverses, in plain NumPy."""
    R, x, P = problem.stations[0].noise, problem.mean, problem.covariance
    predicted, updated, transitions = [], [], []
    for k, z in enumerate(tracking.values):
        if k:
            x, Phi = step(x, 0.0, tracking.times[k] - tracking.times[k - 1])
            P = Phi @ P @ Phi.T + Q
            transitions.append(Phi)
        predicted.append((x, P))
        nu, H, _ = textbook.stack(x, [textbook.bearing(z, R)])
        if not np.isnan(nu[0]):
            K = P @ H.T @ np.linalg.inv(H @ P @ H.T + R)
            x, P = x + K @ nu, (np.eye(4) - K @ H) @ P
        updated.append((x, P))
    means, covariances = [x], [P]
    for (x_next, P_next), (x_f, P_f), Phi in zip(predicted[:0:-1], updated[-2::-1], transitions[::-1], strict=True):
        G = P_f @ Phi.T @ np.linalg.inv(P_next)
        covariances.append(P_f + G @ (covariances[-1] - P_next) @ G.T)
        means.append(x_f + G @ (means[-1] - x_next))
    return textbook.Run(np.array(means[::-1]), np.array(covariances[::-1]), [], [])


def test_satellite_from_bearings_with_a_gap():
    problem = satellite()
    tracking = pz.simulate(problem, np.arange(300) * 15.0, np.random.default_rng(5))
    values = tracking.values.copy()
    values[100:105] = np.nan
    tracking = pz.Tracking(tracking.times, values, truth=tracking.truth)
    estimate = SMOOTHER.estimate(problem, tracking)
    noise = np.diag([0.01, 0.01, 0.0025, 0.0025]) * 15.0
    assert_same_estimate(estimate, extended_smoother(problem, tracking, textbook.taylor(MU_EARTH, 15), noise), 1e-6)
    ekf = pz.ExtendedKalmanFilter().estimate(problem, tracking)
    assert_array_equal(estimate.innovations, ekf.innovations)
    assert_array_equal(estimate.mean[-1], ekf.mean[-1])
    assert estimate.view == "delayed"
    assert estimate.success, estimate.message


@pytest.mark.parametrize("q", [0.01, 0.0], ids=["singular Q", "zero Q"])
def test_b612_stays_semidefinite_and_knows_more_than_the_filter(q, monkeypatch):
    monkeypatch.setenv("PIAZZI_JIT", "0")
    problem = b612((0.0, 0.0, q, q))
    tracking = pz.simulate(problem, np.arange(100) * 0.1, np.random.default_rng(0))
    smoothed, filtered = (e.estimate(problem, tracking) for e in (pz.Smoother(), pz.ExtendedKalmanFilter()))
    assert smoothed.success, smoothed.message
    s, f = (np.sqrt(np.diagonal(e.covariance, axis1=1, axis2=2)) for e in (smoothed, filtered))
    assert (s <= f * (1 + 1e-9)).all()
    assert_array_equal(smoothed.mean[-1], filtered.mean[-1])


def test_a_start_without_a_derivative_is_told_as_the_filter_tells_it():
    model = pz.Model(["x"], ["0"], [pz.Sensor("root", ["sqrt(x)"])])
    problem = pz.Problem(model, pz.Gaussian(0.0, 1.0), None, pz.Station("well", "root", 1.0))
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PIAZZI_JIT", "0")
        for estimator in (pz.ExtendedKalmanFilter(), pz.Smoother()):
            with pytest.raises(ValueError, match="station 'well' has no derivative at the prior mean"):
                estimator.estimate(problem, pz.Tracking([0.0, 1.0], [1.0, 2.0]))


@pytest.mark.parametrize("ratio", [1e2, 1e4])
@pytest.mark.parametrize("estimator", [pz.Smoother(), pz.FactorGraph(solver="chain"), pz.SlidingWindow(9)], ids=str)
def test_a_rough_measurement_counts_beside_precise_later_ones(estimator, ratio, monkeypatch):
    """A state at rest, seen roughly along one direction and then precisely along another: informations add up."""
    monkeypatch.setenv("PIAZZI_JIT", "0")
    rows = {"rough": ([0.6, 0.8], 0.1**2), "precise": ([0.8, 0.6], (0.1 / ratio) ** 2)}
    sensors = [pz.Sensor(name, [f"{a}*x + {b}*y"]) for name, ((a, b), _) in rows.items()]
    stations = [pz.Station(name, name, R) for name, (_, R) in rows.items()]
    model = pz.Model(("x", "y"), ("x", "y"), sensors, discrete=True)
    problem = pz.Problem(model, pz.Gaussian([0.0, 0.0], np.eye(2)), None, stations)
    seen = ["rough", "precise", "precise"]
    estimate = estimator.estimate(problem, pz.Tracking(np.arange(3.0), np.zeros(3), seen))
    with mpmath.workdps(60):
        information = mpmath.eye(2)
        for h, R in map(rows.get, seen):
            information += mpmath.matrix(h) * mpmath.matrix(h).T / mpmath.mpf(R)
        b = mpmath.matrix(rows["rough"][0])
        expected = float((b.T * information**-1 * b)[0])
    first = (estimate.delayed or estimate).covariance[0]
    assert_allclose(np.array([0.6, 0.8]) @ first @ [0.6, 0.8], expected, rtol=1e-12)


@pytest.mark.parametrize("gap", [8.0, 40.0])
@pytest.mark.parametrize("seed", range(4))
def test_passes_mend_what_the_filter_lost_over_a_gap(gap, seed):
    """Where a belief is long when the second pass begins, one linearisation over the gap is sigmas off; passes converge."""
    prior = pz.Gaussian([11.5, 0.0, 0.0, 9.7], 0.25 * np.eye(4))
    radar = pz.Station("radar", "range", 1e-4, {"mx": 10.0, "my": 0.0})
    problem = b612(Q=[0.0] * 4, prior=prior, stations=[radar])
    first = np.arange(0.0, 4.0, 0.1)
    tracking = pz.simulate(problem, np.concatenate([first, gap + first]), np.random.default_rng(seed))
    graph = pz.FactorGraph().estimate(problem, tracking)
    sigma = np.sqrt(np.diagonal(graph.covariance, axis1=1, axis2=2))
    off = [np.abs((pz.Smoother(iterations=i).estimate(problem, tracking).mean - graph.mean) / sigma).max() for i in (1, 3, 5)]
    assert graph.success
    assert off[0] > 0.5
    assert off[1] < 0.02
    assert off[2] < 1e-5
