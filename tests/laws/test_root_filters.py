"""The unscented and the square-root filter: what they equal, what must not matter, and where they stay semidefinite."""

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

import piazzi as pz
from tests.laws.graphs import passes, spacecraft
from tests.laws.problems import MU_EARTH, assert_same_estimate, b612, linear, network, random_stable, satellite, sigma
from tests.laws.test_invariance import TURN, observed
from tests.laws.test_linear import Case
from tests.references import textbook, unscented
from tests.solvers import orbits

SEEDS = st.integers(0, 2**32 - 1)
SIZES = st.integers(1, 9)
WIDTHS = st.lists(st.integers(1, 3), min_size=1, max_size=3)
FILTERS = {
    "srekf": pz.SquareRootKalmanFilter(),
    "ukf": pz.UnscentedKalmanFilter(),
    "ukf, wide": pz.UnscentedKalmanFilter(1.0, 2.0, 0.5),
}
EACH = pytest.mark.parametrize("estimator", FILTERS.values(), ids=list(FILTERS))
STATIONS = {"north": (0.0, 1.0), "south": (0.0, -1.0), "east": (1.0, 0.0), "west": (-1.0, 0.0)}


@pytest.mark.usefixtures("uncompiled")
class TestLinear:
    @EACH
    @given(SIZES, WIDTHS, SEEDS)
    @settings(max_examples=15)
    def test_it_is_the_textbook_kalman_filter(self, estimator, n, widths, seed):
        """Any number of states, several stations of different widths, full R, singular Q, missing components."""
        case = Case(n, widths, seed, missing=0.3)
        estimate, run = estimator.estimate(case.problem, case.tracking()), case.textbook()
        assert estimate.success, estimate.message
        assert_same_estimate(estimate, run, 1e-8)
        ekf = case.estimate()
        assert_allclose(estimate.innovations, ekf.innovations, rtol=1e-8, atol=1e-8)
        assert_allclose(estimate.innovation_covariances, ekf.innovation_covariances, rtol=1e-8, atol=1e-8)

    @EACH
    @given(st.integers(1, 4), SEEDS)
    @settings(max_examples=10)
    def test_known_states_stay_known(self, estimator, n, seed):
        """A prior without doubt and no process noise: measurements change nothing."""
        rng = np.random.default_rng(seed)
        A, x = random_stable(rng, n), rng.standard_normal(n)
        problem = linear(A, [rng.standard_normal((2, n))], [np.eye(2)], np.zeros((n, n)), pz.Gaussian(x, np.zeros((n, n))))
        estimate = estimator.estimate(problem, pz.Tracking(np.arange(3.0), rng.standard_normal((3, 2))))
        assert estimate.success, estimate.message
        assert_allclose(estimate.mean, [x, A @ x, A @ A @ x], rtol=1e-12, atol=1e-13)
        assert not estimate.covariance.any()

    @EACH
    @given(st.integers(2, 6), SEEDS)
    @settings(max_examples=15)
    def test_a_prior_with_directions_that_are_known(self, estimator, n, seed):
        """Singular, or nearly: correlations of 1 - 1e-12."""
        rng = np.random.default_rng(seed)
        case = Case(n, [2], seed)
        a = rng.standard_normal((n, 1))
        for extra in (0.0, 1e-12):
            P = a @ a.T + extra * np.eye(n)
            problem = linear(case.A, case.H, case.R, case.Q, pz.Gaussian(np.zeros(n), P))
            estimate = estimator.estimate(problem, case.tracking())
            assert estimate.success, estimate.message
            ekf = pz.ExtendedKalmanFilter().estimate(problem, case.tracking())
            unit = np.where(sigma(ekf) > 1e-5, sigma(ekf), 1.0)
            assert_same_estimate(estimate, ekf, 1e-7, unit=unit)


def test_square_root_keeps_what_a_covariance_loses():
    """Two measurements that differ in their eighth digit, more exact than that (Kaminski, Bryson and Schmidt 1971).

    S = H P H^T + R is singular in double precision.  The truth is by fractions.
    """
    delta = 1e-9
    H, R = np.array([[1.0, 1.0, 1.0], [1.0, 1.0, 1.0 + delta]]), delta**2 * np.eye(2)
    problem = linear(np.eye(3), [H], [R], np.zeros((3, 3)), pz.Gaussian(np.zeros(3), np.eye(3)))
    z = H @ np.array([0.3, -0.2, 0.7])
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PIAZZI_JIT", "0")
        tracking = pz.Tracking([0.0, 1.0], [[np.nan, np.nan], z])
        root = pz.SquareRootKalmanFilter().estimate(problem, tracking)
        plain = [pz.ExtendedKalmanFilter(u).estimate(problem, tracking) for u in ("joint", "components")]
    mean, P = exact_update(H, R, z)
    s = np.sqrt(np.diag(P))
    for estimate in (root, *plain):
        assert estimate.success, estimate.message
        assert np.linalg.eigvalsh(estimate.covariance[1] / np.outer(s, s)).min() > -1e-12
        assert_allclose(estimate.covariance[1] / np.outer(s, s), P / np.outer(s, s), rtol=0, atol=1e-6)
        assert_allclose((estimate.mean[1] - mean) / s, 0, atol=1e-6)
    for estimate in plain:  # a covariance would be no number, or wrong by tenths
        assert estimate.details["solver"] == "square root"


def exact_update(H, R, z):
    """Mean and covariance of N(0, I) after z = H x + v, v ~ N(0, R), in fractions: information form, eliminated exactly."""
    n = H.shape[1]
    h = [[Fraction(float(v)) for v in row] for row in H]
    rows = []
    for i in range(n):
        row = [
            Fraction(int(i == j)) + sum(h[c][i] * h[c][j] / Fraction(float(R[c, c])) for c in range(len(h))) for j in range(n)
        ]
        right = sum(h[c][i] * Fraction(float(z[c])) / Fraction(float(R[c, c])) for c in range(len(h)))
        rows.append([*row, right, *(Fraction(int(i == j)) for j in range(n))])
    for j in range(n):
        rows[j] = [v / rows[j][j] for v in rows[j]]
        for i in range(n):
            if i != j:
                rows[i] = [a - rows[i][j] * b for a, b in zip(rows[i], rows[j], strict=True)]
    solved = np.array([[float(v) for v in row[n:]] for row in rows])
    return solved[:, 0], solved[:, 1:]


@pytest.mark.usefixtures("uncompiled")
class TestNetwork:
    """Stations with one, two and three components, angles among them, full R, missing values."""

    @EACH
    @given(SEEDS, st.integers(-3, 3))
    @settings(max_examples=8)
    def test_whole_turns_of_an_angle_change_nothing(self, estimator, seed, turns):
        problem, tracking = observed(seed)
        angles = {"radar": 1, "doppler": 0}
        values = tracking.values.copy()
        for row, name in zip(values, tracking.row_stations, strict=True):
            sensor = problem.stations[problem.station_index(str(name))].sensor
            if sensor in angles:
                row[angles[sensor]] += turns * TURN
        turned = pz.Tracking(tracking.row_times, values, tracking.row_stations)
        assert_same_estimate(estimator.estimate(problem, turned), estimator.estimate(problem, tracking), 1e-9)

    @EACH
    @given(SEEDS)
    @settings(max_examples=8)
    def test_stations_at_one_epoch_commute(self, estimator, seed):
        problem, tracking = observed(seed)
        rng = np.random.default_rng(seed)
        order = np.concatenate(
            [rng.permutation(np.arange(a, b)) for a, b in zip(tracking.first_row, tracking.first_row[1:], strict=False)]
        )
        permuted = pz.Tracking(tracking.row_times[order], tracking.values[order], tracking.row_stations[order])
        one, other = estimator.estimate(problem, tracking), estimator.estimate(problem, permuted)
        assert_same_estimate(other, one, 1e-9)
        assert_allclose(other.innovations, one.innovations[order], rtol=1e-8, atol=1e-11)
        assert_allclose(other.innovation_covariances, one.innovation_covariances[order], rtol=1e-8, atol=1e-13)

    @given(SEEDS)
    @settings(max_examples=10)
    def test_square_root_form_is_the_filter(self, seed):
        problem, tracking = observed(seed)
        root, ekf = (e.estimate(problem, tracking) for e in (pz.SquareRootKalmanFilter(), pz.ExtendedKalmanFilter()))
        assert_same_estimate(root, ekf, 1e-9)
        assert_allclose(root.innovations, ekf.innovations, rtol=1e-9, atol=1e-12)
        assert_allclose(root.innovation_covariances, ekf.innovation_covariances, rtol=1e-9, atol=1e-14)

    @given(SEEDS, st.sampled_from([(0.5, 2.0, 0.0), (1.0, 0.0, 0.0), (1.0, 2.0, -1.0), (0.7, 1.0, 2.0)]))
    @settings(max_examples=12)
    def test_unscented_filter_is_the_textbook_one(self, seed, numbers):
        """All rows of an epoch as one vector, whatever the weights; the process noise from `predict` along the mean."""
        problem, tracking = observed(seed)
        epochs = []
        for k in range(len(tracking.times)):
            rows = range(tracking.first_row[k], tracking.first_row[k + 1])
            epochs.append([hand_row(problem, str(tracking.row_stations[r]), tracking.values[r]) for r in rows])
        move = textbook.runge_kutta(lambda t, x: textbook.gravity(x, 1.0), 4)
        estimate = pz.UnscentedKalmanFilter(*numbers).estimate(problem, tracking)
        noises = {}
        before = tracking.times[0]
        for mean, P, t in zip(estimate.mean[:-1], estimate.covariance[:-1], tracking.times[1:], strict=True):
            noises[before] = pz.predict(problem, pz.Gaussian(mean, P), before, t - before).Q
            before = t
        run = unscented.unscented_kalman_filter(
            problem.mean,
            problem.covariance,
            tracking.times,
            epochs,
            lambda x, t, dt: move(x, t, dt)[0],
            lambda t, dt: noises[t],
            *numbers,
        )
        assert estimate.success, estimate.message
        assert_same_estimate(estimate, run, 1e-7)
        for k, theirs in enumerate(run.innovations):
            ours = estimate.innovations[tracking.first_row[k] : tracking.first_row[k + 1]]
            ours = np.concatenate([nu[: len(r.z)] for nu, r in zip(ours, epochs[k], strict=True)])
            assert_allclose(ours, theirs, rtol=1e-7, atol=1e-9)


def hand_row(problem, name, z):
    """A row of the network by hand: range, azimuth and range rate in the order of each sensor."""
    station = problem.stations[problem.station_index(name)]
    place = np.array(STATIONS[name])

    def h(x):
        d = x[:2] - place
        far, azimuth = np.hypot(*d), np.arctan2(d[1], d[0])
        rate = d @ x[2:] / far
        return np.array({"range": [far], "radar": [far, azimuth], "doppler": [azimuth, rate, far]}[station.sensor])

    angle = {"range": [False], "radar": [False, True], "doppler": [True, False, False]}[station.sensor]
    return textbook.Row(z[: len(angle)], h, lambda x: None, station.noise, angle)


MOTIONS = {
    "integral": {},
    "orbit axes": {"process_noise": pz.ProcessNoise([0.1, 0.2, 1e-4, 4e-4], "second", "scaled", axes="orbit")},
    "manoeuvre": {"manoeuvres": [pz.Manoeuvre(37.3, [3.0, -2.0], [[0.04, 0.01], [0.01, 0.09]])]},
    "estimated mu": {"mu_role": "estimated", "parameters": {"mu": pz.Gaussian(orbits.MU, 1e18)}},
    "prior before": {"prior_time": -25.0},
}


@pytest.mark.parametrize("what", MOTIONS)
@pytest.mark.parametrize(
    "solver", [pz.RungeKutta4(6), pz.Kepler(), pz.DormandPrince(rtol=1e-10)], ids=lambda s: type(s).__name__
)
def test_every_kind_of_motion_and_noise(what, solver, monkeypatch):
    """The square-root form is the filter; where sigma is small beside the orbit, the unscented one nearly is."""
    monkeypatch.setenv("PIAZZI_JIT", "0")
    noise = {"process_noise": pz.ProcessNoise([0.1, 0.1, 1e-4, 1e-4])}
    problem = orbits.orbit(2, solver, **(noise | MOTIONS[what]))
    tracking = pz.simulate(problem, np.array([0.0, 60.0, 75.0, 200.0]), np.random.default_rng(0))
    ekf, root, ukf = (
        e.estimate(problem, tracking)
        for e in (pz.ExtendedKalmanFilter(), pz.SquareRootKalmanFilter(), pz.UnscentedKalmanFilter())
    )
    assert_same_estimate(root, ekf, 1e-8)
    assert ukf.success, ukf.message
    assert_same_estimate(ukf, ekf, 1e-3)


def test_constants_and_passes_of_several_stations(monkeypatch):
    monkeypatch.setenv("PIAZZI_JIT", "0")
    problem = spacecraft(prior_time=-20.0)
    tracking = passes(problem, 10)
    ekf, root, ukf = (
        e.estimate(problem, tracking)
        for e in (pz.ExtendedKalmanFilter(), pz.SquareRootKalmanFilter(), pz.UnscentedKalmanFilter())
    )
    assert_same_estimate(root, ekf, 1e-6)
    assert ukf.success, ukf.message
    error = (ukf.mean[-1] - [*tracking.truth[-1][:4], 130.0]) / sigma(ukf)[-1]
    assert np.abs(error).max() < 4


# ---- the founding problems -------------------------------------------------------------------------------------------


def satellite_run(tracking, problem, numbers):
    step, R = textbook.taylor(MU_EARTH, 15), problem.stations[0].noise
    Q = np.diag([0.01, 0.01, 0.0025, 0.0025])
    return unscented.unscented_kalman_filter(
        problem.mean,
        problem.covariance,
        tracking.times,
        [[textbook.bearing(z, R)] for z in tracking.values],
        lambda x, t, dt: step(x, t, dt)[0],
        lambda t, dt: Q * dt,
        *numbers,
    )


@pytest.mark.parametrize("numbers", [(1e-3, 2.0, 0.0), (0.5, 2.0, 0.0), (1.0, 0.0, 1.0)])
def test_satellite_from_bearings(numbers):
    problem = satellite()
    tracking = pz.simulate(problem, np.arange(200) * 15.0, np.random.default_rng(5))
    estimate = pz.UnscentedKalmanFilter(*numbers).estimate(problem, tracking)
    run = satellite_run(tracking, problem, numbers)
    assert estimate.success, estimate.message
    assert_same_estimate(estimate, run, max(1e-6, 1e-11 / numbers[0] ** 2))  # second differences magnify rounding so much
    S = np.array(run.innovation_covariances)
    assert_allclose(estimate.innovation_covariances, S, rtol=1e-6)
    assert_allclose(estimate.innovations / np.sqrt(S[:, :, 0]), np.array(run.innovations) / np.sqrt(S[:, :, 0]), atol=1e-6)


@pytest.mark.parametrize("q", [0.01, 0.0], ids=["singular Q", "zero Q"])
def test_b612_from_ranges(q, monkeypatch):
    monkeypatch.setenv("PIAZZI_JIT", "0")
    problem = b612((0.0, 0.0, q, q))
    tracking = pz.simulate(problem, np.arange(100) * 0.1, np.random.default_rng(0))
    step, R = textbook.runge_kutta(lambda t, x: textbook.gravity(x, 1000.0), 10), problem.stations[0].noise
    run = unscented.unscented_kalman_filter(
        problem.mean,
        problem.covariance,
        tracking.times,
        [[textbook.range_from([10.0, 0.0], z, R)] for z in tracking.values],
        lambda x, t, dt: step(x, t, dt)[0],
        lambda t, dt: np.diag([0.0, 0.0, q, q]),
        alpha=0.5,
    )
    estimate = pz.UnscentedKalmanFilter(alpha=0.5).estimate(problem, tracking)
    assert estimate.success, estimate.message
    assert_same_estimate(estimate, run, 1e-6)


@pytest.fixture(scope="module")
def bearings(data_dir):
    return pz.load(data_dir / "satellite" / "slide_example.npz")


@EACH
def test_semidefinite_through_the_branch_cut(bearings, estimator):
    problem, tracking = bearings
    assert (np.abs(np.diff(tracking.values[:, 0])) > np.pi).any()
    estimate = estimator.estimate(problem, tracking)
    assert estimate.success, estimate.message
    assert (estimate.covariance == estimate.covariance.transpose(0, 2, 1)).all()
    unit = sigma(estimate)
    correlation = estimate.covariance / (unit[:, :, None] * unit[:, None, :])
    assert np.linalg.eigvalsh(correlation).min() > -1e-14
    assert np.abs(estimate.innovations).max() < np.pi / 4
    turned = pz.Tracking(tracking.times, tracking.values + TURN)
    assert_same_estimate(estimator.estimate(problem, turned), estimate, 1e-8)


def test_the_founding_recording(bearings):
    """The square-root form's errors are the filter's; the unscented filter's are no larger in the last half."""
    problem, tracking = bearings
    ekf = pz.ExtendedKalmanFilter().estimate(problem, tracking)
    assert_same_estimate(pz.SquareRootKalmanFilter().estimate(problem, tracking), ekf, 1e-9)
    names = {"ekf": pz.ExtendedKalmanFilter(), "ukf": pz.UnscentedKalmanFilter()}
    one, other = pz.compare(problem, tracking, names).rows
    assert other.rmse_last_half["position"] <= one.rmse_last_half["position"] * 1.02


# ---- what the points are for -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("alpha", [1e-3, 0.1, 1.0])
@pytest.mark.usefixtures("uncompiled")
def test_moments_of_a_square_are_exact(monkeypatch, alpha):
    """x^2 of a Gaussian has mean m^2 + P and variance 2 P^2 + 4 m^2 P: with beta = 2 and one state, whatever alpha."""
    monkeypatch.setenv("PIAZZI_JIT", "0")
    model = pz.Model(["x"], ["x**2"], [pz.Sensor("square", ["x**2"])], discrete=True)
    m, P, R = 1.5, 0.49, 0.01
    problem = pz.Problem(model, pz.Gaussian(m, P), None, pz.Station("s", "square", R))
    estimate = pz.UnscentedKalmanFilter(alpha).estimate(problem, pz.Tracking([0.0, 1.0], [np.nan, 3.0]))
    assert_allclose(estimate.mean[0], m)
    first = pz.UnscentedKalmanFilter(alpha).estimate(problem, pz.Tracking([0.0], [3.0]))
    assert_allclose(first.innovations[0], 3.0 - (m**2 + P), rtol=1e-9)
    assert_allclose(first.innovation_covariances[0], 2 * P**2 + 4 * m**2 * P + R, rtol=1e-9)
    live = pz.UnscentedKalmanFilter(alpha).start(problem)
    live.predict(0.0)
    live.update("s", np.nan)
    live.predict(1.0)
    assert_allclose(live.mean, m**2 + P, rtol=1e-9)
    assert_allclose(live.covariance, 2 * P**2 + 4 * m**2 * P, rtol=1e-9)


def test_a_point_without_a_prediction_is_no_missing_measurement(monkeypatch):
    monkeypatch.setenv("PIAZZI_JIT", "0")
    model = pz.Model(["x"], ["-1"], [pz.Sensor("depth", ["log(x)"])])
    problem = pz.Problem(model, pz.Gaussian(1.0, 1e-6), None, pz.Station("buoy", "depth", 1e6), integrator=pz.RungeKutta4(1))
    tracking = pz.Tracking([0.0, 0.5, 2.0, 3.0], [0.0, 0.0, 0.0, np.nan])
    for estimator in FILTERS.values():
        estimate = estimator.estimate(problem, tracking)
        assert not estimate.success
        assert estimate.message == "the estimate is not finite from epoch 2 (t = 2 s) (x)"


# ---- settings --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"alpha": 0.0}, "alpha is 0.0; it must be positive"),
        ({"alpha": np.nan}, "alpha is nan"),
        ({"beta": -1.0}, "beta is -1.0; it must be zero or more"),
        ({"kappa": np.inf}, "kappa is inf"),
        ({"gate": 1.5}, "gate is 1.5; it must be a probability"),
    ],
)
def test_settings_that_mean_nothing_are_refused(settings, message):
    with pytest.raises(ValueError, match=message):
        pz.UnscentedKalmanFilter(**settings)


def test_weights_that_do_not_fit_the_problem_are_refused():
    problem = b612()
    for estimator, message in [
        (pz.UnscentedKalmanFilter(kappa=-4.0), "kappa is -4; with 4 values it must be more than -4"),
        (pz.UnscentedKalmanFilter(1.0, 0.0, -1.0), "beta must be at least 0.25"),
    ]:
        for call in (lambda e=estimator: e.estimate(problem, pz.Tracking([0.0], [1.0])), lambda e=estimator: e.start(problem)):
            with pytest.raises(ValueError, match=message):
                call()


@EACH
def test_gate_takes_no_outlier(estimator, monkeypatch):
    """What it rejects is as if it had been missing."""
    from dataclasses import replace

    monkeypatch.setenv("PIAZZI_JIT", "0")
    problem = network(np.random.default_rng(0))
    tracking = pz.simulate(problem, np.arange(1, 13) * 0.2, np.random.default_rng(1))
    values = tracking.values.copy()
    bad = np.array([9, 22, 23, 40])
    values[bad, 0] += 0.5
    spoilt = pz.Tracking(tracking.row_times, values, tracking.row_stations)
    gated = replace(estimator, gate=0.9999).estimate(problem, spoilt)
    assert gated.details["rejected"][bad].all()
    assert gated.details["rejected_count"] == gated.details["rejected"].sum() < 8
    values[gated.details["rejected"]] = np.nan
    without = estimator.estimate(problem, pz.Tracking(tracking.row_times, values, tracking.row_stations))
    assert_same_estimate(gated, without, 1e-12)


@EACH
def test_lanes_and_compiler_change_nothing(estimator, monkeypatch):
    """Points carried several at a time by compiled code, and one after the other on NumPy arrays."""
    problem = satellite()
    tracking = pz.simulate(problem, np.arange(60) * 15.0, np.random.default_rng(1))
    compiled = estimator.estimate(problem, tracking)
    monkeypatch.setenv("PIAZZI_JIT", "0")
    assert_same_estimate(estimator.estimate(problem, tracking), compiled, 1e-9)
