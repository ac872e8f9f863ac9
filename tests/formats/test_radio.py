"""Frequencies as amateur receivers list them."""

import numpy as np
import pytest

import piazzi as pz


def put(tmp_path, *lines):
    path = tmp_path / "pass.dat"
    path.write_text("\n".join(lines) + "\n")
    return path


def test_rows_of_both_forms(tmp_path):
    table = pz.read_tracking(
        put(tmp_path, "# S band", "58130.50000000 2244012345.5 12.3 4171", "18/01/12 12:00:10.5 2244012245.0 1.1e-3 4553")
    )
    assert set(table.kinds) == {"receive_frequency"} and table.stations == ("4171", "4553") and table.objects == ()
    assert table.line.tolist() == [2, 3]
    np.testing.assert_array_equal(table.value, [2244012345.5, 2244012245.0])
    assert abs(table.instant(0) - pz.Epoch("2018-01-12T12:00:00 UTC")) < 1e-9
    assert abs(table.instant(1) - pz.Epoch("2018-01-12T12:00:10.5 UTC")) < 1e-9
    segment = table.segments[0]
    assert (segment.scale, segment.way, segment.tag) == ("UTC", "one-way", "receive") and "--sigma" in table.open[0]


@pytest.mark.parametrize(
    "line, what",
    [
        ("58130.5 2244012345.5 12.3 4171 9999", "a second site is that of a transmitter"),
        ("58130.5 2244012345.5 12.3", "the line has 3 fields"),
        ("58130.5 -2244012345.5 12.3 4171", "must be positive"),
        ("18/13/12 12:00:10.5 2244012345.5 12.3 4171", "no such day"),
        ("5813x.5 2244012345.5 12.3 4171", "cannot be read"),
    ],
)
def test_each_mistake_has_one_line(tmp_path, line, what):
    with pytest.raises(ValueError, match=what) as error:
        pz.read_tracking(put(tmp_path, "58130.5 2244012345.5 12.3 4171", line))
    assert "pass.dat: line 2: " in str(error.value) and "\n" not in str(error.value)
