"""What somebody who does not know the command line gets wrong: one line with the value, and nothing computed."""

import os

import pytest

B612 = "b612-range"


@pytest.fixture
def place(tmp_path, monkeypatch):
    """A folder with what may be mistaken for something else."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "file").write_text("not a folder")
    (tmp_path / "noise.csv").write_bytes(bytes(range(255, 127, -1)))
    (tmp_path / "header.csv").write_text("time,rang\n")
    (tmp_path / "good.csv").write_text("time,range\n0.0,2.0\n")
    (tmp_path / "a.npz").write_bytes(b"PK")
    return tmp_path


@pytest.mark.parametrize(
    "command", ["compare", "windows", "observability", "study", "report", "propagate", "ephemeris", "difference"]
)
def test_tracking_of_the_package_is_no_problem_and_no_orbit_yet(call, place, command):
    more = {"ephemeris": ["--from", "7090", "--when", "tonight"], "difference": ["b.oem"], "report": ["-o", "page.html"]}
    found = call(command, "lageos-2", *more.get(command, []))
    ending = ".oem" if command in ("propagate", "ephemeris", "difference") else ".toml"
    assert (found.status, found.out) == (2, "")
    assert f"lageos-2 is tracking: piazzi determine lageos-2 -o lageos-2{ending} makes" in found.err
    assert len(found.err.splitlines()) == 1


@pytest.mark.parametrize("command", ["compare", "estimate", "windows", "observability", "report", "simulate", "study"])
@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["", "--seed", "1"], " is empty"),
        ([B612, "--seed", "abc"], "'--seed': 'abc' is not a valid whole number"),
        ([B612, "--seed", "1.5"], "'--seed': '1.5' is not a valid whole number"),
        ([B612, "--seed", "-1"], "'--seed': -1 is not in the range x>=0"),
    ],
)
def test_sources_and_seeds(call, place, command, arguments, words):
    line = call(command, *arguments).refused()
    assert words in line
    assert "sOURCE" not in line


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["windows", B612, "--iterations", "x"], "'--iterations': 'x' is not a valid whole number"),
        (["simulate", B612, "--tolerance", "x"], "'--tolerance': 'x' is not a valid number"),
        (["study", B612, "--runs", "x"], "'--runs': 'x' is not a valid whole number"),
        (["study", B612, "--vary", "x"], "study: --vary 'x': write NAME=VALUE,VALUE,... (see"),
        (["study", "a.npz"], "study: a.npz: a study simulates; name a scenario, not a recording"),
        (["study", "good.csv"], "study: good.csv: a study simulates; name a scenario, not a recording"),
        (["study", B612, "--figures", "file"], "file: no folder can be made there: a file is in the way"),
        (["study", B612, "--figures", "file/in/it"], "file/in/it: no folder can be made there: a file is in the way"),
        (["study", B612, "--report", "file"], "file: no folder can be made there: a file is in the way"),
        (["compare", B612, "--report", "file"], "file: no folder can be made there: a file is in the way"),
        (["demo", "-o", "file"], "file/satellite-bearing: no folder can be made there: a file is in the way"),
        (["compare", B612, "--with", "window:"], "nothing follows the colon; write window:LAG[xITERATIONS][:LOSS[=K]]"),
        (["estimate", B612, "--with", "ekf:"], "nothing follows the colon; write ekf"),
        (["estimate", B612, "--follow", "noise.csv"], "noise.csv: line 1: it is not UTF-8 text: byte 0xff"),
        (["estimate", B612, "--follow", "header.csv"], "header.csv: unknown column 'rang'"),
        (["estimate", B612, "--follow", os.devnull], f"{os.devnull}: there are no measurements"),
        (["estimate", B612, "--follow", "good.csv", "--checkpoint", "/proc/state.npz"], "/proc/state.npz: cannot be written: "),
    ],
)
def test_values_that_make_no_sense(call, place, arguments, words):
    before = sorted(os.listdir(place))
    assert words in call(*arguments).refused()
    assert sorted(os.listdir(place)) == before
