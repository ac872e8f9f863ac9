"""The one door: what a source is, by name or by the ending of its path."""

import subprocess
import sys

import numpy as np
import pytest
from numpy.testing import assert_array_equal

import piazzi as pz
from piazzi.io import save
from piazzi.scenarios import load_scenario, show
from tests.references.drawn import same_problem, same_tracking


def test_a_scenario_is_simulated_with_its_seed():
    _, tracking = pz.load("b612-range", seed=5)
    assert same_tracking(tracking, pz.load("b612-range", seed=5)[1])
    assert not same_tracking(tracking, pz.load("b612-range", seed=6)[1])
    assert same_tracking(pz.load("b612-range")[1], pz.load("b612-range", seed=0)[1])
    assert_array_equal(tracking.times, load_scenario("b612-range").times)
    assert_array_equal(tracking.truth[0], [11, 0, 0, 10])


def test_a_file_is_a_scenario_like_one_by_name(tmp_path):
    path = tmp_path / "b612-range.toml"
    path.write_text(show("b612-range"))
    for loaded, named in zip(pz.load(path), pz.load("b612-range"), strict=True):
        assert (same_problem if isinstance(loaded, pz.Problem) else same_tracking)(loaded, named)


@pytest.mark.parametrize("name", ["a.nc", "a.csv", "A.NC"])
def test_recordings_are_told_by_their_ending(tmp_path, name):
    problem, tracking = pz.load("b612-range")
    save(tmp_path / name, problem, tracking)
    again, measured = pz.load(tmp_path / name, scenario="b612-range" if name.endswith("csv") else None)
    assert same_problem(again, problem)
    assert same_tracking(measured, tracking)


@pytest.mark.parametrize(
    ("source", "options", "says"),
    [
        ("b612-rang", {}, "did you mean 'b612-range'"),
        ("nowhere", {}, "there is no file or scenario 'nowhere'"),
        ("a.csv", {}, "name the scenario that this .csv file measures"),
        ("b612-range", {"scenario": "b612-range"}, "only a .csv file is loaded with a scenario"),
        ("a.txt", {}, "files end in .npz, .nc, .csv, .toml, not '.txt'"),
    ],
)
def test_what_cannot_be_loaded_is_told(tmp_path, monkeypatch, source, options, says):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "a.txt").write_text("hello")
    with pytest.raises(ValueError, match=says):
        pz.load(source, **options)


@pytest.mark.parametrize("name", ["none.npz", "none.nc", "none.toml", "none.csv"])
def test_missing_files_are_told(tmp_path, name):
    with pytest.raises(FileNotFoundError, match=name):
        pz.load(tmp_path / name, scenario="b612-range" if name.endswith("csv") else None)


def test_loading_a_recording_costs_a_quarter_of_a_second_and_imports_nothing_heavy(tmp_path):
    problem, _ = pz.load("satellite-bearing")
    clean = pz.Problem(
        problem.model, problem.prior, problem.process_noise, problem.stations, problem.parameters, problem.integrator
    )
    save(tmp_path / "a.npz", clean, pz.Tracking(np.arange(1441) * 15.0, np.ones(1441)))
    code = f"""
import sys, time, numpy
started = time.process_time()
from piazzi import load
load({str(tmp_path / "a.npz")!r})
heavy = ("sympy", "numba", "llvmlite", "pandas", "xarray", "h5py")
print(time.process_time() - started, *[m for m in heavy if m in sys.modules])
"""
    seconds, *heavy = min(
        (
            subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True).stdout.split()
            for _ in range(3)
        ),
        key=lambda words: float(words[0]),
    )
    assert heavy == []
    assert float(seconds) < 0.25
