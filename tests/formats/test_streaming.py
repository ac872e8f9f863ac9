"""Lines of tracking as they come: read in pieces they are the whole file, and one that is wrong is told by its own line."""

import numpy as np
import pytest

import piazzi as pz
from piazzi.formats import concatenate
from piazzi.formats.streaming import Lines, is_mark, reader

TDM = """CCSDS_TDM_VERS = 2.0
CREATION_DATE = 2026-11-03T00:00:00
ORIGINATOR = X
META_START
TIME_SYSTEM = UTC
PARTICIPANT_1 = BER
PARTICIPANT_2 = SAT
MODE = SEQUENTIAL
PATH = 1,2,1
ANGLE_TYPE = AZEL
RANGE_UNITS = km
META_STOP
DATA_START
RANGE = 2026-11-03T04:12:00 1000.0
ANGLE_1 = 2026-11-03T04:12:00 10.0
ANGLE_2 = 2026-11-03T04:12:00 20.0

COMMENT nothing
ANGLE_1 = 2026-11-03T04:12:10 11.0
ANGLE_2 = 2026-11-03T04:12:10 21.0
RANGE = 2026-11-03T04:12:10 1001.0
DATA_STOP
META_START
TIME_SYSTEM = UTC
PARTICIPANT_1 = TEN
PARTICIPANT_2 = SAT
MODE = SEQUENTIAL
PATH = 1,2,1
RANGE_UNITS = km
META_STOP
DATA_START
RANGE = 2026-11-03T04:13:00 1002.0
"""
TABLE = """# frame = ITRF
time[UTC],x[km],y[km],z[km],sigma x[m],sigma y[m],sigma z[m]
2026-11-03T04:12:00,7000,0,0,1,1,1
2026-11-03T04:12:10,7000,75,0,1,1,1
"""


def followed(text, **told):
    lines = Lines("s", reader(told, lambda rows: rows), bool(told.get("columns")))
    found = []
    for line in text.encode().splitlines(keepends=True):
        if is_mark(line):
            found.append(lines.measurements(all_of_them=True))
        lines.add(line)
        found.append(lines.measurements())
    found.append(lines.measurements(all_of_them=True))
    return lines, [rows for rows in found if rows is not None]


@pytest.mark.parametrize("text", [TDM + "DATA_STOP\n", TABLE], ids=["TDM", "table"])
def test_pieces_are_the_whole(tmp_path, text):
    (tmp_path / "whole").write_text(text)
    told = {"range": "round-trip", "sigma": ["10m", "0.01deg"]} if "TDM" in text else {}
    whole = pz.read_tracking(tmp_path / "whole", **told)
    lines, found = followed(text, **told)
    pieces = concatenate(found)
    assert not lines.bad and len(found) > 1
    order = np.argsort(pieces.t + (pieces.epoch - whole.epoch), kind="stable")
    there = np.argsort(whole.t, kind="stable")
    np.testing.assert_allclose((pieces.t + (pieces.epoch - whole.epoch))[order], whole.t[there], atol=1e-9)
    kinds = [[rows.kinds[k] for k in rows.kind] for rows in (pieces, whole)]
    assert sorted(zip(pieces.value, kinds[0], pieces.sigma, strict=True)) == sorted(
        zip(whole.value, kinds[1], whole.sigma, strict=True)
    )


def test_an_angle_waits_for_its_partner_and_nothing_else_does():
    _, found = followed(TDM, sigma=["10m", "0.01deg", "range.TEN=5m"], range="round-trip")
    assert [len(rows) for rows in found] == [1, 2, 2, 1, 1] and [found[i].sigma[0] for i in (0, -1)] == [10.0, 5.0]
    assert all({"azimuth", "elevation"} <= {rows.kinds[k] for k in rows.kind} for rows in found if len(rows) == 2)


@pytest.mark.parametrize(
    ("wrong", "line", "says"),
    [("RANGE = 2026-11-03T04:12:05 nonsense", 17, "no number"), ("RNGE = 2026-11-03T04:12:05 1", 17, "no keyword of the data")],
)
def test_a_line_that_is_wrong_is_left_with_its_number(wrong, line, says):
    rows = TDM.splitlines()
    rows[16] = wrong
    lines, found = followed("\n".join(rows) + "\n", sigma=["10m", "0.01deg"], range="round-trip")
    assert [len(one) for one in found] == [1, 2, 2, 1, 1]
    (told,) = lines.bad
    assert told.startswith(f"s: line {line}: ") and says in told


def test_a_line_of_a_table_that_is_wrong_is_left_with_its_number():
    rows = TABLE.splitlines()
    rows.insert(3, "2026-11-03T04:12:05,x,0,0,1,1,1")
    lines, found = followed("\n".join(rows) + "\n")
    assert sum(len(one) for one in found) == 6 and lines.bad[0].startswith("s: line 4: ")


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("<xml/>\n", "line 1: '<xml/>': a TDM .KVN. or a table .CSV. is followed"),
        ("CCSDS_OEM_VERS = 2.0\n", "is followed"),
        ("time[UTC],wind[m]\n2026-11-03T04:12:00,1\n", "no format|no column"),
        (TDM.replace("PATH = 1,2,1", "PTH = 1,2,1"), "line 9: 'PTH' is no keyword"),
    ],
)
def test_what_is_no_stream_ends_it(text, says):
    with pytest.raises(ValueError, match=says):
        followed(text)


def test_a_table_without_a_header_is_followed_by_its_columns():
    columns = "time=1 x=2[km] y=3[km] z=4[km]"
    text = "2026-11-03T04:12:00,7000,0,0\n2026-11-03T04:12:10,7000,75,0\n"
    lines, found = followed(text, columns=columns, scale="UTC", frame="ITRF", sigma=["1m"])
    assert [len(one) for one in found] == [3, 3] and not lines.bad
