"""No command replaces what it reads, by whatever name it is given."""

import pytest

import piazzi as pz
from piazzi.io import save


@pytest.fixture
def recording(tmp_path):
    problem, tracking = pz.load("b612-range")
    for name in ("rec.nc", "rec.csv"):
        save(tmp_path / name, problem, tracking)
    return tmp_path


@pytest.mark.parametrize(
    "command",
    [
        ("estimate", "rec.nc", "-o", "SAME.nc"),
        ("estimate", "rec.csv", "--scenario", "b612-range", "-o", "SAME.csv"),
        ("simulate", "rec.nc", "-o", "SAME.nc"),
        ("simulate", "rec.csv", "--scenario", "b612-range", "-o", "SAME.csv"),
        ("compare", "rec.csv", "--scenario", "b612-range", "-o", "SAME.csv"),
        ("study", "rec.nc", "-o", "SAME.nc"),
    ],
)
@pytest.mark.parametrize("link", [None, "symlink_to", "hardlink_to"])
def test_a_recording_is_not_replaced_by_what_comes_of_it(recording, call, monkeypatch, command, link):
    monkeypatch.chdir(recording)
    suffix = command[-1][-4:].lstrip("E")
    source, same = recording / f"rec{suffix}", recording / f"same{suffix}"
    if link is None:
        same = source
    else:
        getattr(same, link)(source)
    before = source.read_bytes()
    line = call(*command[:-1], same).refused()
    argument = "SCENARIO" if command[0] == "study" else "SOURCE"
    assert f"-o {same} and {argument} {command[1]} are the same file" in line
    assert source.read_bytes() == before


def test_a_scenario_is_not_either(recording, call):
    (recording / "rows.csv").write_text("time,range\n")
    line = call("estimate", "-", "--scenario", recording / "rec.nc", "-o", recording / "rec.nc").refused()
    assert "are the same file" in line


def test_other_files_may_have_the_same_contents(recording, call):
    (recording / "copy.nc").write_bytes((recording / "rec.nc").read_bytes())
    assert call("simulate", recording / "rec.nc", "-o", recording / "copy.nc").status == 0
