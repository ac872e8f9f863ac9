"""Data that are used: found by content in the folders of the user, and what their age costs."""

import shutil
from pathlib import Path

import numpy as np
import pytest

from piazzi.earth import Epoch, finding, inventory
from piazzi.earth.eop import joined, mjd_text, read_eop, tables
from tests.earth.test_space_weather import HEADER, OCTOBER_1957


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """The only folder of data: no test sees those of whoever runs it."""
    place = tmp_path / "earth"
    place.mkdir()
    monkeypatch.setenv("PIAZZI_EARTH", str(place))
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "none"))
    monkeypatch.setattr(finding, "_given", [])
    tables.cache_clear()
    yield place
    tables.cache_clear()


def later(path: Path, days: int) -> None:
    """The package's finals2000A with so many predicted days said to be measured."""
    import astropy_iers_data as package

    lines = Path(package.IERS_A_FILE).read_text().splitlines()
    first = next(i for i, line in enumerate(lines) if line[57:58] == "P")
    for i in range(first, first + days):
        lines[i] = lines[i][:57] + "I" + lines[i][58:]
    path.write_text("\n".join(lines) + "\n")


def test_files_are_told_by_content(folder, data_dir):
    import astropy_iers_data as package

    files = {
        package.IERS_A_FILE: "eop", package.IERS_B_FILE: "eop", data_dir / "earth/lageos2/ecc_une.snx": "stations",
        data_dir / "earth/gravity/JGM3.gfc": "field", data_dir / "earth/lageos2/lageos2_20160214.npt": None,
        data_dir / "earth/ceres-1801/earth_heliocentric_de440.csv": None, data_dir / "earth/ceres-1801": None,
    }  # fmt: skip
    for path, kind in files.items():
        assert finding.recognise(path) == kind, path
    (folder / "a").write_text(f"{HEADER}\n")
    (folder / "b").write_text("DATATYPE CssiSpaceWeather\nVERSION 1.2\n")
    (folder / "c").write_bytes(b"DAF/SPK " + bytes(2000))
    (folder / "d").write_text('# mine\n[[stations]]\nname = "x"\n')
    (folder / "e").write_bytes(bytes(range(256)) * 10)
    assert [finding.recognise(folder / x) for x in "abcde"] == ["weather", "weather", "kernel", "stations", None]
    assert [p.name for p in finding.found("weather")] == ["a", "b"]


def test_folders_in_their_order(folder, tmp_path, monkeypatch):
    other = tmp_path / "given"
    other.mkdir()
    finding.use_data(other)
    assert finding.data_folders() == [other, folder, tmp_path / "none" / "piazzi"]
    shutil.copy(_weather(tmp_path / "w"), other / "z.csv")
    shutil.copy(tmp_path / "w", folder / "a.csv")
    assert [p.parent for p in finding.found("weather")] == [other, folder]
    with pytest.raises(OSError, match="nowhere"):
        finding.use_data(tmp_path / "nowhere")


def _weather(path):
    path.write_text(f"{HEADER}\n{OCTOBER_1957}")
    return path


def test_orientation_that_is_newer_is_used(folder):
    before = tables()
    later(folder / "finals.txt", 20)
    tables.cache_clear()
    after = tables()
    assert after.measured == before.measured + 20.0 and "finals.txt" in after.source
    assert np.all(np.diff(after.mjd) == 1.0) and len(after.mjd) == len(before.mjd)
    np.testing.assert_array_equal(after.daily_ut1_tai, before.daily_ut1_tai)  # the values are the same here


def test_a_joined_table_has_the_first_to_its_last_measured_day():
    import astropy_iers_data as package

    first, second = read_eop(package.IERS_B_FILE), read_eop(package.IERS_A_FILE)
    both = joined(first, second)
    at = int(first.mjd[-1] - first.mjd[0])
    assert both.daily_ut1_tai[at] == first.daily_ut1_tai[-1]
    assert both.daily_ut1_tai[at + 1] == second.daily_ut1_tai[int(first.mjd[-1] + 1 - second.mjd[0])]


def test_what_is_used_and_what_its_age_costs(folder):
    measured = tables().measured
    entries = {e.kind: e for e in inventory.inventory(Epoch.from_jd(2400000.5 + measured + 30.0, 0.5, "UTC"))}
    assert list(entries) == ["eop", "leap seconds", "weather", "kernel", "stations", "field"]
    assert entries["eop"].predicted == mjd_text(measured + 1.0) and "30 days ago: 1.5 m" in entries["eop"].cost
    assert entries["weather"].file == entries["kernel"].file == "" and entries["weather"].address.startswith(
        "https://celestrak"
    )
    far = inventory.inventory(Epoch.from_jd(2400000.5 + measured + 3000.0, 0.5, "UTC"))
    assert "ended" in far[0].cost and "moves dates in UTC by 1 s" in far[1].cost
    _weather(folder / "sw.csv")
    found = {e.kind: e for e in inventory.inventory()}["weather"]
    assert (found.file, found.last, found.predicted) == (str(folder / "sw.csv"), "1957-10-05", "1957-10-06")


def test_the_error_of_predictions_is_that_of_bulletin_a():
    for days in (1.0, 10.0, 40.0):
        ut1, pole = 0.00025 * days**0.75 * 465.0, 0.00068 * days**0.80 * 30.92
        assert inventory.prediction_error(days) == pytest.approx(np.hypot(ut1, pole), rel=1e-3)
    assert inventory.prediction_error(-3.0) == 0.0
