"""`piazzi estimate --predict`: how far ahead, and what comes back."""

import numpy as np
import pytest

import piazzi as pz
from piazzi.cli.ahead import times_ahead

SCENARIO = "b612-range"


@pytest.mark.parametrize(
    ("text", "times"),
    [
        ("5", [105.0]),
        ("2h", [7300.0]),
        ("10min, 1 h", [700.0, 3700.0]),
        ("1d/6h", [21700.0, 43300.0, 64900.0, 86500.0]),
        ("1day", [86500.0]),
        ("90/40", [140.0, 180.0]),
        ("@250", [250.0]),
        ("@1h/30min", [1900.0]),
        ("1e3,@1100,500ms", [100.5, 1100.0]),
        ("0", [100.0]),
    ],
)
def test_lengths_of_time(text, times):
    assert times_ahead(text, 100.0).tolist() == pytest.approx(times)


def test_json_has_the_prediction(call):
    estimate = pz.ExtendedKalmanFilter().estimate(*pz.load(SCENARIO))
    wanted = estimate.predict([10.4, 10.9])
    (row,) = call("estimate", SCENARIO, "--predict", "500ms,1", "--json").document["rows"]
    found = row["prediction"]
    assert found["times"] == pytest.approx([10.4, 10.9])
    for name in ("mean", "sigma", "growth", "covariance"):
        np.testing.assert_allclose(found[name], getattr(wanted, name), rtol=1e-9)
    assert "prediction" not in call("estimate", SCENARIO, "--json").document["rows"][0]


def test_people_get_a_table_for_every_estimator(call):
    result = call("estimate", SCENARIO, "--with", "ekf", "--with", "window:10", "--predict", "1/500ms")
    assert result.status == 0
    assert result.out.count("Predicted from t = 9.9 s") == 2
    assert "growth" in result.out
    assert "500 ms" in result.out


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("x", "'x' is no length of time: write such as 10min"),
        ("", "'' is no length of time"),
        ("1,,2", "'' is no length of time"),
        ("nan", "'nan' is no length of time"),
        ("1e999", "'1e999' is no length of time"),
        ("2 hours", "unknown unit 'hours'"),
        ("-5", "'-5' lies before the last epoch"),
        ("1d/0", "the step '0' must be a length of time above zero"),
        ("1d/@3", "the step '@3' must be a length of time above zero"),
        ("1d/1us", "at most 100000 are shown"),
        ("1/2", "makes no times"),
        ("@3", "time 0 is 3 s, before the last epoch at 9.9 s"),
        ("1e12", "of the tracking's intervals ahead"),
    ],
)
def test_what_means_no_time_is_refused(call, text, message):
    assert message in call("estimate", SCENARIO, "--predict", text).refused()


def test_it_does_not_go_with_a_stream(call):
    assert (
        "--predict and --follow do not go together" in call("estimate", SCENARIO, "--follow", "-", "--predict", "1").refused()
    )


def test_a_prediction_that_cannot_be_used_is_told(call, tmp_path):
    """The state reaches infinity in half a second: status 3, as for an estimate that does."""
    (tmp_path / "cube.toml").write_text(CUBE)
    (tmp_path / "one.csv").write_text("time,range\n0,1\n")
    command = ("estimate", tmp_path / "one.csv", "--scenario", tmp_path / "cube.toml", "--predict")
    assert call(*command, "100ms").status == 0
    done = call(*command, "3")
    assert done.status == 3
    assert done.said == ["piazzi: ekf: the prediction is not finite at t = 3 s (x)"]
    document = call(*command, "3", "--json").document
    assert document["rows"][0]["prediction"]["success"] is False
    assert "not finite" in document["rows"][0]["prediction"]["message"]


CUBE = """
states = { x = "m" }
dynamics = { x = "x**3" }
sensors.r.components = { range = "x" }
stations = [{ name = "s", sensor = "r", noise = { sigma = 1 } }]
prior = { mean = [1], sigma = [1] }
times = { step = 0.01, count = 5 }
"""
