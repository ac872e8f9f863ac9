"""Positions of a receiver as a table: the same tracking, and the same orbit, as from a file of precise orbits."""

import json

import numpy as np
import pytest

import piazzi as pz
from piazzi.cli.main import main
from piazzi.determination.document import document
from piazzi.determination.sensing import measured, of_object

COLUMNS = "week=gps_week sow=gps_tow x=X[km] y=Y[km] z=Z[km]"


@pytest.fixture
def sp3(data_dir):
    return data_dir / "earth/sp3/gps_g01_g05_20150505.sp3"


@pytest.fixture
def table(sp3, tmp_path):
    """The positions of G01, every half an hour, as such a receiver writes them, the latest first."""
    rows = of_object(pz.read_tracking(sp3), "G01")
    past = np.array([rows.instant(int(k)) - pz.Epoch("1980-01-06T00:00:00 GPS") for k in range(0, len(rows), 18)])
    lines = [
        f"{t // 604800:.0f};{t % 604800:.3f};{x};{y};{z};3D"
        for t, (x, y, z) in zip(past.tolist(), (rows.value.reshape(-1, 3)[::6] / 1e3).tolist(), strict=True)
    ]
    (tmp_path / "a.csv").write_text("\n".join(["gps_week;gps_tow;X;Y;Z;mode", *lines[::-1]]) + "\n")
    return tmp_path / "a.csv"


def thinned(sp3):
    rows = of_object(pz.read_tracking(sp3), "G01")
    return rows[np.isin(rows.t, np.unique(rows.t)[::6])]


def test_a_table_is_the_same_tracking(sp3, table):
    one, other = measured(thinned(sp3)), measured(pz.read_tracking(table, columns=COLUMNS, frame="ITRF", sigma="0.1m"))
    np.testing.assert_allclose(other.tracking.row_times + (other.epoch - one.epoch), one.tracking.row_times, atol=1e-6)
    np.testing.assert_allclose(other.tracking.values, one.tracking.values, atol=1e-3)
    assert any("semicolons" in text for text in other.assumed) and any("sorted" in text for text in other.assumed)


@pytest.mark.parametrize(
    ("left", "asked"),
    [("--columns", "--columns"), ("--frame", "--frame ITRF"), ("--sigma", "x, y, z: --sigma ...m")],
)  # fmt: skip
def test_what_the_table_does_not_say_is_asked_for(table, capsys, left, asked):
    words = {"--columns": COLUMNS, "--frame": "ITRF", "--sigma": "0.1m"}
    said = [text for option, word in words.items() if option != left for text in (option, word)]
    assert main(["determine", str(table), *said]) == 2
    assert asked in capsys.readouterr().err


def test_the_table_says_its_axes_and_frame_those_of_the_answer(table):
    """Axes that a file names leave ``--frame`` to the answer; where it names none, it says them, not the answer's."""
    from piazzi.determination import determining

    told = {"columns": COLUMNS, "scale": "GPS", "sigma": "0.1m", "frame": "ITRF"}
    silent = determining.observations_of([str(table)], told)
    assert silent.segments[0].frame == "ITRF" and any("not those of the answer" in text for text in silent.assumed)
    table.write_text("# frame = ITRF\n" + table.read_text())
    named = determining.observations_of([str(table)], told | {"frame": "EME2000"})
    assert named.segments[0].frame == "ITRF" and not any("--frame" in text for text in named.assumed)


@pytest.mark.slow
def test_the_same_orbit_by_the_command(sp3, table, capsys):
    words = ["--columns", COLUMNS, "--scale", "GPS", "--frame", "ITRF", "--sigma", "0.064m", "--json"]
    assert main(["determine", str(table), *words]) in (0, 3)
    found = json.loads(capsys.readouterr().out)
    other = document(pz.determine(thinned(sp3)))
    assert any("--frame ITRF names the axes of measurements" in text for text in found["assumed"])
    assert (found["frame"], found["epoch"]) == (other["frame"], other["epoch"]) and found["determined"] == other["determined"]
    np.testing.assert_allclose(found["mean"][:3], other["mean"][:3], rtol=0, atol=1e-2)
    np.testing.assert_allclose(found["sigma"][:6], other["sigma"][:6], rtol=1e-6)
