"""One measurement at a time: the numbers of the whole run, checkpoints, late and refused measurements."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import piazzi as pz


@pytest.fixture(scope="module")
def bearings(data_dir):
    return pz.load(data_dir / "satellite" / "slide_example.npz")


@pytest.mark.parametrize(
    "estimator",
    [pz.ExtendedKalmanFilter(), pz.UnscentedKalmanFilter(), pz.SquareRootKalmanFilter()],
    ids=lambda e: type(e).__name__,
)
def test_the_filter_gives_the_whole_run_bit_for_bit(bearings, estimator):
    problem, tracking = bearings
    whole = estimator.estimate(problem, tracking)
    live = estimator.start(problem)
    for k, t in enumerate(tracking.times):
        live.predict(t)
        live.update(problem.stations[0].name, tracking.values[k, 0])
        assert_array_equal(live.mean, whole.mean[k])
        assert_array_equal(live.covariance, whole.covariance[k])
        assert_array_equal(live.innovation, whole.innovations[k])
    assert live.time == tracking.times[-1]


@pytest.mark.parametrize(
    "estimator",
    [
        pz.ExtendedKalmanFilter(),
        pz.ExtendedKalmanFilter("joint"),
        pz.ExtendedKalmanFilter("components"),
        pz.ExtendedKalmanFilter(iterations=3),
        pz.ExtendedKalmanFilter(gate=0.99),
    ],
    ids=str,
)
def test_the_filter_gives_the_bits_of_the_whole_run_for_stations_of_different_sensors_too(estimator):
    """With two stations at every epoch, an estimated constant, integrated noise, and a prior before the first epoch."""
    problem, _ = pz.load("template")
    tracking = pz.simulate(problem, np.cumsum(np.random.default_rng(8).uniform(0.05, 0.4, 60)), np.random.default_rng(9))
    whole, live = estimator.estimate(problem, tracking), estimator.start(problem)
    assert whole.success, whole.message
    for k, t in enumerate(tracking.times):
        for row in range(tracking.first_row[k], tracking.first_row[k + 1]):
            name = str(tracking.row_stations[row])
            width = len(problem.stations[problem.station_index(name)].noise)
            live.update(name, tracking.values[row, :width], t)
        assert_array_equal(live.mean, whole.mean[k])
        assert_array_equal(live.covariance, whole.covariance[k])


@pytest.mark.parametrize(("lag", "iterations"), [(1, 1), (10, 1), (5, 3), (100, 1)])
def test_the_window_gives_the_whole_run_bit_for_bit(bearings, lag, iterations):
    problem, tracking = bearings
    estimator = pz.SlidingWindow(lag=lag, iterations=iterations)
    whole = estimator.estimate(problem, tracking)
    live = estimator.start(problem)
    with pytest.raises(ValueError, match="no state in the window yet"):
        _ = live.oldest
    for k, t in enumerate(tracking.times[:200]):
        assert live.update(problem.stations[0].name, tracking.values[k], t)
        assert_array_equal(live.mean, whole.mean[k])
        assert_array_equal(live.covariance, whole.covariance[k])
        if k >= lag - 1:  # it leaves at the next epoch
            assert live.times[0] == tracking.times[k - lag + 1]
            assert_array_equal(live.oldest.mean, whole.delayed.mean[k - lag + 1])
            assert_array_equal(live.oldest.covariance, whole.delayed.covariance[k - lag + 1])
    assert len(live.times) == lag
    again = estimator.start(problem)
    again.restore(live.checkpoint())
    assert_array_equal(again.oldest.covariance, live.oldest.covariance)


@pytest.fixture
def two_radars():
    model = pz.Model(["x", "v"], ["v", "-x"], [pz.Sensor("range", ["sqrt((x - a)**2 + 1)"])])
    stations = [pz.Station("east", "range", 0.01, {"a": 3}), pz.Station("west", "range", 0.04, {"a": -3})]
    problem = pz.Problem(model, pz.Gaussian([1, 0], np.eye(2)), pz.ProcessNoise([0, 0.01]), stations)
    return problem, pz.simulate(problem, np.cumsum(np.random.default_rng(3).uniform(0.1, 0.4, 30)), np.random.default_rng(4))


@pytest.mark.parametrize(
    "estimator",
    [pz.ExtendedKalmanFilter(), pz.SlidingWindow(lag=6), pz.UnscentedKalmanFilter(), pz.SquareRootKalmanFilter(gate=0.99)],
)
def test_several_stations_of_one_epoch_are_one_epoch(two_radars, estimator, monkeypatch):
    monkeypatch.setenv("PIAZZI_JIT", "0")
    problem, tracking = two_radars
    whole = estimator.estimate(problem, tracking)
    live = estimator.start(problem)
    for t, name, z in zip(tracking.row_times, tracking.row_stations, tracking.values, strict=True):
        live.update(str(name), z, t)
    assert_allclose(live.mean, whole.mean[-1], rtol=0, atol=1e-13)
    assert_allclose(live.covariance, whole.covariance[-1], rtol=0, atol=1e-13)


@pytest.mark.parametrize(
    "estimator",
    [pz.ExtendedKalmanFilter(), pz.SlidingWindow(lag=6, iterations=2), pz.UnscentedKalmanFilter(), pz.SquareRootKalmanFilter()],
)
def test_a_checkpoint_resumes_to_the_same_bits(two_radars, estimator, monkeypatch):
    monkeypatch.setenv("PIAZZI_JIT", "0")
    problem, tracking = two_radars
    rows = list(zip(tracking.row_times, tracking.row_stations, tracking.values, strict=True))
    one = estimator.start(problem)
    for t, name, z in rows[:31]:  # in the middle of an epoch
        one.update(str(name), z, t)
    other = estimator.start(problem)
    other.restore(one.checkpoint())
    for t, name, z in rows[31:]:
        one.update(str(name), z, t)
        other.update(str(name), z, t)
    assert_array_equal(one.mean, other.mean)
    assert_array_equal(one.covariance, other.covariance)


def test_a_checkpoint_of_another_problem_is_refused(two_radars, bearings, monkeypatch):
    monkeypatch.setenv("PIAZZI_JIT", "0")
    saved = pz.ExtendedKalmanFilter().start(two_radars[0]).checkpoint()
    with pytest.raises(ValueError, match="has shape"):
        pz.ExtendedKalmanFilter().start(bearings[0]).restore(saved)
    with pytest.raises(ValueError, match="has shape"):
        root = pz.UnscentedKalmanFilter().start(two_radars[0]).checkpoint()
        pz.UnscentedKalmanFilter().start(bearings[0]).restore(root)
    with pytest.raises(ValueError, match="the checkpoint has no"):
        pz.SlidingWindow().start(two_radars[0]).restore(saved)


def test_a_late_measurement_is_taken_in_its_place_on_a_linear_problem(monkeypatch):
    """On a linear problem the order of arrival cannot matter while everything is inside the window."""
    monkeypatch.setenv("PIAZZI_JIT", "0")
    model = pz.Model(["x", "v"], ["v", "0"], [pz.Sensor("position", ["x"])])
    problem = pz.Problem(model, pz.Gaussian([0, 1], np.eye(2)), pz.ProcessNoise([0, 0.1]), [pz.Station("a", "position", 0.1)])
    tracking = pz.simulate(problem, np.arange(1.0, 11.0), np.random.default_rng(0))
    rows = list(zip(tracking.row_times, tracking.values[:, 0], strict=True))
    in_order, late = pz.SlidingWindow(lag=20).start(problem), pz.SlidingWindow(lag=20).start(problem)
    for t, z in rows:
        in_order.update("a", z, t)
    for t, z in [*rows[:4], *rows[6:], *rows[4:6]]:
        assert late.update("a", z, t)
    assert_allclose(late.mean, in_order.mean, atol=1e-12)
    assert_allclose(late.covariance, in_order.covariance, atol=1e-12)
    assert_array_equal(late.times, in_order.times)


@pytest.mark.parametrize("estimator", [pz.ExtendedKalmanFilter(), pz.SlidingWindow(lag=3), pz.UnscentedKalmanFilter()])
def test_a_prediction_is_part_of_a_checkpoint(two_radars, estimator, monkeypatch):
    """It goes on from where it stands, to a later time or to the measurement that was waited for."""
    monkeypatch.setenv("PIAZZI_JIT", "0")
    problem, tracking = two_radars
    one = estimator.start(problem)
    for t, name, z in list(zip(tracking.row_times, tracking.row_stations, tracking.values, strict=True))[:12]:
        one.update(str(name), z, t)
    one.predict(t + 1.0)
    other = estimator.start(problem)
    other.predict(t + 50.0)
    other.restore(one.checkpoint())
    assert_array_equal(other.mean, one.mean)
    for session in (one, other):
        session.predict(t + 2.0)
    assert_array_equal(other.mean, one.mean)
    assert_array_equal(other.covariance, one.covariance)
    for session in (one, other):
        session.update("west", 3.0)
    assert_array_equal(other.mean, one.mean)
    assert other.time == t + 2.0


@pytest.mark.parametrize("estimator", [pz.ExtendedKalmanFilter(), pz.SlidingWindow(lag=3)])
def test_times_that_no_interval_reaches_are_refused(two_radars, estimator, monkeypatch):
    monkeypatch.setenv("PIAZZI_JIT", "0")
    live = estimator.start(two_radars[0])
    live.update("east", 3.0, -1e308)
    mean = live.mean.copy()
    for what in (lambda: live.update("east", 3.0, 1e308), lambda: live.predict(np.float64(1e308))):
        with pytest.raises(ValueError, match=r"the time is at 1e\+308 s, too far after -1e\+308 s"):
            what()
    with pytest.raises(ValueError, match="must be finite"):
        live.predict(np.inf)
    assert_array_equal(live.mean, mean)


@pytest.mark.parametrize("loss", [None, "huber"])
@pytest.mark.parametrize("lag", [3, 20])
def test_late_rows_are_taken_in_their_places_while_states_leave(lag, loss, monkeypatch):
    """A linear problem, rows of two stations shuffled within the lag, behind the first; a loss that no residual reaches."""
    monkeypatch.setenv("PIAZZI_JIT", "0")
    model = pz.Model(["x", "v"], ["v", "0"], [pz.Sensor("position", ["x"])])
    stations = [pz.Station("a", "position", 0.1), pz.Station("b", "position", 0.2)]
    problem = pz.Problem(model, pz.Gaussian([0, 1], np.eye(2)), pz.ProcessNoise([0, 0.1]), stations)
    rng = np.random.default_rng(0)
    tracking = pz.simulate(problem, np.cumsum(rng.uniform(0.1, 0.5, 60)), rng)
    rows = list(zip(tracking.row_times, tracking.row_stations.astype(str), tracking.values, strict=True))
    delay = np.where(np.arange(len(rows)), rng.uniform(0, 1.8 * (lag - 1), len(rows)), 0.0)
    shuffled = [rows[i] for i in np.argsort(np.arange(len(rows)) + delay)]
    in_order, late = (pz.SlidingWindow(lag, loss=loss and f"{loss}=1000").start(problem) for _ in range(2))
    for t, name, z in rows:
        in_order.update(name, z, t)
    for t, name, z in shuffled:
        assert late.update(name, z, t)
    assert shuffled != rows
    assert_array_equal(late.times, in_order.times)
    assert_allclose(late.means, in_order.means, rtol=0, atol=1e-10)
    assert_allclose(late.covariance, in_order.covariance, rtol=0, atol=1e-10)
    assert_allclose(late.oldest.covariance, in_order.oldest.covariance, rtol=0, atol=1e-10)


def test_a_measurement_older_than_the_window_is_refused_by_name(two_radars, monkeypatch):
    monkeypatch.setenv("PIAZZI_JIT", "0")
    problem, tracking = two_radars
    live = pz.SlidingWindow(lag=3).start(problem)
    for t, name, z in zip(tracking.row_times, tracking.row_stations, tracking.values, strict=True):
        live.update(str(name), z, t)
    before = live.mean.copy()
    assert live.update("west", [3.0], tracking.times[0]) is False
    assert live.refused == [(tracking.times[0], "west")]
    assert_array_equal(live.mean, before)


def test_what_cannot_be_taken_is_said(two_radars, monkeypatch):
    monkeypatch.setenv("PIAZZI_JIT", "0")
    problem, _ = two_radars
    for estimator in (pz.ExtendedKalmanFilter(), pz.SlidingWindow(), pz.UnscentedKalmanFilter(), pz.SquareRootKalmanFilter()):
        live = estimator.start(problem)
        with pytest.raises(ValueError, match="time"):
            live.update("east", 3.0)
        live.update("east", 3.0, 1.0)
        with pytest.raises(ValueError, match="unknown station 'eats'; did you mean 'east'"):
            live.update("eats", 3.0, 2.0)
        with pytest.raises(ValueError, match="must be 1 numbers"):
            live.update("east", [1.0, 2.0], 2.0)
        with pytest.raises(ValueError, match="write NaN"):
            live.update("east", np.inf, 2.0)
        with pytest.raises(ValueError, match="before 1 s"):
            live.predict(0.5)
        live.update("east", np.nan, 2.0)
        assert np.isfinite(live.mean).all()


FILTERS = {
    "ekf": pz.ExtendedKalmanFilter(),
    "ekf:gate": pz.ExtendedKalmanFilter(gate=0.99),
    "iekf": pz.ExtendedKalmanFilter(iterations=3),
    "srekf": pz.SquareRootKalmanFilter(),
    "ukf": pz.UnscentedKalmanFilter(),
}


@pytest.mark.parametrize("estimator", FILTERS.values(), ids=FILTERS)
def test_a_refused_time_leaves_the_epoch_open(two_radars, estimator, monkeypatch):
    """After a measurement that came too late, the next row of the epoch still belongs to it."""
    monkeypatch.setenv("PIAZZI_JIT", "0")
    problem, tracking = two_radars
    whole = estimator.estimate(problem, tracking)
    live = estimator.start(problem)
    for row, (t, name, z) in enumerate(zip(tracking.row_times, tracking.row_stations, tracking.values, strict=True)):
        if row % 2:
            before = {what: array.copy() for what, array in live.checkpoint().items()}
            with pytest.raises(ValueError, match="is before"):
                live.update(str(name), z, t - 0.01)
            with pytest.raises(ValueError, match="must be finite"):
                live.predict(np.nan)
            for what, array in live.checkpoint().items():
                assert_array_equal(array, before[what])
        live.update(str(name), z, t)
    assert_allclose(live.mean, whole.mean[-1], rtol=0, atol=1e-13)
    assert_allclose(live.covariance, whole.covariance[-1], rtol=0, atol=1e-13)


@pytest.mark.parametrize("estimator", FILTERS.values(), ids=FILTERS)
def test_a_row_counts_once_whatever_is_refused_between(estimator, monkeypatch):
    """Prior and two rows that say 0, 1 and 1 with variance 1 each: mean 2/3, variance 1/3."""
    monkeypatch.setenv("PIAZZI_JIT", "0")
    model = pz.Model(["x"], ["0"], [pz.Sensor("level", ["x"])])
    stations = [pz.Station(name, "level", 1.0) for name in ("a", "b")]
    live = estimator.start(pz.Problem(model, pz.Gaussian(0.0, 1.0), None, stations))
    live.update("a", 1.0, 5.0)
    with pytest.raises(ValueError, match="time 4 s is before 5 s"):
        live.update("a", 1.0, 4.0)
    live.update("b", 1.0, 5.0)
    assert_allclose(live.mean, [2 / 3], rtol=1e-12)
    assert_allclose(live.covariance, [[1 / 3]], rtol=1e-12)


def test_the_innovation_of_a_window_is_that_of_the_last_row_or_nan(two_radars, monkeypatch):
    monkeypatch.setenv("PIAZZI_JIT", "0")
    problem, tracking = two_radars
    estimator = pz.SlidingWindow(lag=6)
    whole, live = estimator.estimate(problem, tracking), estimator.start(problem)
    assert np.isnan(live.innovation).all()
    assert np.isnan(live.innovation_covariance).all()
    rows = zip(tracking.row_times, tracking.row_stations, tracking.values, strict=True)
    for row, (t, name, z) in enumerate(rows):
        live.update(str(name), z, t)
        assert_allclose(live.innovation, whole.innovations[row], rtol=0, atol=1e-13)
        assert_allclose(live.innovation_covariance, whole.innovation_covariances[row], rtol=0, atol=1e-13)
    again, old = estimator.start(problem), estimator.start(problem)
    again.restore(live.checkpoint())
    assert_array_equal(again.innovation, live.innovation)
    assert_array_equal(again.innovation_covariance, live.innovation_covariance)
    old.restore({what: array for what, array in live.checkpoint().items() if not what.startswith("innovation")})
    assert np.isnan(old.innovation).all()
    assert old.innovation_covariance.shape == live.innovation_covariance.shape
    assert live.update("west", 3.0, tracking.times[-1] - 0.05)
    assert np.isnan(live.innovation).all()
    assert np.isnan(live.innovation_covariance).all()
    again.update("west", 3.0, tracking.times[-1])
    assert np.isfinite(again.innovation).all()


@pytest.mark.parametrize(
    "estimator", [pz.ExtendedKalmanFilter(), pz.ExtendedKalmanFilter(gate=0.999), pz.UnscentedKalmanFilter()]
)
def test_a_measurement_before_any_prediction_is_at_the_time_of_the_prior(estimator, monkeypatch):
    monkeypatch.setenv("PIAZZI_JIT", "0")
    model = pz.Model(["x"], ["0"], [pz.Sensor("ramp", ["x + 0.1*t"])])
    problem = pz.Problem(model, pz.Gaussian(1.0, 1.0), None, [pz.Station("here", "ramp", 0.01)], prior_time=5.0)
    live = estimator.start(problem)
    live.update("here", 1.7)
    whole = estimator.estimate(problem, pz.Tracking([5.0], [1.7]))
    assert_allclose(live.mean, whole.mean[0], rtol=1e-12)
    assert_allclose(live.mean, [1.0 + 0.2 / 1.01], rtol=1e-9)
