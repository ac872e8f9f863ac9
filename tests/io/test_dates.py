"""Dates in files: read as `Epoch` reads them, counted from the problem's epoch, and every fault in one line with its place."""

import dataclasses
import datetime

import numpy as np
import pandas as pd
import pytest
import xarray
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

import piazzi as pz
from piazzi.cli import conventions
from piazzi.earth.columns import read_dates
from piazzi.earth.scales import SCALES
from piazzi.io import load_estimate, save, save_estimate
from piazzi.io.checkpoint import fingerprint
from piazzi.io.csv import read_csv
from piazzi.io.lines import RowReader
from piazzi.io.npz import read_npz, write_npz
from piazzi.scenarios import ScenarioError, load_scenario
from piazzi.scenarios.write import problem_from_tables, problem_to_tables
from piazzi.tables import cells
from tests.references.drawn import same_problem, same_tracking
from tests.waiting import little

EPOCH = pz.Epoch("2016-12-31T23:00:00 UTC")  # an hour and a second before a day that followed a leap second
ODD = pz.Epoch.at(5.0e8, 0.12345678901234567)
MODEL = pz.Model(["x", "v"], ["v", "0"], [pz.Sensor("ruler", {"z": "x"})])


def problem(epoch=EPOCH, prior_time=0.0):
    noise, station = np.zeros((2, 2)), pz.Station("s", "ruler", 1.0)
    return pz.Problem(MODEL, pz.Gaussian([0, 1], [1, 1]), noise, [station], prior_time=prior_time, epoch=epoch)


PROBLEM = problem()


def read(folder, text, given=PROBLEM, scale=None):
    path = folder / "rows.csv"
    path.write_text(text)
    return read_csv(path, given, scale)


# ---- a column at once ---------------------------------------------------------------------------------------------------


def test_the_command_line_knows_the_scales():
    assert conventions.SCALES == SCALES


def one_by_one(texts, scale=None):
    found = [pz.Epoch(t, scale) for t in texts]
    return np.array([e.whole for e in found]), np.array([e.fraction for e in found])


@st.composite
def dates(draw):
    when = draw(st.datetimes(datetime.datetime(1962, 1, 3), datetime.datetime(2026, 1, 1)))
    text = when.strftime("%Y-%m-%d") if draw(st.booleans()) else when.strftime("%Y-%j")
    text += draw(st.sampled_from("T ")) + when.strftime("%H:%M:%S")
    digits = draw(st.integers(0, 20))
    return text + (draw(st.sampled_from(".,")) + draw(st.from_regex(f"[0-9]{{{digits}}}", fullmatch=True)) if digits else "")


@settings(max_examples=60)
@given(
    st.lists(dates(), min_size=1, max_size=6), st.sampled_from(["UTC", "TAI", "TT", "TDB", "TCG", "GPS", "UT1"]), st.booleans()
)
def test_a_column_of_dates_is_what_epoch_makes_of_each_in_all_bits(texts, scale, in_cells):
    cells = [f"{t} {scale}" for t in texts] if in_cells else texts
    found = read_dates(np.array(cells, dtype=bytes), None if in_cells else scale)
    assert found.scale == scale
    whole, fraction = one_by_one(texts, scale)
    assert_array_equal(found.whole, whole)
    assert_array_equal(found.fraction, fraction)


def test_dates_in_other_forms_stand_beside_one_another():
    texts = [
        "2016-12-31T23:59:59Z",
        "2016-12-31T23:59:60 UTC",
        "2017-01-01T02:00:00.5+02:00",
        "2017-01-01[UTC]",
        "MJD 57754.5 UTC",
    ]
    found = read_dates(np.array(texts, dtype=bytes))
    assert_allclose(found.whole - found.whole[0] + found.fraction - found.fraction[0], [0, 1, 2.5, 2, 43202], rtol=0, atol=1e-9)


@pytest.mark.parametrize(
    ("texts", "scale", "message"),
    [
        (["2016-02-13T16:00:00"], None, "row 0: date '2016-02-13T16:00:00' has no time scale: add one of UTC"),
        (["2016-02-13T16:00:00Z", "1959-12-31T23:59:59Z"], None, "row 1: date .* there is no UTC before 1960"),
        (["2016-02-13T23:59:60Z"], None, "row 0: date .* that day did not end with a leap second"),
        (["2016-12-31T23:59:61Z"], None, "row 0: .* is no time of a day"),
        (["2015-02-29T00:00:00 TT"], None, "row 0: .* the calendar has no such day"),
        (["2016-02-13T16:00:00 GMT"], None, "row 0: .* 'GMT' is no time scale"),
        (["2016-02-13T16:00:00 GPS", "2016-02-13T16:00:01 UTC"], None, "row 1: .* is in UTC, those before in GPS"),
        (["2016-02-13T16:00:00 GPS"], "UTC", "row 0: .* is in GPS, and UTC was said beside it"),
        (["2016-02-13T16:00:00 TT", "soon"], None, "row 1: date 'soon' cannot be read"),
    ],
)
def test_what_is_no_date_is_refused_with_its_row(texts, scale, message):
    with pytest.raises(ValueError, match=message) as error:
        read_dates(np.array(texts, dtype=bytes), scale)
    assert "\n" not in str(error.value)


def test_a_million_dates_take_seconds(tmp_path, monkeypatch):
    J = 1_000_000
    t = np.arange(J) * 3.123
    stamps = np.datetime64("2016-12-31T23:00:00", "us") + (t * 1e6).astype("m8[us]")
    body = "\n".join(f"{d},1.5" for d in np.datetime_as_string(stamps).tolist())
    path = tmp_path / "rows.csv"
    path.write_text(f"time[GPS],z\n{body}\n")
    cells.read_cells(path)  # pandas is imported
    tracking = little(lambda: read_csv(path, problem(pz.Epoch("2016-12-31T23:00:00 GPS"))), 8.0)
    assert_allclose(tracking.row_times, (t * 1e6).astype(int) / 1e6, rtol=0, atol=1e-9)


# ---- tables -------------------------------------------------------------------------------------------------------------

ROWS = "2016-12-31T23:59:59,1\n2016-12-31T23:59:60,2\n2017-01-01T00:00:00.25,3\n"
WANTED = [3599.0, 3600.0, 3601.25]


@pytest.mark.parametrize(
    ("text", "scale"),
    [
        ("time[UTC],z\n" + ROWS, None),
        ("time [utc],z\n" + ROWS, None),
        ("time,z\n" + ROWS.replace(",", " UTC,"), None),
        ("time,z\n" + ROWS.replace(",", "Z,"), None),
        ("time,z\n" + ROWS, "UTC"),
        ("time[UTC],z\n" + ROWS, "utc"),
        ('z,time\n1,"2016-12-31T23:59:59Z"\n2, 2016-12-31T23:59:60Z\n3,2017-01-01T00:00:00.25Z\n', None),
    ],
)
def test_dates_become_seconds_past_the_epoch_of_the_problem_leap_seconds_counted(tmp_path, monkeypatch, text, scale):
    for small in (0, 2**19):  # quickly and with care
        monkeypatch.setattr(cells, "SMALL", small)
        tracking = read(tmp_path, text, scale=scale)
        assert_allclose(tracking.row_times, WANTED, rtol=0, atol=1e-9)
        assert tracking.epoch == EPOCH


@pytest.mark.parametrize(
    ("text", "scale", "message"),
    [
        ("time,z\n" + ROWS, None, r"line 2: date .* has no time scale: .*; or say it once: --scale UTC, or time\[UTC\]"),
        ("time[UTC],z\n" + ROWS, "GPS", "--scale GPS was said, but column 'time' is in UTC"),
        ("time,z\n0,1\n1,2\n", "GPS", "--scale GPS is for dates; the times of this file are seconds"),
        ("time[UTC],z\n2017-01-01,1\n,1\n", None, "line 3: the time is missing; it must be a date"),
        ("time[UTC],z\n2017-01-01,1\n\n2017-01-01T00:00:0x,1\n", None, "line 4: date '2017-01-01T00:00:0x' cannot be read"),
        ("time[UTC],z\n2020-06-01,1\n", None, r"line 2: 2020-06-01, at 1\.07744e\+08 s is 3\.41 years from the epoch"),
        (
            "time,z\n2017-01-01T00:00:00 UTC,1\n2017-01-01T00:00:20 GPS,1\n",
            None,
            "line 3: date .* is in GPS, those before in UTC",
        ),
        ("time[XYZ],z\n2017-01-01,1\n", None, "XYZ"),
        ("time[UTC],z\n", None, "there are no measurements: only a header"),
        ("# epoch = 2017-01-01\ntime,z\n0,1\n", None, "date '2017-01-01' has no time scale"),
        ("time[UTC],z\n" + "2" * 99 + ",1\n", None, "line 2: the time is .* it must be a date such as"),
    ],
)
def test_a_table_with_a_fault_is_refused_in_one_line(tmp_path, text, scale, message):
    with pytest.raises(ValueError, match=message) as error:
        read(tmp_path, text, scale=scale)
    assert "\n" not in str(error.value)


def test_without_an_epoch_dates_need_a_prior_at_the_first_of_them(tmp_path):
    with pytest.raises(
        ValueError, match=r'problem has no epoch.*prior at 0 s: give it one, such as epoch = "2016-12-31T23:59:59 UTC"'
    ):
        read(tmp_path, "time[UTC],z\n" + ROWS, problem(None))
    tracking = read(tmp_path, "time[UTC],z\n" + ROWS, problem(None, None))
    assert tracking.epoch == pz.Epoch("2016-12-31T23:59:59 UTC")
    assert_allclose(tracking.row_times, [0, 1, 2.25], rtol=0, atol=1e-9)
    commented = read(tmp_path, f"# epoch = {EPOCH.exact()}\ntime[UTC],z\n{ROWS}", problem(None))
    assert_allclose(commented.row_times, WANTED, rtol=0, atol=1e-9)


def test_seconds_past_an_epoch_of_the_file_become_those_past_the_problems(tmp_path):
    named = read(tmp_path, "time[s past 2017-01-01T00:00:00 UTC],z\n-1,1\n0.125,2\n")
    tracking = read(tmp_path, "# epoch = 2017-01-01T00:00:00 UTC\ntime,z\n-1,1\n0.125,2\n")
    assert same_tracking(named, tracking)
    assert_array_equal(tracking.row_times, [3600.0, 3601.125])
    assert tracking.epoch == EPOCH


def test_a_stream_reads_dates_line_by_line():
    reader = RowReader.begin(PROBLEM, b"time,z", 1)
    assert reader.read(b"2016-12-31T23:59:60 UTC,2\n", 2).time == 3600.0
    assert reader.read(b"3601.5,2\n", 3).time == 3601.5
    said_once = RowReader.begin(PROBLEM, b"time[GPS],z", 1)
    assert said_once.read(b"2017-01-01T00:00:17,2\n", 2).time == 3600.0
    by_option = RowReader.begin(PROBLEM, b"time,z", 1, (), "GPS")
    assert by_option.read(b"2017-01-01T00:00:17,2\n", 2).time == 3600.0
    with pytest.raises(ValueError, match=r"line 2: date .* has no time scale"):
        reader.read(b"2016-12-31T23:59:59,2\n", 2)
    with pytest.raises(ValueError, match="line 1: there are dates, but the problem has no epoch"):
        RowReader.begin(problem(None), b"time[GPS],z", 1)
    with pytest.raises(ValueError, match="line 2: there are dates, but the problem has no epoch"):
        RowReader.begin(problem(None, None), b"time,z", 1).read(b"2016-12-31T23:59:59 TT,2\n", 2)
    moved = RowReader.begin(PROBLEM, b"time,z", 2, ("epoch = 2017-01-01T00:00:00 UTC",))
    assert moved.read(b"1,2\n", 3).time == 3602.0


# ---- other files --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("epoch", [EPOCH, ODD])
def test_epochs_come_back_in_all_bits(tmp_path, epoch):
    given = problem(epoch)
    tracking = pz.simulate(given, [0.0, 0.1, 5.0], np.random.default_rng(0))
    assert tracking.epoch == epoch
    assert same_problem(problem_from_tables(problem_to_tables(given), "", ""), given)
    save(tmp_path / "a.nc", given, tracking)
    again, rows = pz.load(tmp_path / "a.nc")
    assert same_problem(again, given)
    assert same_tracking(rows, tracking)
    save(tmp_path / "a.csv", given, tracking)
    assert same_tracking(read_csv(tmp_path / "a.csv", given), tracking)
    assert same_tracking(read_csv(tmp_path / "a.csv", problem(None)), tracking)


def test_estimates_keep_the_epoch(tmp_path):
    tracking = pz.simulate(PROBLEM, [0.0, 0.1, 5.0], np.random.default_rng(0))
    estimate = pz.ExtendedKalmanFilter().estimate(PROBLEM, tracking)
    assert estimate.epoch == EPOCH
    dataset = estimate.to_dataset()
    assert dataset.attrs["epoch"] == "2016-12-31T23:00:00 UTC"
    assert_array_equal(dataset.attrs["epoch_tt"], [EPOCH.whole, EPOCH.fraction])
    assert_array_equal(dataset["time"], tracking.times)
    for name in ("e.nc", "e.npz", "e.csv"):
        save_estimate(tmp_path / name, estimate)
    assert load_estimate(tmp_path / "e.nc").epoch == EPOCH
    with xarray.open_dataset(tmp_path / "e.nc", engine="h5netcdf") as found:
        assert found.attrs["epoch"] == "2016-12-31T23:00:00 UTC"
    with np.load(tmp_path / "e.npz") as found:
        assert_array_equal(found["epoch_tt"], [EPOCH.whole, EPOCH.fraction])
        assert str(found["epoch"]) == "2016-12-31T23:00:00 UTC"
    frame = pd.read_csv(tmp_path / "e.csv")
    assert frame.columns[0] == "time[s past 2016-12-31T23:00:00 UTC]" and frame.columns[-1] == "view"
    assert_array_equal(frame.iloc[:, 1 : 1 + len(estimate.names)], estimate.mean)
    pz.save(tmp_path / "t.csv", problem(EPOCH), tracking)
    frame = pd.read_csv(tmp_path / "t.csv")
    assert_array_equal(frame.iloc[:, 0], tracking.row_times)


def test_the_founding_layout_keeps_the_epoch(tmp_path):
    found, _ = pz.load("satellite-bearing", seed=1)
    times = np.arange(4) * 10.0
    plain = dataclasses.replace(found, truth=None, prior_time=0.0, integrator=pz.ConstantAcceleration(10))
    for epoch in (None, EPOCH, ODD):
        dated = dataclasses.replace(plain, epoch=epoch)
        write_npz(tmp_path / "a.npz", dated, pz.simulate(dated, times, np.random.default_rng(0)))
        again, rows = read_npz(tmp_path / "a.npz")
        assert again.epoch == rows.epoch == epoch
    with np.load(tmp_path / "a.npz") as found:
        arrays = dict(found)
    for bad in ([1.0], [np.nan, 0.0], [1e300, 0.0], [0.0, 1.0]):
        np.savez(tmp_path / "b.npz", **arrays | {"epoch_tt": np.array(bad)})
        with pytest.raises(ValueError, match=r"epoch_tt"):
            read_npz(tmp_path / "b.npz")


def test_a_checkpoint_belongs_to_its_epoch():
    estimator = pz.ExtendedKalmanFilter()
    one, other, none = (fingerprint(problem(e), estimator) for e in (EPOCH, ODD, None))
    assert not np.array_equal(one, other)
    assert not np.array_equal(one, none)


SCENARIO = """\
epoch = "{epoch}"
states = ["x", "v"]
[dynamics]
x = "v"
v = "0"
[sensors.ruler.components]
z = "x"
[[stations]]
name = "s"
noise = {{ sigma = 1.0 }}
[prior]
mean = [0, 1]
sigma = [1, 1]
[times]
step = 1.0
count = 3
{more}
"""


def scenario(folder, epoch="2016-12-31T23:00:00 UTC", more=""):
    path = folder / "dated.toml"
    path.write_text(SCENARIO.format(epoch=epoch, more=more))
    return path


def test_a_scenario_says_its_epoch(tmp_path):
    found = load_scenario(scenario(tmp_path)).problem
    assert found.epoch == EPOCH
    assert pz.load(tmp_path / "dated.toml")[1].epoch == EPOCH


@pytest.mark.parametrize(
    ("epoch", "more", "message"),
    [
        ("2016-12-31T23:00:00", "", "epoch: date '2016-12-31T23:00:00' has no time scale: add one of UTC"),
        ("1959-01-01 UTC", "", "epoch: date .*: there is no UTC before 1960; give it in UT1 or TT"),
        ("2016-02-13T23:59:60 UTC", "", "epoch: date .*: that day did not end with a leap second"),
        (
            "2016-02-13 UTC",
            "[[manoeuvres]]\ntime = 2e8\ndelta_v = [1]\nstates = ['v']",
            r"the time of a manoeuvre, 2e\+08 s is 6\.34 years from the epoch",
        ),
        (
            "2016-02-13 UTC",
            "start = 1e8",
            r"1e\+08 s is 3\.17 years from the epoch, 2016-02-13T00:00:00 UTC; times stay within",
        ),
    ],
)
def test_a_scenario_with_a_bad_epoch_is_refused(tmp_path, epoch, more, message):
    with pytest.raises(ScenarioError, match=message) as error:
        load_scenario(scenario(tmp_path, epoch, more))
    assert "\n" not in str(error.value)
