"""Measurements a line at a time: any header that a file may have, and each line as a file of it would be read."""

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from piazzi.io.lines import RowReader
from tests.io.test_csv import ALONE, GOOD, PROBLEM, read


@pytest.mark.parametrize(
    ("header", "line", "station", "time", "values"),
    [
        ("time,station,range,range_rate,bearing", "0.5,north,,,0.25", "north", 0.5, [0.25]),
        ("time,station,bearing", "0.5,north,0.25", "north", 0.5, [0.25]),  # nothing that the first station measures
        ("bearing [deg],time [min],station", "90,2,north", "north", 120.0, [np.pi / 2]),
        ("station,range,range_rate,time", "west,1,,0", "west", 0.0, [1, np.nan]),
    ],
)
def test_any_header_of_a_file_will_do(header, line, station, time, values):
    row = RowReader.begin(PROBLEM, header.encode(), 1).read(line.encode(), 2)
    assert (row.station, row.time) == (station, time)
    assert_array_equal(row.values, values)


def test_lines_are_read_as_a_file_of_them(tmp_path):
    header, *lines = GOOD.splitlines()
    reader, tracking = RowReader.begin(PROBLEM, header.encode(), 1), read(tmp_path, GOOD)
    for k, line in enumerate(lines):
        row = reader.read(line.encode(), k + 2)
        assert (row.time, row.station) == (tracking.row_times[k], tracking.row_stations[k])
        assert_array_equal(row.values, tracking.values[k, : len(row.values)])


@pytest.mark.parametrize(
    ("problem", "header", "says"),
    [
        (PROBLEM, "time,station,rnge", "unknown column 'rnge'; did you mean 'range'"),
        (PROBLEM, "time,range", "there is no column 'station'; the problem has west, north"),
        (PROBLEM, "time,station", "there is no column of measurements"),
        (PROBLEM, "station,range", "there is no column 'time'"),
        (ALONE, "time,range", "unknown column 'range'"),
        (ALONE, "time [parsec],bearing", "unknown unit 'parsec'"),
    ],
)
def test_a_header_that_is_none_is_refused_at_once(problem, header, says):
    with pytest.raises(ValueError) as error:
        RowReader.begin(problem, header.encode(), 1)
    assert says in str(error.value)


@pytest.mark.parametrize(
    ("line", "says"),
    [
        ("0,west", "line 7 has 2 cells"),
        ("0,north,1,,", "line 7: range is 1, but station 'north' measures bearing"),
    ],
)
def test_a_line_that_does_not_fit_is_told_by_its_number(line, says):
    header = GOOD.splitlines()[0].encode()
    with pytest.raises(ValueError) as error:
        RowReader.begin(PROBLEM, header, 1).read(line.encode(), 7)
    assert says in str(error.value)
