"""Tables of others: other names of columns, units, delimiters, order and clocks, taken and said, or refused in one line."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import piazzi as pz
from piazzi.io.csv import read_csv
from piazzi.io.naming import named
from piazzi.opening import RecordingWarning
from piazzi.tables import cells
from piazzi.tables.names import parse_columns
from tests.io.test_csv import ALONE, GOOD, PROBLEM
from tests.references.drawn import same_tracking

EPOCH = pz.Epoch("2016-02-13T16:00:00 UTC")
MODEL = pz.Model(["x", "v"], ["v", "0"], [pz.Sensor("radar", {"rng": "x"}, units={"rng": "m"})])


def problem(**changes):
    station = pz.Station("s", "radar", 1.0)
    return pz.Problem(MODEL, pz.Gaussian([0, 1], [1, 1]), None, [station], prior_time=0.0, epoch=EPOCH, **changes)


def read(folder, text, given=None, **options):
    path = folder / "rows.csv"
    path.write_text(text)
    return read_csv(path, given or problem(), **options)


@pytest.fixture(params=[0, 2**19], ids=["fast", "careful"])
def small(request, monkeypatch):
    monkeypatch.setattr(cells, "SMALL", request.param)


def test_columns_take_our_names_and_units(tmp_path, small):
    text = "stamp,note,RNG,quality\n2016-02-13T16:00:01Z,fine,1.5,3\n2016-02-13T16:00:02Z,too,2.5,4\n"
    found = read(tmp_path, text, columns={"time": "stamp", "rng": "RNG[km]"})
    assert_array_equal(found.row_times, [1, 2])
    assert_array_equal(found.values[:, 0], [1500, 2500])
    own = read(tmp_path, text.replace("RNG", "RNG [km]"), columns=parse_columns("time=stamp rng=rng"))
    assert same_tracking(own, found)


def test_letters_of_headers_may_have_any_case(tmp_path):
    capital = GOOD.replace("time,station,range,range_rate,bearing", "Time [s],STATION,Range,RANGE_RATE,Bearing")
    assert same_tracking(read(tmp_path, capital, PROBLEM), read(tmp_path, GOOD, PROBLEM))
    assert named(["X", "x"], ALONE, {}) == ["X", "x"]


@pytest.mark.parametrize(("mark", "word"), [(";", "semicolons"), ("\t", "tabs"), ("  ", "blanks")])
def test_other_marks_between_cells_are_taken_and_said(tmp_path, small, mark, word):
    text = "time,rng\n0,1.5\n1,2.5\n"
    with pytest.warns(RecordingWarning, match=f"rows.csv: {word} separate its cells"):
        found = read(tmp_path, text.replace(",", mark))
    assert same_tracking(found, read(tmp_path, text))


def test_rows_out_of_order_are_sorted_and_said(tmp_path, small):
    rows = ["2,west,3,1,", "0,west,1,1,", "2,north,,,0.5", "1,west,2,1,"]
    header = "time,station,range,range_rate,bearing\n"
    with pytest.warns(RecordingWarning, match="rows.csv: 2 of its rows were before the one above them: sorted"):
        found = read(tmp_path, header + "\n".join(rows) + "\n", PROBLEM)
    in_order = read(tmp_path, header + "\n".join([rows[1], rows[3], rows[0], rows[2]]) + "\n", PROBLEM)
    assert same_tracking(found, in_order)


def test_rows_with_dates_out_of_order_are_sorted(tmp_path):
    with pytest.warns(RecordingWarning, match="1 of its rows"):
        found = read(tmp_path, "time[UTC],rng\n2016-02-13T16:00:02,2\n2016-02-13T16:00:01,1\n")
    assert_array_equal(found.row_times, [1, 2])
    assert_array_equal(found.values[:, 0], [1, 2])


def test_a_fault_in_sorted_rows_has_the_line_of_the_file(tmp_path):
    with pytest.raises(ValueError, match="line 2: rng is inf"):
        read(tmp_path, "time,rng\n2,inf\n1,1\n")


def test_weeks_and_seconds_of_them_are_times(tmp_path, small):
    first = pz.Epoch("1980-01-06T00:00:00 GPS")
    seconds = np.array([576017.0, 576017.25, 576018.5])
    text = "gps_week,gps_tow,X\n" + "".join(f"1883,{s!r},1\n" for s in seconds.tolist())
    found = read(tmp_path, text, columns=parse_columns("week=gps_week sow=gps_tow rng=X[km]"), scale="GPS")
    wanted = [(first + 1883 * 604800.0) + s - EPOCH for s in seconds.tolist()]
    assert_allclose(found.row_times, wanted, rtol=0, atol=1e-9)
    assert found.row_times[0] == pytest.approx(pz.Epoch("2016-02-13T16:00:17 GPS") - EPOCH, abs=1e-9)
    plain = read(tmp_path, text.replace("gps_week,gps_tow,X", "week,sow,rng[km]"))
    assert same_tracking(plain, found)


@pytest.mark.parametrize(
    ("text", "options", "message"),
    [
        ("time,RNG\n0,1\n", {"columns": {"rng": "range"}}, "columns: there is no column 'range'.*; the file has time, RNG"),
        ("time,RNG\n0,1\n", {"columns": {"range": "RNG"}}, "columns: 'range' is not measured here; did you mean 'rng'"),
        ("time,RNG[m]\n0,1\n", {"columns": {"rng": "RNG[km]"}}, "columns: 'RNG' is in 'm' by its name, and 'km' was said"),
        ("time,a,A\n0,1,2\n", {"columns": {"rng": "à"}}, "columns: there is no column 'à'"),
        ("time,RNG\n0,1\n", {"columns": {"rng": "RNG[s]"}}, "has no unit of its kind: 'rng' is in m"),
        ("a,b\n0,1\n", {"columns": {"rng": "b"}}, "there is no column 'time'"),
        ("time;rng\n0;1,5\n", {}, "line 2: there is a comma among cells that semicolons separate; decimals have a point"),
        ('time\trng\n0\t1\n1\t"2"\n', {}, "line 3: there is a quote among cells that tabs separate"),
        ("week,sow,rng\n1883,604800,1\n", {}, "line 2: the second of the week is 604800; it must be from 0 to 604800"),
        ("week,sow,rng\n1883.5,0,1\n", {}, "line 2: the week is 1883.5; it must be a whole number below 10,000"),
        ("week,sow,rng\n1883,,1\n", {}, "line 2: the second of the week is nan"),
        ("week,sow,rng\n100,0,1\n", {}, r"line 2: week 100, at -1.07.* s is 34.2 years from the epoch"),
        ("week,sow,rng\n1883,0,1\n", {"scale": "UTC"}, "--scale UTC was said, but weeks and seconds of them are in GPS"),
        ("week,rng\n1883,1\n", {}, "unknown column 'week'"),
    ],
)
def test_what_does_not_fit_is_refused_in_one_line(tmp_path, text, options, message):
    with pytest.raises(ValueError, match=message) as error:
        read(tmp_path, text, **options)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        ("", {}),
        ("rng=range", {"rng": "range"}),
        ("week=gps_week sow=gps_tow x=X[km]", {"week": "gps_week", "sow": "gps_tow", "x": "X[km]"}),
        ("a=B [km/s]", None),
        ("v=V[km/s], t=T", {"v": "V[km/s]", "t": "T"}),
        ("truth:x=X", {"truth:x": "X"}),
        ("rng", None),
        ("rng=a rng=b", None),
        ("=b", None),
    ],
)
def test_names_at_the_command_line(text, wanted):
    if wanted is None:
        with pytest.raises(ValueError, match=r"columns: .*(is not NAME=COLUMN|is given twice)"):
            parse_columns(text)
    else:
        assert parse_columns(text) == wanted


SCENARIO = """\
epoch = "2016-02-13T16:00:00 UTC"
states = ["x", "v"]
[dynamics]
x = "v"
v = "0"
[sensors.radar.components]
rng = { equation = "x", unit = "m" }
[[stations]]
name = "s"
noise = { sigma = 1.0 }
[prior]
mean = [0, 1]
sigma = [1, 1]
[times]
step = 1.0
count = 3
[recording]
scale = "GPS"
columns = { time = "stamp", rng = "RANGE[km]" }
"""


def test_a_scenario_says_how_its_recordings_are_to_be_read(tmp_path):
    path = tmp_path / "a.toml"
    path.write_text(SCENARIO)
    rows = tmp_path / "rows.csv"
    rows.write_text("stamp,RANGE\n2016-02-13T16:00:17,1\n2016-02-13T16:00:18,2\n")
    _, found = pz.load(rows, scenario=path)
    assert_array_equal(found.row_times, [0, 1])
    assert_array_equal(found.values[:, 0], [1000, 2000])
    _, utc = pz.load(rows, scenario=path, scale="UTC")
    assert_array_equal(utc.row_times, [17, 18])
    given, simulated = pz.load(path)  # what Piazzi writes has its own names
    from piazzi.io import save

    save(rows, given, simulated)
    assert same_tracking(pz.load(rows, scenario=path)[1], simulated)
    with pytest.raises(ValueError, match="--columns is for files of tracking, with --scenario"):
        pz.load(path, columns="rng=X")


@pytest.mark.filterwarnings("default")
def test_a_refusal_is_one_line_whatever_was_put_right_before(tmp_path, capsys):
    from piazzi.cli.main import main

    path, rows = tmp_path / "a.toml", tmp_path / "rows.csv"
    path.write_text(SCENARIO)
    rows.write_text("time;rng\n0;1\n1;2\n")
    assert main(["simulate", str(rows), "--scenario", str(path)]) == 0
    assert capsys.readouterr().err.count("rows.csv: semicolons separate its cells") == 1
    path.write_text(SCENARIO.replace('epoch = "2016-02-13T16:00:00 UTC"', ""))
    rows.write_text("time;rng\n0;1\n-1e308;2\n")
    assert main(["simulate", str(rows), "--scenario", str(path)]) == 2
    (line,) = [said for said in capsys.readouterr().err.splitlines() if not said.startswith("piazzi: compiling")]
    assert "cannot be propagated back" in line


def test_the_command_line_names_columns(tmp_path):
    from piazzi.cli.main import main

    path = tmp_path / "a.toml"
    path.write_text(SCENARIO)
    rows = tmp_path / "rows.csv"
    rows.write_text("gps_week,gps_tow,X\n1883,576017,1\n1883,576018,2\n")
    names = "week=gps_week sow=gps_tow rng=X[m]"
    out = tmp_path / "o.csv"
    assert main(["estimate", str(rows), "--scenario", str(path), "--columns", names, "--scale", "GPS", "-o", str(out)]) == 0
    assert out.read_text().splitlines()[1].startswith("0.0,")
    assert main(["estimate", str(rows), "--scenario", str(path), "--columns", "rng"]) == 2
    assert main(["estimate", str(path), "--follow", "-", "--columns", "rng=X"]) == 2
