"""Iterated updates and the innovation gate, against filters written here."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import piazzi as pz
from piazzi.evaluate import metrics
from piazzi.io.netcdf import read_estimate, write_estimate
from tests.laws.problems import b612, linear, random_covariance, random_stable
from tests.references import textbook


def two_radars(noise=(0.04, 0.01), **changes) -> pz.Problem:
    """A point moving in the plane, seen by two radars that measure range and bearing with correlated noise."""
    model = pz.Model(
        ["x", "y", "vx", "vy"],
        ["vx", "vy", "0", "0"],
        [pz.Sensor("radar", {"rho": "sqrt((x - a)**2 + (y - b)**2)", "beta": "atan2(y - b, x - a)"}, angles=["beta"])],
        groups={"position": ["x", "y"], "velocity": ["vx", "vy"]},
    )
    R = np.array([[noise[0], 0.3 * np.sqrt(noise[0] * noise[1])], [0.3 * np.sqrt(noise[0] * noise[1]), noise[1]]])
    stations = [pz.Station("east", "radar", R, {"a": 2.0, "b": 0.0}), pz.Station("west", "radar", 2 * R, {"a": -2.0, "b": 0.0})]
    numbers = {
        "prior": pz.Gaussian([0.5, 2.0, 0.1, 0.0], [1.0, 1.0, 0.1, 0.1]),
        "process_noise": pz.ProcessNoise([0.0, 0.0, 0.01, 0.01], "second", "scaled"),
    }
    return pz.Problem(model, stations=stations, **(numbers | changes))


def h_and_H(problem, rows, x):
    """Joint measurement of some rows, its Jacobian and noise, from hand-written derivatives."""
    h, H, R = [], [], []
    for station in rows:
        numbers = station.numbers
        dx, dy = x[0] - numbers["a"], x[1] - numbers["b"]
        r = np.hypot(dx, dy)
        h += [r, np.arctan2(dy, dx)]
        H += [[dx / r, dy / r, 0, 0], [-dy / r**2, dx / r**2, 0, 0]]
        R.append(station.noise)
    noise = np.zeros((2 * len(rows), 2 * len(rows)))
    for i, block in enumerate(R):
        noise[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] = block
    return np.array(h), np.array(H), noise


def wrapped(nu):
    out = nu.copy()
    out[1::2] = [textbook.wrap(v) for v in nu[1::2]]
    return out


def iterated_filter(problem, tracking, iterations):
    """The iterated extended Kalman filter as Bell and Cathey (1993) write it: Gauss-Newton on prediction and measurement."""
    x, P = problem.mean.copy(), problem.covariance.copy()
    F, Q = np.eye(4), problem.process_noise.covariance
    means, covariances = [], []
    before = tracking.times[0]
    for k, t in enumerate(tracking.times):
        F = np.eye(4) + (t - before) * np.eye(4, k=2)
        x, P = F @ x, F @ P @ F.T + Q * (t - before)
        before = t
        rows = slice(tracking.first_row[k], tracking.first_row[k + 1])
        stations = [problem.stations[problem.station_index(str(s))] for s in tracking.row_stations[rows]]
        z = tracking.values[rows].reshape(-1)
        xi = x
        for _ in range(iterations):
            h, H, R = h_and_H(problem, stations, xi)
            K = P @ H.T @ np.linalg.inv(H @ P @ H.T + R)
            xi = x + K @ (wrapped(z - h) - H @ (x - xi))
        x, P = xi, (np.eye(4) - K @ H) @ P
        means.append(x)
        covariances.append(P)
    return np.array(means), np.array(covariances)


@pytest.mark.parametrize("iterations", [1, 2, 5])
@pytest.mark.parametrize("update", ["joint", "components"])
@pytest.mark.usefixtures("uncompiled")
def test_iterated_update_is_the_hand_written_one(iterations, update):
    problem = two_radars()
    tracking = pz.simulate(problem, np.cumsum([0.0, 0.5, 1.5, 0.2, 1.0, 1.0, 2.0]), np.random.default_rng(5))
    estimate = pz.ExtendedKalmanFilter(update, iterations=iterations, gate=1 - 1e-15).estimate(problem, tracking)
    mean, covariance = iterated_filter(problem, tracking, iterations)
    assert_allclose(estimate.mean, mean, rtol=0, atol=1e-11)
    assert_allclose(estimate.covariance, covariance, rtol=0, atol=1e-12)
    assert estimate.iterations == 7 * iterations


def iterated_b612(problem, tracking, iterations):
    """The same by hand for ranges of a probe about a planet: x_i+1 = x + K (z - h(x_i) - H (x - x_i)), 10 RK4 substeps."""
    step = textbook.runge_kutta(lambda t, x: textbook.gravity(x, problem.parameters["mu"]), 10)
    x, P, R = problem.mean, problem.covariance, problem.stations[0].noise
    means = [x]
    for k, z in enumerate(tracking.values):
        if k:
            x, Phi = step(x, tracking.times[k - 1], tracking.times[k] - tracking.times[k - 1])
            P = Phi @ P @ Phi.T + problem.process_noise.covariance
        row, xi = textbook.range_from(np.array([10.0, 0.0]), z, R), x
        for _ in range(iterations):
            H = row.H(xi)
            K = P @ H.T / (H @ P @ H.T + R)
            xi = x + K @ (z - row.h(xi) - H @ (x - xi))
        A = np.eye(4) - K @ H
        x, P = xi, A @ P @ A.T + K @ R @ K.T
        means.append(x)
    return np.array(means[1:])


@pytest.mark.slow
def test_iterating_on_ranges_alone_is_worse_by_its_nature():
    """120 recordings: the independent filter agrees, and is no better than the plain one.

    A range pins the state to a ring, and the probe is closer to the radar than its prediction is sure.  The mode of each epoch
    is then a sharp guess about what nobody saw: more iterations, more of that.
    """
    problem, rms = b612(), {1: [], 5: []}
    for seed in range(120):
        tracking = pz.simulate(problem, np.arange(100) * 0.1, np.random.default_rng(seed))
        for iterations, found in rms.items():
            estimate = pz.ExtendedKalmanFilter(iterations=iterations).estimate(problem, tracking)
            found.append(np.sqrt(np.mean(np.sum((estimate.mean - tracking.truth)[:, :2] ** 2, axis=1))))
        sigma = np.sqrt(np.diagonal(estimate.covariance, axis1=1, axis2=2))
        assert np.abs((estimate.mean - iterated_b612(problem, tracking, 5)) / sigma).max() < 1e-7
    assert np.median(rms[5]) > 1.2 * np.median(rms[1])


def test_iterating_pays_where_an_epoch_sees_all_that_it_is_nonlinear_in():
    """Range and bearing together, far sharper than the prediction: errors fall, and the covariance says so."""
    problem = two_radars((1e-4, 1e-4))
    errors, honesty = {1: [], 5: []}, {1: [], 5: []}
    for seed in range(15):
        tracking = pz.simulate(problem, np.arange(20.0), np.random.default_rng(seed))
        for iterations, found in errors.items():
            estimate = pz.ExtendedKalmanFilter(iterations=iterations).estimate(problem, tracking)
            found.append(np.mean((estimate.mean - tracking.truth)[:, :2] ** 2))
            honesty[iterations].append(metrics.nees(estimate).mean())
    assert np.mean(errors[5]) < 0.5 * np.mean(errors[1])
    assert np.mean(honesty[5]) == pytest.approx(4, abs=1)  # the number of states
    assert np.mean(honesty[1]) > 20


@pytest.mark.usefixtures("uncompiled")
def test_iterated_update_ends_where_the_cost_is_least():
    """The fixed point is the mode of the posterior: the gradient of prediction and measurement terms together is zero."""
    problem = two_radars()
    tracking = pz.simulate(problem, [0.0], np.random.default_rng(1))
    x = pz.ExtendedKalmanFilter(iterations=50).estimate(problem, tracking).mean[0]
    h, H, R = h_and_H(problem, problem.stations, x)
    nu = wrapped(tracking.values.reshape(-1) - h)
    gradient = np.linalg.solve(problem.covariance, x - problem.mean) - H.T @ np.linalg.solve(R, nu)
    assert_allclose(gradient, 0, atol=1e-9)


@pytest.mark.usefixtures("uncompiled")
def test_measurements_count_once_however_often_they_are_linearised():
    """On a linear problem every iteration gives the same, mean and covariance."""
    rng = np.random.default_rng(0)
    H = [rng.standard_normal((2, 3)), rng.standard_normal((1, 3))]
    R = [random_covariance(rng, 2), random_covariance(rng, 1)]
    prior = pz.Gaussian(np.zeros(3), random_covariance(rng, 3))
    problem = linear(random_stable(rng, 3), H, R, random_covariance(rng, 3), prior)
    tracking = pz.simulate(problem, np.arange(8.0), rng)
    once, often = (pz.ExtendedKalmanFilter(iterations=i).estimate(problem, tracking) for i in (1, 7))
    assert_allclose(often.mean, once.mean, rtol=0, atol=1e-12)
    assert_allclose(often.covariance, once.covariance, rtol=0, atol=1e-12)


def test_options_that_change_nothing_give_the_plain_filter_bit_for_bit():
    problem = b612()
    tracking = pz.simulate(problem, np.arange(100) * 0.1, np.random.default_rng(0))
    plain = pz.ExtendedKalmanFilter().estimate(problem, tracking)
    wide = pz.ExtendedKalmanFilter(gate=1 - 1e-16 * 2).estimate(problem, tracking)
    assert not wide.details["rejected"].any()
    assert_array_equal(wide.mean, plain.mean)
    assert_array_equal(wide.covariance, plain.covariance)
    assert_array_equal(wide.innovations, plain.innovations)


# ---- the gate --------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def outliers():
    """A simulated run in which 5 % of the rows are off by many sigma, and which rows these are."""
    problem = two_radars()
    rng = np.random.default_rng(11)
    tracking = pz.simulate(problem, np.arange(400) * 0.5, rng)
    bad = np.zeros(len(tracking.values), dtype=bool)
    bad[rng.choice(np.arange(20, len(bad)), size=len(bad) // 20, replace=False)] = True
    values = tracking.values.copy()
    values[bad, 0] += rng.choice([-1, 1], bad.sum()) * rng.uniform(5, 50, bad.sum())
    return problem, pz.Tracking(tracking.row_times, values, tracking.row_stations, tracking.truth), bad


def test_gate_rejects_outliers_and_reports_them(outliers):
    problem, tracking, bad = outliers
    estimate = pz.ExtendedKalmanFilter(gate=0.999).estimate(problem, tracking)
    rejected = estimate.details["rejected"]
    assert rejected.dtype == bool
    assert rejected[bad].all()
    assert rejected[~bad].mean() < 0.01  # a thousandth of the good ones is the price
    assert estimate.details["rejected_count"] == rejected.sum()
    assert not rejected.flags.writeable
    # what is left is consistent, and the estimate is as if the outliers had been missing
    assert 0.8 * 2 < metrics.nis(estimate).mean() < 1.2 * 2
    values = tracking.values.copy()
    values[rejected] = np.nan
    without = pz.ExtendedKalmanFilter().estimate(
        problem, pz.Tracking(tracking.row_times, values, tracking.row_stations, tracking.truth)
    )
    assert_allclose(estimate.mean, without.mean, rtol=0, atol=1e-12)
    assert_allclose(estimate.covariance, without.covariance, rtol=0, atol=1e-12)


def test_a_file_keeps_what_was_rejected(outliers, tmp_path):
    problem, tracking, _ = outliers
    estimate = pz.ExtendedKalmanFilter(gate=0.999).estimate(problem, tracking)
    write_estimate(tmp_path / "a.nc", estimate)
    again = read_estimate(tmp_path / "a.nc")
    assert again.details["rejected"].dtype == bool
    assert_array_equal(again.details["rejected"], estimate.details["rejected"])
    assert metrics.nis(again).mean() == metrics.nis(estimate).mean()


def test_without_gate_outliers_hurt(outliers):
    problem, tracking, _ = outliers
    error = [
        np.sqrt(np.mean((pz.ExtendedKalmanFilter(gate=g).estimate(problem, tracking).mean - tracking.truth)[:, :2] ** 2))
        for g in (None, 0.999)
    ]
    assert error[1] < 0.2 * error[0]
    assert "rejected" not in pz.ExtendedKalmanFilter().estimate(problem, tracking).details


@pytest.mark.usefixtures("uncompiled")
def test_gate_is_the_chi_square_quantile_of_the_components_that_are_there():
    """A row of one component is judged by one degree of freedom: 3.29 sigma at 0.999; a missing component is none."""
    problem = two_radars()
    h, H, R = h_and_H(problem, problem.stations[:1], problem.mean)
    sigma = np.sqrt((H @ problem.covariance @ H.T + R)[0, 0])
    for beyond, expected in ((0.99, False), (1.01, True)):
        row = [h[0] + beyond * 3.290526731491895 * sigma, np.nan]
        estimate = pz.ExtendedKalmanFilter(gate=0.999).estimate(problem, pz.Tracking([0.0], [row], ["east"]))
        assert estimate.details["rejected"].tolist() == [expected]


def test_share_of_good_measurements_that_the_gate_rejects():
    """On a matched linear problem, one minus the gate."""
    rng = np.random.default_rng(2)
    prior = pz.Gaussian(np.zeros(2), np.eye(2))
    problem = linear(random_stable(rng, 2), [np.eye(2)], [random_covariance(rng, 2)], 0.1 * np.eye(2), prior)
    tracking = pz.simulate(problem, np.arange(4000.0), rng)
    rejected = pz.ExtendedKalmanFilter(gate=0.95).estimate(problem, tracking).details["rejected"]
    assert abs(rejected.mean() - 0.05) < 4 * np.sqrt(0.05 * 0.95 / 4000)


@pytest.mark.parametrize("settings", [{"iterations": 3}, {"gate": 0.999}, {"iterations": 2, "gate": 0.999}])
def test_one_measurement_at_a_time_gives_the_whole_run(outliers, settings):
    problem, tracking, _ = outliers
    estimator = pz.ExtendedKalmanFilter(**settings)
    whole = estimator.estimate(problem, tracking)
    live, rejected = estimator.start(problem), []
    for k in range(60):
        for row in range(tracking.first_row[k], tracking.first_row[k + 1]):
            live.update(str(tracking.row_stations[row]), tracking.values[row], tracking.row_times[row])
            rejected.append(live.rejected)
        assert_allclose(live.mean, whole.mean[k], rtol=0, atol=1e-12)
        assert_allclose(live.covariance, whole.covariance[k], rtol=0, atol=1e-12)
    if "gate" in settings:
        assert rejected == whole.details["rejected"][: len(rejected)].tolist()


@pytest.mark.usefixtures("uncompiled")
def test_guarded_checkpoint_resumes_in_the_middle_of_an_epoch(outliers):
    problem, tracking, _ = outliers
    estimator = pz.ExtendedKalmanFilter(iterations=3, gate=0.999)
    one, other = estimator.start(problem), estimator.start(problem)
    rows = list(zip(tracking.row_stations, tracking.values, tracking.row_times, strict=True))
    for name, z, t in rows[:31]:
        one.update(str(name), z, t)
    saved = one.checkpoint()
    assert set(saved) == set(one.saved_names)
    other.restore(saved)
    for name, z, t in rows[31:60]:
        one.update(str(name), z, t)
        other.update(str(name), z, t)
    assert_array_equal(one.mean, other.mean)
    assert_array_equal(one.covariance, other.covariance)
    with pytest.raises(ValueError, match="checkpoint"):
        other.restore(saved | {"epoch_stations": np.array([7])})


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"iterations": 0}, "iterations is 0"),
        ({"iterations": 1.5}, "iterations is 1.5"),
        ({"gate": 1.0}, "gate is 1.0"),
        ({"gate": 0}, "gate is 0"),
        ({"gate": float("nan")}, "gate is nan"),
    ],
)
def test_bad_options_are_refused(settings, message):
    with pytest.raises(ValueError, match=message):
        pz.ExtendedKalmanFilter(**settings)


# ---- a gate that was wrong -------------------------------------------------------------------------------------------


def lost_walk(runs=400, jump=200, seed=5):
    """A constant that jumps by a thousand sigma, which the model does not know: from then on every good row is an outlier."""
    rng = np.random.default_rng(seed)
    prior = pz.Gaussian(np.zeros(1), np.eye(1))
    problem = linear(np.eye(1), [np.eye(1)], [np.eye(1)], 1e-2 * np.eye(1), prior)
    values = np.where(np.arange(runs) < jump, 0.0, 1000.0) + rng.standard_normal(runs)
    return problem, pz.Tracking(np.arange(float(runs)), values[:, None], [problem.stations[0].name] * runs)


@pytest.mark.usefixtures("uncompiled")
@pytest.mark.parametrize(
    "filter_",
    [pz.ExtendedKalmanFilter(gate=0.999), pz.SquareRootKalmanFilter(gate=0.999), pz.UnscentedKalmanFilter(gate=0.999)],
)
def test_five_rejected_in_a_row_open_the_gate_until_a_row_lies_within(filter_):
    """As written here with numbers: rejected while fewer than five before were, taken from then on, and shut by a good row."""
    problem, tracking = lost_walk()
    limit, m, P, streak, means, codes = 3.290526731491895**2, 0.0, 1.0, 0, [], []
    Q = float(np.ravel(problem.process_noise.covariance)[0])
    for k, z in enumerate(tracking.values[:, 0].tolist()):
        P = P + Q if k else P
        within = (z - m) ** 2 / (P + 1.0) <= limit
        streak = 0 if within else streak + 1
        codes.append(0 if within else 2 if streak > 5 else 1)
        if codes[-1] != 1:
            K = P / (P + 1.0)
            m, P = m + K * (z - m), (1.0 - K) * P
        means.append(m)
    found = filter_.estimate(problem, tracking)
    assert_allclose(found.mean[:, 0], means, rtol=1e-9, atol=1e-9)
    assert_array_equal(found.details["rejected"], np.array(codes) == 1)
    assert_array_equal(found.details["reopened"], np.array(codes) == 2)
    assert codes[200:206] == [1, 1, 1, 1, 1, 2] and abs(m - 1000.0) < 1.0 and codes[-20:].count(0) >= 19
    assert found.success and "five rows in a row were beyond the gate, which was opened at t = 205 s" in found.message


@pytest.mark.usefixtures("uncompiled")
@pytest.mark.parametrize("filter_", [pz.ExtendedKalmanFilter(gate=0.999), pz.SquareRootKalmanFilter(gate=0.999)])
def test_a_live_filter_opens_its_gate_where_the_run_does_and_goes_on_from_a_checkpoint(filter_):
    problem, tracking = lost_walk(230)
    whole = filter_.estimate(problem, tracking)
    live, told = filter_.start(problem), []
    for k, (t, z) in enumerate(zip(tracking.row_times, tracking.values, strict=True)):
        if k == 203:
            live, before = filter_.start(problem), live.checkpoint()
            live.restore(before)
        live.update(str(tracking.row_stations[k]), z, t)
        told.append((live.rejected, live.reopened))
    assert_allclose(live.mean, whole.mean[-1], rtol=0, atol=1e-12)
    assert_array_equal(np.array(told), np.column_stack([whole.details["rejected"], whole.details["reopened"]]))
