"""Cases of determinations: read, overridden, saved and run again; the problem as a scenario."""

import json
import subprocess
import sys
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import piazzi as pz
from piazzi.determination import determining
from piazzi.determination.case import Case
from piazzi.determination.case_file import split
from piazzi.earth.eop import tables
from piazzi.formats import Arc, Ephemeris, oem_text
from tests.determination.fixing import EPOCH, truth
from tests.waiting import HANGS

T = np.arange(0.0, 43200.0, 900.0)
CASE = """
title = "a night"
[determine]
forces = "default"
sigma = "5m"
with = ["graph"]
anyway = true
[object]
name = "SAT"
id = "1992-070B"
norad = 22195
mass = 405.4
area = 0.283
[product]
originator = "OBS"
frame = "EME2000"
step = "10min"
covariance_step = "1h"
interpolation = "Lagrange 9"
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Fixes without sigmas, a case beside them."""
    here = tmp_path_factory.mktemp("case")
    states = truth(T)
    noise, rough = np.random.default_rng(5).standard_normal((2, len(T), 3))
    said = {"frame": "GCRF", "centre": "EARTH", "scale": "UTC"}
    arc = Arc(epoch=EPOCH, t=T, position=states[:, :3] + 5.0 * noise, velocity=states[:, 3:] + 1e3 * rough, name="SAT", **said)
    (here / "one.oem").write_text(oem_text(Ephemeris(arcs=(arc,))))
    (here / "case.toml").write_text(CASE)
    return here


def program(folder, *arguments, name="determine"):
    return subprocess.run(
        [sys.executable, "-m", "piazzi", name, *arguments], cwd=folder, capture_output=True, text=True, timeout=HANGS
    )


def test_a_case_says_what_options_say_and_options_override_it(folder):
    done = program(
        folder, "case.toml", "one.oem", "--sigma", "1000m/s", "--sigma", "5m", "-o", "next.oem", "-o", "next.tle", "--json"
    )
    assert done.returncode == 0, done.stderr
    facts = json.loads(done.stdout)
    assert facts["object"] == "SAT"
    text = (folder / "next.oem").read_text()
    for said in ("ORIGINATOR = OBS", "OBJECT_ID = 1992-070B", "REF_FRAME = EME2000", "INTERPOLATION = LAGRANGE", "DEGREE = 9"):
        assert said in text
    arc = pz.read_ephemeris(folder / "next.oem").arcs[0]
    assert np.diff(arc.t[:-1]) == pytest.approx(600.0, abs=1e-6) and np.diff(arc.covariance_t[:-1]) == pytest.approx(3600.0)
    assert all(np.linalg.eigvalsh(P)[0] > 0 for P in arc.covariance)
    assert (folder / "next.tle").read_text().splitlines()[1].startswith("1 22195U 92070B")


@pytest.mark.slow
def test_a_saved_case_gives_the_same_bits(folder):
    first = program(folder, "one.oem", "--sigma", "1000m/s", "--sigma", "5m", "--save", "saved.toml", "-o", "first.json")
    assert first.returncode == 0, first.stderr
    saved = tomllib.loads((folder / "saved.toml").read_text())
    assert saved["determine"]["with"] == ["graph"] and saved["determine"]["forces"]["gravity"] == "EGM2008"
    assert saved["determine"]["guess"] == "none" and saved["object"]["name"] == "SAT"
    again = program(folder, "saved.toml", "one.oem", "-o", "again.json", "--save", "twice.toml")
    assert again.returncode == 0, again.stderr
    one, two = (json.loads((folder / name).read_text()) for name in ("first.json", "again.json"))
    for key in (
        "epoch",
        "names",
        "mean",
        "sigma",
        "covariance",
        "residuals",
        "rejected",
        "elements",
        "estimated",
        "iterations",
    ):
        assert one[key] == two[key], key
    twice = tomllib.loads((folder / "twice.toml").read_text())
    assert twice["determine"].pop("output") == ["again.json"] and saved["determine"].pop("output") == ["first.json"]
    assert twice == saved


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("[determine]\ngues = 'x'", "case.toml: determine.gues: unknown key; did you mean 'guess'"),
        ("[object]\nnme = 'x'", "object.nme: unknown key; did you mean 'name'"),
        ("[product]\nstep = -3", "product.step is -3; it must be positive"),
        ("[object]\nnorad = 'twelve'", "object.norad is 'twelve'; it is a whole number"),
        ("[object]\nantenna = [1, 2]", "object.antenna is [1, 2]; it must be three numbers"),
        ("[product]\ninterpolation = 'cubic'", "write Hermite, Lagrange or Linear"),
        ("[determine]\nsave = 'x.toml'", "determine.save: unknown key"),
        ("[determine]\nmass = [1]", "determine.mass"),
        ("[determine]\nwith = 5", "determine.with"),
        ("[determine]\nforces = { gravty = 'x' }", "gravty is not known"),
        ("determine = 3", "determine: must be a table"),
        ("[stations]", "is no case"),
        ("[determine", "is not TOML"),
    ],
)
def test_what_is_wrong_with_a_case_is_said_in_one_line(tmp_path, call, monkeypatch, text, says):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "case.toml").write_text(text)
    assert says in call("determine", "case.toml", "one.oem").refused()


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["case.toml"], "there is no tracking"),
        (["case.toml", "case2.toml", "one.oem"], "both cases"),
        (["one.oem", "--save", "case.txt"], "--save case.txt: the file must end in .toml"),
        (["one.oem", "--save", "nowhere/case.toml"], "no folder"),
        (["one.oem", "-o", "one.oem"], "same file"),
        (["one.oem", "-o", "a.oem", "--save", "one.oem"], "same file"),
    ],
)
def test_what_cannot_be_written_or_read_is_refused_before_the_work(folder, call, monkeypatch, arguments, says):
    monkeypatch.chdir(folder)
    (folder / "case2.toml").write_text(CASE)
    before = (folder / "one.oem").read_bytes()
    assert says in call("determine", *arguments).refused()
    assert (folder / "one.oem").read_bytes() == before


def test_a_case_of_ones_own_stands_over_that_of_the_package_whose_tracking_it_takes(tmp_path):
    """As `--save` writes one of `piazzi determine ceres-1801`."""
    (tmp_path / "own.toml").write_text('[determine]\nsigma = "7arcsec"\n')
    _, plain = split(["ceres-1801"])
    (tracking,), told = split([tmp_path / "own.toml", "ceres-1801"])
    assert Path(tracking).name == "ceres-1801.txt"
    assert told == plain.told({"sigma": "7arcsec"}) != plain


@pytest.mark.slow
def test_the_problem_is_a_scenario_that_other_commands_load(folder):
    done = program(folder, "case.toml", "one.oem", "--sigma", "1000m/s", "--sigma", "5m", "-o", "problem.toml")
    assert done.returncode == 0, done.stderr
    problem, tracking = pz.load(folder / "problem.toml", seed=1)
    assert problem.model.names[:6] == ("x", "y", "z", "vx", "vy", "vz") and len(tracking.times) == len(T)
    found = pz.determine(folder / "case.toml", folder / "one.oem", sigma=["1000m/s", "5m"])
    assert problem.mean.tolist() == found.problem.mean.tolist()
    assert problem.covariance.tolist() == found.problem.covariance.tolist()
    assert problem.checksums == found.problem.checksums and problem.model == found.problem.model
    checked = program(folder, "check", "problem.toml", name="scenarios")
    assert checked.returncode == 0, checked.stdout + checked.stderr
    compared = program(folder, "problem.toml", "--with", "graph", "--json", name="compare")
    assert compared.returncode == 0, compared.stderr
    again = program(folder, "problem.toml", "one.oem", "--json")
    assert again.returncode == 0, again.stderr
    assert json.loads(again.stdout)["mean"] == found.to_dict()["mean"]


@pytest.mark.slow
def test_a_problem_with_air_that_varies_is_a_scenario_too(tmp_path):
    """Harris and Priester's density and its process are written, and give the same bits again."""
    forces = "gravity=EGM2008 degree=2 bodies=no tides=no relativity=no radiation=no drag=harris-priester"
    state = {"position": [[6828e3, 0.0, 0.0]] * 2, "velocity": [[0.0, -970.0, 7576.0]] * 2}
    said = {"frame": "GCRF", "centre": "EARTH", "scale": "UTC", "name": "LOW"}
    start = Arc(epoch=EPOCH, t=np.array([0.0, 60.0]), **{k: np.array(v) for k, v in state.items()}, **said)
    (tmp_path / "start.oem").write_text(oem_text(Ephemeris(arcs=(start,))))
    went = program(
        tmp_path, "start.oem", "--from", EPOCH.to("UTC"), "--to", "1 day", "--step", "900s", "--forces",
        f"{forces} cd_a_m=0.02", "-o", "truth.oem", name="propagate",
    )  # fmt: skip
    assert went.returncode == 0, went.stderr
    arc = pz.read_ephemeris(tmp_path / "truth.oem").arcs[0]
    noise, rough = np.random.default_rng(5).standard_normal((2, len(arc.t), 3))
    fixes = replace(arc, position=arc.position + 5.0 * noise, velocity=arc.velocity + 1e3 * rough)
    (tmp_path / "fixes.oem").write_text(oem_text(Ephemeris(arcs=(fixes,))))
    words = ("--sigma", "5m", "--sigma", "1000m/s", "--forces", forces, "--anyway")
    done = program(tmp_path, "fixes.oem", *words, "-o", "problem.toml", "-o", "first.json")
    assert done.returncode in (0, 3) and (tmp_path / "problem.toml").exists(), done.stderr
    first = json.loads((tmp_path / "first.json").read_text())
    assert "density_8" in first["names"]
    problem, tracking = pz.load(tmp_path / "problem.toml", seed=1)
    assert len(tracking.times) == len(arc.t) and {f"air_{k}" for k in range(1, 9)} <= set(problem.model.names)
    again = program(tmp_path, "problem.toml", "fixes.oem", "-o", "again.json", "-o", "again.toml")
    assert (tmp_path / "again.json").exists(), again.stderr
    second = json.loads((tmp_path / "again.json").read_text())
    assert (second["mean"], second["covariance"]) == (first["mean"], first["covariance"])
    assert (tmp_path / "again.toml").read_text() == (tmp_path / "problem.toml").read_text()


def test_a_problem_that_files_cannot_hold_is_said_before_the_work(folder, monkeypatch):
    """Tables of the Earth's orientation that are from no file."""
    monkeypatch.setattr(determining, "ready", lambda given: pytest.fail("worked before it said what cannot be written"))
    eop = replace(tables(), source="nowhere")
    forces = pz.earth.ForceChoice(pz.earth.Forces(degree=12, radiation="cannonball"), "given", eop=eop)
    case = Case.of({"output": ["problem.toml"], "sigma": ["1000m/s", "5m"]})
    case = replace(case, forces=forces)
    with pytest.raises(ValueError, match=r"-o problem.toml: Earth orientation of 'nowhere' cannot be written to a file"):
        determining.determined([folder / "one.oem"], case)
