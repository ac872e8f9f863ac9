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
        (["study", B612, "--vary", "x"], "study: --vary 'x': write NAME=VALUE,VALUE,..., such as lag=10,100 (see"),
        (["study", "a.npz"], "study: a.npz: a study simulates; name a scenario, not a recording"),
        (["study", "good.csv"], "study: good.csv: a study simulates; name a scenario, not a recording"),
        (["study", B612, "--figures", "file"], "file: no folder can be made there: a file is in the way"),
        (["study", B612, "--figures", "file/in/it"], "file/in/it: no folder can be made there: a file is in the way"),
        (["study", B612, "--report", "file"], "file: no folder can be made there: a file is in the way"),
        (["compare", B612, "--report", "file"], "file: no folder can be made there: a file is in the way"),
        (["demo", "-o", "file"], "file: no folder can be made there: a file is in the way"),
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


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["determine", "lageos-2", "--participant", "="], "--participant '=': write NAME=FILE"),
        (["determine", "lageos-2", "--sigma", "range=10deg"], "10deg is no sigma of range: write it as range=1m"),
        (["determine", "lageos-2", "--columns", "a=b"], "--columns says what columns of tables are: lageos-2 is none"),
        (["determine", "lageos-2", "--format", "png"], "--format is of what --figures DIR writes"),
        (["determine", "lageos-2", "--repair", "all"], "--repair 'all' is not known; exponent is"),
        (["determine", "lageos-2", "--object", "X"], "piazzi: lageos-2: no object 'X'"),
        (["determine", "lageos-2", "--forces", ""], "forces '': write default"),
        (["determine", "lageos-2", "--stations", "ilr"], "did you mean 'ilrs'?"),
        (["determine", "lageos-2", "lageos-2"], "lageos-2 and lageos-2 are both cases"),
        (["determine", "page.html"], "page.html: the file is a page (HTML)"),
        (["compare", B612, "--sigma", "1m"], f"{B612}: --sigma is for files of tracking"),
        (["compare", B612, "--title", "x"], "--title is of what --report DIR writes"),
        (["compare", B612, "--report", "none/such"], "none/such: no folder can be made there: there is no folder none"),
        (["study", B612, "--figures", ""], "'' is no folder"),
        (["ephemeris", "x.oem", "--from", "7090", "--when", "2016-02-12Z .. +1h", "--mask", "5deg"], "--mask is of passes"),
        (
            ["ephemeris", "x.oem", "--from", "7090", "--when", "2016-02-12Z .. +1h", "--passes", "--mask", "95deg"],
            "--mask is 95 deg; an elevation is from -90 to below 90 deg",
        ),
    ],
)
def test_what_would_do_nothing_or_is_of_another_kind(call, tmp_path, monkeypatch, arguments, words):
    """What can only be a mistake is refused in one line, and the tracking of the package goes by its name there."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "page.html").write_text("<!DOCTYPE html>\n<title>x</title>\n")
    assert words in call(*arguments).refused()
    assert [path.name for path in tmp_path.iterdir()] == ["page.html"]


@pytest.mark.parametrize(("option", "word"), [("--range", "two-way"), ("--time", "GPS"), ("--time", "7090=TAI")])
def test_what_a_file_says_itself_is_told(call, option, word):
    """Ranges of lasers are of the way there and back, their dates UTC, by their format: a word for it is of no use."""
    assert call("tracking", "lageos-2", option, word, "--json").said == [
        f"piazzi: {option} changes nothing: lageos-2 says it itself, or measures nothing of the kind"
    ]
