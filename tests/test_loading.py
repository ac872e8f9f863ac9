"""The one door: what a source is, by name or by the ending of its path."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_array_equal

import piazzi as pz
from piazzi.io import save
from piazzi.scenarios import load_scenario, show
from tests.references.drawn import same_problem, same_tracking

ROOT = Path(__file__).resolve().parents[1]


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


def test_loading_a_recording_costs_little_and_imports_nothing_heavy(tmp_path):
    problem, _ = pz.load("satellite-bearing")
    clean = pz.Problem(
        problem.model, problem.prior, problem.process_noise, problem.stations, problem.parameters, problem.integrator
    )
    save(tmp_path / "a.npz", clean, pz.Tracking(np.arange(1441) * 15.0, np.ones(1441)))
    code = f"""
import sys, numpy
from tests.waiting import little
def once():
    for name in [name for name in sys.modules if name.partition(".")[0] == "piazzi"]:
        del sys.modules[name]
    from piazzi import load
    load({str(tmp_path / "a.npz")!r})
little(once, 0.5)  # half of it when measured
heavy = ("sympy", "numba", "llvmlite", "pandas", "xarray", "h5py")
print(*[m for m in heavy if m in sys.modules])
"""
    done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True, cwd=ROOT)
    assert done.stdout.split() == []


class TestWhereThePriorStands:
    """At the start of a scenario's times, whatever the recording; the oracle is the same problem with its prior time given."""

    SPRING = """
        states = { x = "length", v = "length/time" }
        dynamics = { x = "v", v = "-0.5*x - 0.1*v" }
        sensors.ruler.components.position = { equation = "x", unit = "length" }
        stations = [{ name = "wall", sensor = "ruler", noise = { sigma = 0.1 } }]
        process_noise = { variance = { v = NOISE } }
        integrator = { method = "rk8", max_step = 0.1 }
        times = { start = START, step = 0.5, count = 20 }
        prior = { PRIOR mean = [1.0, 0.2], sigma = [0.3, 0.3] }
    """

    def load(self, tmp_path, begins, prior="", start="4.0", noise="1e-7"):
        text = self.SPRING.replace("START", start).replace("PRIOR", prior).replace("NOISE", noise)
        (tmp_path / "spring.toml").write_text(text)
        times = begins + 0.25 * np.arange(12)
        rows = [f"{float(t)!r},{float(z)!r}" for t, z in zip(times, np.cos(times), strict=True)]
        (tmp_path / "rows.csv").write_text("\n".join(["time,position", *rows]) + "\n")
        return pz.load(tmp_path / "rows.csv", scenario=tmp_path / "spring.toml")

    @pytest.mark.parametrize("begins", [4.0, 9.75])
    @pytest.mark.parametrize("estimator", [pz.ExtendedKalmanFilter(), pz.FactorGraph()])
    def test_recordings_that_begin_with_it_or_later(self, tmp_path, begins, estimator):
        default = estimator.estimate(*self.load(tmp_path, begins))
        given = estimator.estimate(*self.load(tmp_path, begins, "time = 4.0,", start="6.0"))
        assert_array_equal(default.mean, given.mean)
        assert_array_equal(default.covariance, given.covariance)
        at_first = estimator.estimate(*self.load(tmp_path, begins, 'time = "first",'))
        assert np.array_equal(at_first.mean, given.mean) == (begins == 4.0)

    def test_a_recording_that_begins_earlier(self, tmp_path):
        """The mean runs back along the motion, by the matrix exponential; and forward again it is the prior."""
        problem, tracking = self.load(tmp_path, 1.0)
        assert problem.prior_time == tracking.times[0] == 1.0
        F = np.array([[0, 1], [-0.5, -0.1]])
        values, vectors = np.linalg.eig(F)
        back = (vectors @ np.diag(np.exp(-3.0 * values)) @ np.linalg.inv(vectors)).real
        np.testing.assert_allclose(problem.prior.mean, back @ [1.0, 0.2], rtol=0, atol=1e-10)
        forward = pz.predict(problem, problem.prior, 1.0, 3.0)
        np.testing.assert_allclose(forward.mean, [1.0, 0.2], rtol=0, atol=1e-10)
        np.testing.assert_allclose(forward.covariance, 0.09 * np.eye(2) + 2 * forward.Q, rtol=0, atol=1e-12)

    def test_the_first_measurement_whenever_it_is(self, tmp_path):
        problem, tracking = self.load(tmp_path, -7.0, 'time = "first",')
        assert problem.prior_time is None
        assert problem.prior_start(tracking.times) == -7.0

    def test_one_that_is_too_early_for_the_noise_is_refused_with_its_file(self, tmp_path):
        with pytest.raises(ValueError, match=r"rows.csv: the prior at 4 s cannot be propagated back .* process noise"):
            self.load(tmp_path, 1.0, noise="1e-2")
        with pytest.raises(ValueError, match=r"rows.csv: the prior at 4 s cannot be propagated back .* no state was found"):
            self.load(tmp_path, -1e5)

    def test_simulation_starts_there(self):
        assert pz.load("b612-range")[0].prior_time == load_scenario("b612-range").times[0]
