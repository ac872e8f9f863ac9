"""Comma-separated measurements: exact both ways, the same quickly as with care, and every fault with its line."""

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

import piazzi as pz
from piazzi.io import save
from piazzi.io.csv import read_csv, write_csv
from piazzi.tables import cells
from piazzi.text import escape_formula, unescape_formula
from tests.references.drawn import FLOATS, TEXT, problems, same_bits, same_tracking, trackings
from tests.waiting import HANGS, little

ROOT = Path(__file__).resolve().parents[2]
QUIET = settings(suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow])
MODEL = pz.Model(
    ["x", "v"],
    ["v", "0"],
    [pz.Sensor("radar", {"range": "x", "range_rate": "v"}), pz.Sensor("camera", {"bearing": "atan2(x, 1)"}, ["bearing"])],
)
PROBLEM = pz.Problem(
    MODEL, pz.Gaussian([1, 0], [1, 1]), None, [pz.Station("west", "radar", [1, 1]), pz.Station("north", "camera", 1e-4)]
)
ALONE = pz.Problem(MODEL, pz.Gaussian([1, 0], [1, 1]), None, [pz.Station("north", "camera", 1e-4)])
GOOD = """\
time,station,range,range_rate,bearing
0.0,west,1.5,,
0.5,west,1.4,-0.1,
0.5,north,,,0.25
"""


def read(tmp_path, text, problem=PROBLEM):
    path = tmp_path / "a.csv"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return read_csv(path, problem)


def test_components_find_their_columns_by_name(tmp_path):
    tracking = read(tmp_path, GOOD)
    assert_array_equal(tracking.row_times, [0, 0.5, 0.5])
    assert list(tracking.row_stations) == ["west", "west", "north"]
    assert_array_equal(tracking.values, [[1.5, np.nan], [1.4, -0.1], [0.25, np.nan]])
    assert tracking.truth is None


def test_the_order_of_columns_means_nothing(tmp_path):
    shuffled = "bearing,range_rate,time,range,station\n,,0.0,1.5,west\n,-0.1,0.5,1.4,west\n0.25,,0.5,,north\n"
    assert same_tracking(read(tmp_path, shuffled), read(tmp_path, GOOD))


def test_one_station_needs_no_column_and_angles_may_be_in_degrees(tmp_path):
    tracking = read(tmp_path, "time [min], bearing [deg]\n0, 90\n1, nan\n2,-45\n", ALONE)
    assert_allclose(tracking.values[:, 0], [np.pi / 2, np.nan, -np.pi / 4], rtol=1e-15)
    assert_array_equal(tracking.times, [0, 60, 120])
    assert tracking.row_stations is None


def test_a_model_in_other_units_gets_its_own(tmp_path):
    """What its equations are in, as its labels say: units of models made in Python are never converted."""
    sensor = pz.Sensor("radar", {"range": "x", "angle": "x"}, units={"range": "km", "angle": "deg"})
    model = pz.Model(["x"], ["0"], [sensor], units={"x": "km"})
    problem = pz.Problem(model, pz.Gaussian([1], [1]), None, [pz.Station("west", "radar", [1, 1])])
    header = "time [min],range [km],angle [mrad],truth:x [m]"
    tracking = read(tmp_path, f"{header}\n1,2,3,4\n", problem)
    assert tracking.times == 60
    assert_allclose(tracking.values, [[2, np.degrees(3e-3)]], rtol=1e-15)
    assert_allclose(tracking.truth, [[4e-3]], rtol=1e-15)
    assert same_tracking(
        read(tmp_path, "time,range,angle,truth:x\n60,2,3,4\n", problem), pz.Tracking([60], [[2, 3]], truth=[[4]])
    )


def two_sensors(first, second):
    """Two stations whose sensors call what they measure q, and say what it is in."""
    units = (("a", first), ("b", second))
    sensors = [pz.Sensor(name, {"q": "x"}, units={"q": unit} if unit else {}) for name, unit in units]
    model = pz.Model(["x"], ["0"], sensors)
    return pz.Problem(model, pz.Gaussian([1], [1]), None, [pz.Station("A", "a", 1), pz.Station("B", "b", 1)])


@pytest.mark.parametrize(
    ("first", "second", "unit", "factor"),
    [
        ("m", "", "deg", np.pi / 180),
        ("m", "parsec", "deg", np.pi / 180),
        ("m", "rad", "deg", np.pi / 180),
        ("m", "", "km", 1000),
        ("km", "rad", "m", 1e-3),
        ("km", "", "deg", np.pi / 180),
    ],
)
def test_one_column_of_sensors_with_different_units(tmp_path, first, second, unit, factor):
    tracking = read(tmp_path, f"time,station,q [{unit}]\n0,B,2\n", two_sensors(first, second))
    assert_allclose(tracking.values, [[2 * factor]], rtol=1e-15)


@pytest.mark.parametrize(
    ("first", "second", "unit", "says"),
    [
        ("m", "rad", "s", "column 'q [s]' has no unit of its kind: 'q' is in m, rad"),
        ("m", "km", "cm", "column 'q [cm]' must name no unit: 'q' is in km, m, by station"),
        ("", "km", "km", "column 'q [km]' must name no unit: 'q' is in km, no unit, by station"),
    ],
)
def test_a_unit_that_suits_no_station_or_means_two_things_is_refused(tmp_path, first, second, unit, says):
    with pytest.raises(ValueError, match=re.escape(says)):
        read(tmp_path, f"time,station,q [{unit}]\n0,B,2\n", two_sensors(first, second))


@pytest.mark.parametrize(
    "text",
    [
        GOOD.replace("\n", "\r\n"),
        "\ufeff" + GOOD,
        GOOD.rstrip("\n"),
        GOOD + "\n\n",
        "# a remark\n\n" + GOOD,
        GOOD.replace("west", ' "west"'[1:]),
    ],
)
def test_harmless_variants_are_the_same(tmp_path, text):
    assert same_tracking(read(tmp_path, text), read(tmp_path, GOOD))


@QUIET
@given(st.data())
def test_round_trip_is_exact(tmp_path, data):
    problem = data.draw(problems())
    tracking = data.draw(trackings(problem))
    write_csv(tmp_path / "a.csv", problem, tracking)
    assert same_tracking(read_csv(tmp_path / "a.csv", problem), tracking)


@QUIET
@given(
    st.lists(st.tuples(FLOATS, st.floats(allow_infinity=False)), min_size=1, max_size=50),
    st.lists(TEXT, min_size=1, max_size=3),
)
def test_the_fast_way_and_the_careful_way_agree(rows, names):
    header = ["time", "station", "range"]
    lines = [f"{t!r},{names[i % len(names)]},{'' if np.isnan(v) else repr(v)}" for i, (t, v) in enumerate(rows)]
    body = "\n".join(lines).encode()
    fast, careful = cells.fast(body, 2, header, ()), None
    try:
        careful = cells.parse_rows(body, 2, header, ())
    except ValueError:
        assert fast is None
    if fast is not None:
        assert careful is not None
        assert all(same_bits(fast.numbers[name], careful.numbers[name]) for name in ("time", "range"))
        assert [fast.station_names[i] for i in fast.station] == [careful.station_names[i] for i in careful.station]
        assert list(fast.lines) == careful.lines


def test_names_that_look_like_numbers_stay_names():
    """As in "station 007", the fast way and the careful way alike."""
    body = b"0.0,007,1\n1.0,7,2\n2.0,1e3,3\n3.0,nan,4\n4.0,True,5"
    header = ["time", "station", "range"]
    for read_body in (cells.fast, cells.parse_rows):
        table = read_body(body, 2, header, ())
        assert [table.station_names[i] for i in table.station] == ["007", "7", "1e3", "nan", "True"]


ALPHABET = st.sampled_from(
    [*"0123456789.,,,,\n\n+-eE _\"'#\r\t\0xaT", "nan", "inf", "True", "false", "1e", "west", "é", ",,", "1.5", "0x1", "١"]
)


@settings(max_examples=300)
@given(
    st.lists(ALPHABET, max_size=30).map("".join),
    st.sampled_from([["time"], ["time", "range"], ["time", "station"], ["time", "station", "range"]]),
    st.integers(1, 40),
)
def test_whatever_the_fast_way_takes_the_careful_way_takes_too(text, header, piece):
    body = text.strip("\n").encode()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(cells, "PIECE", piece)
        fast = cells.fast(body, 2, header, ())
    if fast is not None:
        careful = cells.parse_rows(body, 2, header, ())
        assert all(same_bits(fast.numbers[name], careful.numbers[name]) for name in careful.numbers)
        assert list(fast.lines) == careful.lines


@pytest.mark.parametrize("version", ["2.2.2", "2.3.3", "3.0.0", "3.1.0", "3.1.1", "3.2.0rc0", "10.0.0"])
def test_old_pandas_is_asked_for_the_nearest_double(version):
    """Those before 3.1 are up to 9e-13 off by themselves; CI reads a large file with the oldest that is allowed."""
    assert bool(cells._exact(version)) == version.startswith(("2.", "3.0"))


def test_every_double_survives(tmp_path):
    """Over the bit patterns of doubles, and more than one block of the fast way."""
    bits = np.random.default_rng(0).integers(0, 2**63, 60_000, dtype=np.uint64) | np.arange(
        60_000, dtype=np.uint64
    ) % 2 << np.uint64(63)
    values = bits.view(float)
    values = values[np.isfinite(values)]
    tracking = pz.Tracking(np.arange(len(values)) * 0.1, np.column_stack([values, np.full_like(values, np.nan)]))
    save(tmp_path / "a.csv", ALONE, tracking)
    assert same_tracking(read_csv(tmp_path / "a.csv", ALONE), tracking)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "the file is empty"),
        ("\n\n", "the file is empty"),
        ("# only a remark\n", "the file is empty"),
        ("time,station,range\n", "there are no measurements"),
        ("time,station,rnge\n0,west,1\n", "unknown column 'rnge'; did you mean 'range'"),
        ("t,station,range\n0,west,1\n", "unknown column 't'"),
        ("station,range\nwest,1\n", "there is no column 'time'"),
        ("time,station\n0,west\n", "there is no column of measurements (bearing, range, range_rate)"),
        ("time,range\n0,1\n", "there is no column 'station'; the problem has west, north"),
        ("time,time,range\n0,0,1\n", "line 1: two columns are called 'time'"),
        ("time,,range\n0,0,1\n", "line 1: column 2 has no name"),
        ("time [parsec],station,range\n0,west,1\n", "unknown unit 'parsec'"),
        ("time [m],station,range\n0,west,1\n", "column 'time [m]' has no unit of its kind: 'time' is in s"),
        ("time,station,bearing [km]\n0,north,1\n", "column 'bearing [km]' has no unit of its kind: 'bearing' is in rad"),
        ("time,station,range\n0,west,1\n1,west\n", "line 3 has 2 cells; the header names 3 (time, station, range)"),
        ("time,station,range\n0,west,1,2\n", "line 2 has 4 cells"),
        ("time,station,range\n0,west,1\n\n1,west,abc\n", "line 4: range is 'abc'; it must be a number"),
        ("time,station,range\n0,west,1\n1,west,1_0\n", "line 3: range is '1_0'"),
        ("time,station,range\n0,west,1\n1,west,0x10\n", "line 3: range is '0x10'"),
        ("time,station,range\n0,west,1\nabc,west,1\n", "line 3: time is 'abc'"),
        ("time,station,range\n0,west,1\n,west,1\n", "line 3: the time is missing"),
        ("time,station,range\n0,west,1\ninf,west,1\n", "line 3: the time is inf"),
        ("time,station,range\n-1e308,west,1\n1e308,west,1\n", "line 3 is at 1e+308 s, too far after -1e+308 s"),
        ("time,station,range\n0,west,1\n1,wset,1\n", "line 3: unknown station 'wset'; did you mean 'west'"),
        ("time,station,range\n0,west,1\n1,,1\n", "line 3: the station has no name"),
        ("time,station,range\n0,west,1\n1,north,1\n", "line 3: range is 1, but station 'north' measures bearing"),
        ("time,station,range\n0,west,1\n1,west,-inf\n", "line 3: range is -inf; leave the cell empty"),
        ("time,station,range,range_rate\n0,west,,\n1,west,,\n", "every value is missing"),
        ('time,station,range\n0,"west,1\n1,west,1\n', "line"),
        ('time,station,range\n0,we"st,1\n', "unknown station"),
        ("time,station,range,truth:x\n0,west,1,1\n", "the truth has no column 'truth:v'"),
        ("time,station,range\n0,west,1\n", "there is no column 'range_rate', which station 'west' measures: add it"),
        (
            "time,station,range,range_rate,truth:x,truth:v\n0,west,1,,1,2\n1,west,1,,1,-inf\n",
            "line 3: truth:v is -inf; leave the cell empty where it is not known",
        ),
        (b"time,station,range\n0,west,1\n1,w\xffst,1\n", "line 3: it is not UTF-8 text: byte 0xff"),
        (b"time,station,range\n0,west,\0\n", "it is not text"),
        (b"PK\3\4\0\0\0", "it is not text"),
        ("time,station,range\n0,west,\x1b[31m\n", "\\x1b[31m"),
        ("x" * 200_000 + "\n", "line 1: field larger than field limit"),
        ("time,station,range\n0,west," + "1" * 200_000 + "x\n", "line 2: field larger than field limit"),
        (",".join(f"c{i}" for i in range(2000)), "there are 2000 columns"),
    ],
)
def test_faults_are_told_with_their_line(tmp_path, text, says):
    for size in (0, 2**19):  # the fast way and the careful one must tell the same
        with pytest.MonkeyPatch.context() as patch, pytest.raises(ValueError, match=r"a\.csv: ") as error:
            patch.setattr(cells, "SMALL", size)
            read(tmp_path, text)
        assert says in str(error.value)
        assert str(error.value).isprintable()
        assert len(str(error.value)) < 600


def test_a_component_called_like_another_column_is_refused(tmp_path):
    model = pz.Model(["x"], ["0"], [pz.Sensor("s", {"time": "x"})])
    problem = pz.Problem(model, pz.Gaussian([1], [1]), None, [pz.Station("a", "s", 1)])
    with pytest.raises(ValueError, match="two columns would be called 'time'"):
        write_csv(tmp_path / "a.csv", problem, pz.Tracking([0], [1]))


def test_no_python_runs_row_by_row_through_a_long_file(tmp_path):
    """Counted, not timed: another twenty thousand rows take a few hundred lines of Python more, all libraries included.

    The careful way, which takes some fifty for each row, shows that they are counted.
    """
    more, paths = 20_000, (tmp_path / "a.csv", tmp_path / "b.csv")
    for i, path in enumerate(paths):
        J = (1 + i) * more
        values = np.random.default_rng(0).normal(size=(J, 2))
        tracking = pz.Tracking(np.arange(J) * 0.1, values, np.tile(["west"], J))
        write_csv(path, PROBLEM, tracking)
        assert same_tracking(read_csv(path, PROBLEM), tracking)  # the first time imports pandas
    # in a process of its own: tracing stays where it is, for ever, in one that has had a browser's greenlets (CPython 3.11)
    program = "import sys; from tests.io.test_csv import counted; counted(*sys.argv[1:])"
    done = subprocess.run(
        [sys.executable, "-c", program, *map(str, paths)], cwd=ROOT, capture_output=True, text=True, timeout=HANGS
    )
    short, long, short_with_care, long_with_care = map(int, done.stdout.split())
    assert long - short < 0.1 * more
    assert long_with_care - short_with_care > more


def counted(*paths):
    """Print how many lines of Python read each file, and how many with care."""
    for fast in (cells.fast, lambda *table: None):
        cells.fast = fast
        for path in paths:
            read_csv(path, PROBLEM)
            print(lines_of_python(lambda path=path: read_csv(path, PROBLEM)))


def test_comments_cost_by_their_number_and_not_by_its_square(tmp_path):
    """A million empty ones: what was behind each was copied for it, half a minute in all."""
    path = tmp_path / "comments.csv"
    path.write_bytes(b"#\n" * 1_000_000 + b"time,r\n0,1\n")
    found = little(lambda: cells.read_cells(path), 15.0)
    assert (len(found.comments), list(found.lines)) == (1_000_000, [1_000_002])


def lines_of_python(work):
    """How many lines are run and functions entered and left by a call, however deep."""
    count = 0

    def one_more(frame, event, argument):
        nonlocal count
        count += 1
        return one_more

    before = sys.gettrace()
    sys.settrace(one_more)
    try:
        work()
    finally:
        sys.settrace(before)
    return count


def test_a_station_that_is_not_in_the_file_needs_no_columns(tmp_path):
    """And one that is may have empty ones."""
    tracking = read(tmp_path, "time,station,bearing\n0,north,0.25\n")
    assert_array_equal(tracking.values, [[0.25, np.nan]])
    tracking = read(tmp_path, "time,station,range,range_rate\n0,west,1,\n")
    assert_array_equal(tracking.values, [[1, np.nan]])


HOSTILE = ["=1+1", "+cmd|' /C calc'!A0", "-2+3", "@SUM(A1)", "'=1", "''@x", "'plain", "it's", "\t=1", "\r=1", "'", "=", "''"]


def test_no_station_is_a_formula_and_all_are_read_back(tmp_path):
    names = [name for name in HOSTILE if name.strip() == name]
    model = pz.Model(["x"], ["0"], [pz.Sensor("ruler", ["x"])])
    problem = pz.Problem(model, pz.Gaussian(0, 1), None, [pz.Station(name, "ruler", 1) for name in names])
    tracking = pz.Tracking(np.arange(len(names)), np.full(len(names), -1.5), names)
    write_csv(tmp_path / "a.csv", problem, tracking)
    rows = [row.split(",") for row in (tmp_path / "a.csv").read_text().splitlines()]
    assert not [row[1] for row in rows if row[1].strip('"')[0] in "=+-@\t\r"]
    assert {row[2] for row in rows[1:]} == {"-1.5"}  # numbers stay numbers
    assert same_tracking(read_csv(tmp_path / "a.csv", problem), tracking)


@pytest.mark.parametrize("name", HOSTILE)
def test_what_is_written_for_spreadsheets_is_undone(name):
    assert unescape_formula(escape_formula(name)) == name
    assert escape_formula(name)[:1] not in ("=", "+", "-", "@", "\t", "\r")


@given(st.text(alphabet="'=+-@\t\rab1", max_size=6))
def test_cells_of_different_names_differ(name):
    assert unescape_formula(escape_formula(name)) == name
