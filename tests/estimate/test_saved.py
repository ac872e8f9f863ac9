"""Checkpoints that somebody has been at: every array is refused by its name, with what is wrong about it."""

import re

import numpy as np
import pytest
from numpy.testing import assert_array_equal

import piazzi as pz

ESTIMATORS = {
    "ekf": pz.ExtendedKalmanFilter(),
    "gate": pz.ExtendedKalmanFilter(gate=0.999),
    "ukf": pz.UnscentedKalmanFilter(),
    "srekf": pz.SquareRootKalmanFilter(),
    "window": pz.SlidingWindow(lag=4),
    "loss": pz.SlidingWindow(lag=4, loss="huber"),
}
MISSING = {
    "pending",
    "epoch_values",
    "z",
    "nu_lin",
    "innovation",
    "innovation_covariance",
    "clock",
}  # where NaN means something
COVARIANCES = {"base_covariance", "P_pred", "P", "covariance", "oldest_covariance"}
WHOLE = {"epoch_stations", "station", "count", "first_row"}
UNUSED = {"refused"}


@pytest.fixture(autouse=True)
def plain(monkeypatch):
    monkeypatch.setenv("PIAZZI_JIT", "0")


def two_radars():
    model = pz.Model(["x", "v"], ["v", "-x"], [pz.Sensor("range", ["sqrt((x - a)**2 + 1)", "v + 0*a"])])
    stations = [pz.Station(name, "range", [0.01, 0.04], {"a": a}) for name, a in (("east", 3), ("west", -3))]
    return pz.Problem(model, pz.Gaussian([1, 0], np.eye(2)), pz.ProcessNoise([0, 0.01]), stations)


def rows_of(problem):
    """Measurements of both stations, every third value missing."""
    tracking = pz.simulate(problem, np.cumsum(np.random.default_rng(3).uniform(0.1, 0.4, 8)), np.random.default_rng(4))
    values = tracking.values.copy()
    values.reshape(-1)[::3] = np.nan
    return [(float(t), str(s), z) for t, s, z in zip(tracking.row_times, tracking.row_stations, values, strict=True)]


def at_work(estimator, problem, rows=11):
    session = estimator.start(problem)
    for t, station, z in rows_of(problem)[:rows]:
        session.update(station, z, t)
    return session


def refused(estimator, saved, name):
    """What a new session says of a checkpoint; it is left as it was."""
    session = estimator.start(two_radars())
    mean, covariance, time = session.mean.copy(), session.covariance.copy(), session.time
    with pytest.raises(ValueError, match=re.escape(f"the checkpoint's {name!r}")) as caught:
        session.restore(saved)
    assert_array_equal(session.mean, mean)
    assert_array_equal(session.covariance, covariance)
    assert session.time == time
    assert "\n" not in str(caught.value)
    return str(caught.value)


@pytest.mark.parametrize("name", ESTIMATORS)
def test_every_array_is_checked(name):
    estimator = ESTIMATORS[name]
    sound = at_work(estimator, two_radars()).checkpoint()
    assert sound.keys() - UNUSED == set(estimator.start(two_radars()).saved_names)
    for key in sound.keys() - UNUSED:
        array = np.asarray(sound[key], dtype=float)

        def changed(value, array=array, key=key):
            out = array.copy()
            out.flat[-1] = value
            return sound | {key: out}

        assert "inf" in refused(estimator, changed(np.inf), key)
        if key not in MISSING:
            assert "nan" in refused(estimator, changed(np.nan), key)
        other = array[..., None]
        assert re.search("shape|one number", refused(estimator, sound | {key: other}, key))
        assert re.search("shape|one number", refused(estimator, sound | {key: np.float64(3.0)}, key))
        assert "real numbers" in refused(estimator, sound | {key: array.astype(complex)}, key)
        if key in WHOLE:
            for value in (0.5, -1.0, 1e6):
                assert f"is {value:g} at" in refused(estimator, changed(value), key)


@pytest.mark.parametrize("name", ESTIMATORS)
def test_covariances_have_to_be_some(name):
    estimator = ESTIMATORS[name]
    sound = at_work(estimator, two_radars()).checkpoint()
    there = COVARIANCES & sound.keys()
    assert there
    for key in there:
        for wrong, words in (
            ([[1.0, 0.5], [0.25, 1.0]], r"not symmetric: \(x, v\) is 0.5 and \(v, x\) is 0.25"),
            ([[1.0, 0.0], [0.0, -2.0]], "not positive semidefinite: the variance of 'v' is -2"),
            ([[1.0, 1.5], [1.5, 1.0]], "not positive semidefinite: the smallest eigenvalue of its correlations is -0.5"),
            ([[0.0, 0.1], [0.1, 1.0]], "not positive semidefinite: the smallest eigenvalue of its correlations is -"),
        ):
            assert re.search(words, refused(estimator, sound | {key: np.array(wrong)}, key)), words


def test_times_rows_and_steps_of_a_window_belong_together():
    estimator = ESTIMATORS["window"]
    sound = at_work(estimator, two_radars()).checkpoint()
    for key, value, words in (
        ("t", sound["t"][::-1], "times must rise"),
        ("first_row", sound["first_row"][[0, 2, 1, 3, 4]], "must not fall"),
        ("first_row", sound["first_row"] + [0, 0, 0, 0, -1], "must go from 0 to 7"),
        ("count", sound["count"] + 1, "is 11 at 1; this problem has 10 there"),
        ("scale", sound["scale"] * 2, "this problem has"),
    ):
        assert words in refused(estimator, sound | {key: value}, key)


@pytest.mark.parametrize("name", [n for n in ESTIMATORS if n not in ("window", "loss")])
def test_clocks_go_forward(name):
    estimator = ESTIMATORS[name]
    sound = at_work(estimator, two_radars()).checkpoint()
    clock = sound["clock"].copy()
    clock[:2] = 7.0, 5.0
    assert "has an epoch at 5 s after one at 7 s" in refused(estimator, sound | {"clock": clock}, "clock")


@pytest.mark.parametrize("rows", [0, 1, 2, 11])
@pytest.mark.parametrize("name", ESTIMATORS)
def test_what_a_session_wrote_is_taken_back_to_the_same_bits(name, rows):
    """From before the first row on, with values that are missing."""
    problem, estimator = two_radars(), ESTIMATORS[name]
    one, other = at_work(estimator, problem, rows), estimator.start(problem)
    other.restore(one.checkpoint())
    for t, station, z in rows_of(problem)[rows:]:
        one.update(station, z, t)
        other.update(station, z, t)
        assert_array_equal(other.mean, one.mean)
        assert_array_equal(other.covariance, one.covariance)
    for key, array in one.checkpoint().items():
        assert_array_equal(array, other.checkpoint()[key])


def test_a_certain_value_and_a_late_row_are_no_damage():
    """Variances of zero, and epochs between others."""
    problem = two_radars()
    certain = pz.Problem(problem.model, pz.Gaussian([1, 0], np.diag([1.0, 0.0])), None, problem.stations)
    for estimator in ESTIMATORS.values():
        session = at_work(estimator, certain, 4)
        estimator.start(certain).restore(session.checkpoint())
    window = ESTIMATORS["window"]
    session = at_work(window, problem)
    assert session.update("west", [3.0, 0.0], float(session.times[1]) + 0.01)
    window.start(problem).restore(session.checkpoint())
