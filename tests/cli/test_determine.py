"""`piazzi determine` as a program: what it prints, writes and refuses."""

import json
import subprocess
import sys

import numpy as np
import pytest

import piazzi as pz
from piazzi.formats import Arc, Ephemeris, oem_text
from tests.determination.fixing import EPOCH, truth
from tests.waiting import HANGS

T = np.arange(0.0, 43200.0, 900.0)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A file of fixes with sigmas, and one with two objects."""
    here = tmp_path_factory.mktemp("determine")
    states = truth(T)
    noise = np.random.default_rng(5).standard_normal((len(T), 3))
    P = np.tile(np.diag([25.0] * 3 + [1e6] * 3), (len(T), 1, 1))
    said = {"frame": "GCRF", "centre": "EARTH", "scale": "UTC", "covariance_t": T, "covariance": P}
    said["covariance_frames"] = ("GCRF",) * len(T)
    arcs = [
        Arc(epoch=EPOCH, t=T, position=states[:, :3] + 5.0 * noise, velocity=states[:, 3:], name=name, **said)
        for name in ("SAT", "OTHER")
    ]
    (here / "one.oem").write_text(oem_text(Ephemeris(arcs=(arcs[0],))))
    (here / "two.oem").write_text(oem_text(Ephemeris(arcs=tuple(arcs))))
    return here


def program(folder, *arguments):
    return subprocess.run(
        [sys.executable, "-m", "piazzi", "determine", *arguments], cwd=folder, capture_output=True, text=True, timeout=HANGS
    )


def test_it_determines_and_writes(folder):
    done = program(
        folder, "one.oem", "-o", "next.oem", "-o", "rows.csv", "-o", "all.nc", "--span", "first .. last+1h", "--json"
    )
    assert done.returncode == 0, done.stderr
    facts = json.loads(done.stdout)
    assert facts["schema"] == "piazzi.determine/1" and facts["determined"] is True and facts["object"] == "SAT"
    arc = pz.read_ephemeris(folder / "next.oem").arcs[0]
    assert arc.instant(len(arc) - 1) - EPOCH == pytest.approx(T[-1] + 3600.0)
    assert len((folder / "rows.csv").read_text().splitlines()) == 1 + 6 * len(T)
    import xarray

    with xarray.open_dataset(folder / "all.nc", engine="h5netcdf") as data:
        assert data.sizes["measurement"] == 6 * len(T)


def test_what_is_printed_and_shown(folder):
    done = program(folder, "one.oem")
    assert done.returncode == 0 and "Seen:" in done.stdout and "Elements" in done.stdout
    shown = program(folder, "one.oem", "--show")
    assert shown.returncode == 0 and "Unknowns:" in shown.stdout and "cr_a_m" in shown.stdout


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["two.oem"], "--object"),
        (["two.oem", "--object", "NOBODY"], "no object 'NOBODY'"),
        (["missing.oem"], "No such file"),
        (["one.oem", "-o", "out.xyz"], "must end in"),
        (["one.oem", "-o", "/proc/out.oem"], "/proc/out.oem"),
        (["one.oem", "--with", "grpah"], "did you mean 'graph'"),
        (["one.oem", "--epoch", "2016-02-13T16:00:00"], "no time scale"),
        (["one.oem", "--guess", "a=-7 km e=0.1"], "'km' stands alone"),
        (["one.oem", "--guess", "a=7078km e=0.1 x=1km epoch=2016-02-13Z"], "not both"),
        (["one.oem", "--guess", "a=7078km e=0.1 i=1deg raan=0deg argp=0deg nu=0deg"], "of which date"),
        (["one.oem", "--guess", "a=-7000km e=0.1 i=1deg raan=0deg argp=0deg nu=0deg epoch=2016-02-13Z"], "no orbit"),
        (["one.oem", "--guess", "nowhere.tle"], "No such file"),
        (
            ["one.oem", "--guess", "a=9000km e=0.6 i=1deg raan=0deg argp=0deg nu=0deg epoch=2016-02-13Z"],
            "--guess: the orbit comes",
        ),
        (["one.oem", "--forces", "gravty=EGM2008"], "did you mean 'gravity'"),
        (["one.oem", "--span", "first"], "two ends"),
        (["one.oem", "--estimate", "cd"], "no unknown"),
        (["one.oem", "--mass", "-3"], "positive"),
        (["one.oem", "--each", "-o", "out.oem"], "{object}"),
        (["one.oem", "--each", "--report", "page"], "--report page: with --each the name has {object} in it"),
        (["one.oem", "--each", "--figures", "page"], "--figures page: with --each"),
        (["one.oem", "--each", "--object", "SAT"], "do not go together"),
        (["one.oem", "--figures", "one.oem"], "one.oem"),
        (["one.oem", "-o", "a.oem", "-o", "a.oem"], "given twice"),
        (["one.oem", "--span", "last .. first"], "ends before it begins"),
        (["one.oem", "--from", "2026-11-03Z"], "--prior, which is not given"),
        (["one.oem", "--follow", "--show"], "do not go together"),
        (["-"], "standard input is followed: add --follow"),
    ],
)
def test_bad_input_is_one_line_and_leaves_nothing(folder, call, monkeypatch, arguments, says):
    monkeypatch.chdir(folder)
    assert says in call("determine", *arguments).refused()
    assert not (folder / "out.oem").exists()


@pytest.mark.slow
def test_what_is_not_determined_is_written_only_anyway(folder):
    """Two fixes with a guess leave a velocity open; one without a guess leaves no orbit: the report and JSON are there."""
    text = (folder / "one.oem").read_text().splitlines(keepends=True)
    first = next(i for i, line in enumerate(text) if line.startswith("2015-"))
    (folder / "few.csv").write_text("# frame = GCRF\ntime[UTC],x[km],y[km],z[km]\n" + ",".join(text[first].split()[:4]) + "\n")
    known = ["--guess", "last.json", "--sigma", "5m"]
    assert program(folder, "one.oem", "-o", "last.json").returncode == 0
    done = program(folder, "few.csv", *known, "-o", "few.oem", "-o", "few.json", "--report", "few")
    assert done.returncode == 3 and "few.oem is not written: the orbit is not determined (--anyway writes it)" in done.stderr
    assert not (folder / "few.oem").exists() and (folder / "few" / "report.html").exists()
    assert json.loads((folder / "few.json").read_text())["determined"] is False
    assert program(folder, "few.csv", *known, "-o", "few.oem", "--anyway").returncode == 3
    assert len(pz.read_ephemeris(folder / "few.oem").arcs[0]) == 1
    done = program(folder, "few.csv", "--sigma", "5m", "-o", "none.oem", "-o", "none.json", "--report", "none")
    assert done.returncode == 3 and "none.oem is not written: there is no orbit" in done.stderr, done.stderr
    assert not (folder / "none.oem").exists() and not (folder / "none").exists()
    facts = json.loads((folder / "none.json").read_text())
    assert facts["schema"] == "piazzi.determine/1" and facts["determined"] is False and "orbits" in facts


def test_help_shows_eight_options(call):
    short, long = (call("determine", option).out for option in ("--help", "--help-all"))
    for option in ("--guess", "--stations", "--with", "--forces", "--output", "--report", "--json", "--sigma"):
        assert option in short
    assert "--anyway" not in short and "--anyway" in long


def test_each_object_has_its_line_and_file(folder):
    done = program(folder, "two.oem", "--each", "-o", "{object}.opm")
    assert done.returncode == 0, done.stderr
    assert (folder / "SAT.opm").exists() and (folder / "OTHER.opm").exists()
    assert done.stdout.count("determined") == 2
