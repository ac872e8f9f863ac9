"""``piazzi windows`` and ``piazzi observability``."""

import csv
import json

import numpy as np
import pytest

import piazzi as pz
from piazzi import earth
from piazzi.cli.additions import additions

SCENARIO = "b612-range-q0"


def test_windows_prints_the_contract_and_nothing_else(call, tmp_path):
    found = call("windows", SCENARIO, "--lags", "5,1,20", "--no-graph", "--json", "-o", tmp_path / "w.json")
    assert (found.status, found.said) == (0, [])
    document = found.document
    assert (document["schema"], document["epochs"], document["lags"]) == ("piazzi.windows/1", 100, [1, 5, 20])
    assert [(r["lag"], r["view"]) for r in document["rows"]] == [(n, v) for n in (1, 5, 20) for v in ("realtime", "delayed")]
    assert all(r["position_rmse"] > 0 and r["microseconds_per_step"] > 0 for r in document["rows"])
    assert json.loads((tmp_path / "w.json").read_text()) == document


def test_windows_as_a_table_and_as_csv(call, tmp_path):
    found = call("windows", SCENARIO, "--lags", "1,20", "--iterations", 2, "-o", tmp_path / "w.csv")
    assert found.status == 0
    assert "Full graph, on the first epochs" in found.out
    assert found.out.splitlines()[-1] == f"Wrote {tmp_path / 'w.csv'}"
    rows = list(csv.DictReader((tmp_path / "w.csv").read_text().splitlines()))
    assert [row["estimator"] for row in rows] == ["window:1x2", "window:1x2", "window:20x2", "window:20x2"]


def test_windows_that_fail_are_told_by_the_status(call, monkeypatch):
    def broken(self, problem, tracking):
        raise RuntimeError("out of order")

    monkeypatch.setattr(pz.SlidingWindow, "estimate", broken)
    found = call("windows", SCENARIO, "--lags", "1", "--no-graph", "--json")
    assert found.status == 3
    assert [r["message"] for r in found.document["rows"]] == ["RuntimeError: out of order"] * 2


def test_observability_prints_the_contract_and_nothing_else(call, tmp_path):
    found = call("observability", SCENARIO, "--json", "-o", tmp_path / "o.csv")
    assert (found.status, found.said) == (0, [])
    document = found.document
    assert (document["schema"], document["source"]) == ("piazzi.observability/1", SCENARIO)
    assert document["states"] == ["x", "y", "vx", "vy"]
    assert document["condition"] == pytest.approx(document["singular_values"][0] / document["singular_values"][-1])
    (twin,) = document["twins"]
    assert np.allclose(twin["state"], [11, 0, 0, -10])
    assert "Verdict: linearisation" in document["verdict"]
    rows = list(csv.DictReader((tmp_path / "o.csv").read_text().splitlines()))
    assert len(rows) == 100
    assert rows[0]["y_crlb_sigma"] == ""  # nothing is known of it yet
    assert float(rows[-1]["y_crlb_sigma"]) == pytest.approx(document["crlb_sigma"][1])


def test_what_further_stations_change(call):
    more = ["--add", "radar", "--add", "range:mx=0,my=10,sigma=0.1", "--add", "eye=atan2(y - a, x):a=1,sigma=0.01,angle"]
    document = call("observability", SCENARIO, "--json", *more).document
    assert document["added"]["twins"] == []
    assert document["added"]["crlb_sigma"] < document["crlb_sigma"]
    text = call("observability", SCENARIO, "--add", "radar").out
    assert "With added radar too:" in text


def test_the_same_station_once_more_is_worth_half_the_variance(call):
    """Every row twice: singular values grow by the root of two, the twin stays."""
    document = call("observability", SCENARIO, "--json", "--add", "radar").document
    assert np.allclose(document["added"]["singular_values"], np.sqrt(2) * np.array(document["singular_values"]))
    assert len(document["added"]["twins"]) == 1


def test_additions_are_read():
    problem = pz.load(SCENARIO)[0]
    one, again, (sensor, two) = additions(problem, ("range:mx=-1,my=2,sigma=0.5", "radar", "s=x; y*q:sigma=1;2,q=3"))
    assert (one.name, one.sensor, one.noise.tolist(), dict(one.numbers)) == (
        "added range",
        "range",
        [0.25],
        {"mx": -1, "my": 2},
    )
    assert (again.name, again.sensor, dict(again.numbers)) == ("added radar", "range", {"mx": 10, "my": 0})
    assert (sensor.width, two.noise.tolist(), dict(two.numbers)) == (2, [1, 4], {"q": 3})
    assert [s.name for s in additions(problem, ("radar", "radar"))] == ["added radar", "added radar 2"]


ORBIT = """
epoch = "2024-01-01T00:00:00 UTC"
[earth]
degree = 4
[sensors.range]
kind = "range"
visible = ["above"]
numbers = { mask = "10 deg" }
[[stations]]
name = "S"
sensor = "range"
site = { latitude = 35.0, longitude = 20.0, height = 100.0 }
noise = { sigma = 1.0 }
[prior]
a = "7078 km"
e = 0.001
i = "98.2 deg"
raan = "110 deg"
argp = "90 deg"
nu = "10 deg"
sigma = [100.0, 300.0, 100.0, 0.3, 0.1, 0.1]
axes = "RTN"
[times]
start = 0.0
step = 60.0
count = 900
"""


@pytest.fixture
def orbit(tmp_path):
    path = tmp_path / "orbit.toml"
    path.write_text(ORBIT)
    return path


def test_additions_on_the_earth_are_read(orbit):
    problem = pz.scenarios.load_scenario(orbit).problem
    texts = "S", "range:site=7090,sigma=0.1,mask=0.3", "range:latitude=48deg,longitude=11deg,height=0.5km,sigma=0.1"
    again, laser, mast = additions(problem, texts)
    assert again.place == problem.stations[0].place
    assert again.numbers["mask"] == pytest.approx(np.radians(10.0))
    assert (laser.place.station.name, laser.numbers["mask"]) == ("7090", 0.3)
    expected = earth.geodetic_to_position(np.radians(48.0), np.radians(11.0), 500.0)
    assert np.allclose(mast.place.station.position(problem.epoch), expected, atol=1e-6)
    assert mast.numbers["latitude"] == pytest.approx(np.radians(48.0))
    assert mast.numbers["mask"] == pytest.approx(np.radians(10.0))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("range:sigma=1", "give site=NAME of the ILRS, or latitude=, longitude= and height="),
        ("range:latitude=48deg,sigma=1", "give site=NAME of the ILRS, or latitude=, longitude= and height="),
        ("range:site=709,sigma=1", "no site of the ILRS is called '709'; did you mean '7109'?"),
        ("range:latitude=48m,longitude=1deg,height=0m,sigma=1", "must be in a unit such as deg"),
    ],
)
def test_what_is_wrong_with_an_addition_on_the_earth(call, orbit, text, message):
    assert message in call("observability", orbit, "--add", text).refused()


@pytest.mark.slow  # the kernels of an orbit
def test_an_added_station_measures_by_its_own_rule_at_all_times(call, orbit):
    """The same place once more halves the variance; at the other side of the Earth it sees at times when nobody else does."""
    document = call("observability", orbit, "--no-twins", "--json", "--add", "S").document
    ratio = np.array(document["added"]["singular_values"]) / np.array(document["singular_values"])
    assert np.allclose(ratio, np.sqrt(2), rtol=1e-6)
    elsewhere = call("observability", orbit, "--no-twins", "--json", "--add", "range:site=7090,sigma=1").document
    assert elsewhere["added"]["crlb_sigma"][0] < 0.7 * elsewhere["crlb_sigma"][0]
    hidden = call("observability", orbit, "--no-twins", "--json", "--add", "range:site=7090,sigma=1,mask=1.57").document
    assert np.allclose(hidden["added"]["crlb_sigma"], hidden["crlb_sigma"], rtol=1e-9)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["windows", SCENARIO, "--lags", "1,a"], "'1,a' is not whole numbers apart by commas"),
        (["windows", SCENARIO, "--lags", "5,0"], "0 states are no window"),
        (["windows", SCENARIO, "--lags", ""], "'' is not whole numbers"),
        (["windows", SCENARIO, "--iterations", "0"], "'--iterations': 0 is not in the range"),
        (["windows", SCENARIO, "-o", "w.txt"], "-o w.txt: the file must end in .json, .csv"),
        (["windows", "nowhere.npz"], "nowhere.npz"),
        (["observability", SCENARIO, "-o", "w.txt"], "-o w.txt: the file must end in .json, .csv"),
        (["observability", SCENARIO, "--add", "rader"], "--add rader: no station has this name; did you mean 'radar'?"),
        (["observability", SCENARIO, "--add", "rnge:sigma=1"], "unknown sensor 'rnge'; did you mean 'range'?"),
        (["observability", SCENARIO, "--add", "range:mx=1,my=2"], "sensor 'range' needs sigma=S, 0 given"),
        (["observability", SCENARIO, "--add", "range:mx=1,sigma=1"], "station 'added range' gives no value for 'my'"),
        (["observability", SCENARIO, "--add", "range:mx=one,my=2,sigma=1"], "mx is 'one'; it must be a number"),
        (["observability", SCENARIO, "--add", "range:mx=nan,my=2,sigma=1"], "mx"),
        (["observability", SCENARIO, "--add", "range:mx=1,my=2,sigma=0"], "sigma is 0; it must be positive"),
        (["observability", SCENARIO, "--add", "range=x:sigma=1"], "the model has a sensor 'range' already"),
        (["observability", SCENARIO, "--add", "b=x*:sigma=1"], "column 3 of 'x*'"),
        (["observability", SCENARIO, "--add", "b=__import__('os'):sigma=1"], "--add"),
        (["observability", SCENARIO, "--add", ""], "no station has this name"),
        (["observability", SCENARIO, "--add", "b=x:sigma=1,%%"], "'%%' is not NAME=NUMBER"),
    ],
)
def test_what_is_wrong_is_told_in_one_line(call, arguments, message):
    assert message in call(*arguments).refused()
