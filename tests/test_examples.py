"""Every example is checked, simulated and estimated, as its reader would."""

import subprocess
import sys
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

import piazzi as pz
from tests.waiting import HANGS

EXAMPLES = sorted((Path(__file__).resolve().parent.parent / "examples").glob("*.toml"))
PIAZZI = str(Path(sys.executable).with_name("piazzi"))


def test_there_are_examples():
    assert EXAMPLES


SLOW = {"ground_stations": pytest.mark.slow}  # 18 values take a minute to compile


@pytest.mark.parametrize("path", [pytest.param(p, id=p.stem, marks=SLOW.get(p.stem, ())) for p in EXAMPLES])
def test_an_example_is_sound_and_its_graph_knows_its_errors(path):
    checked = subprocess.run([PIAZZI, "scenarios", "check", str(path)], capture_output=True, text=True, timeout=HANGS)
    assert checked.returncode == 0, checked.stderr
    problem, tracking = pz.load(path)
    estimate = pz.FactorGraph().estimate(problem, tracking)
    assert estimate.success, estimate.message
    error = estimate.mean - tracking.truth
    sigma = estimate.covariance.diagonal(axis1=1, axis2=2) ** 0.5
    assert (abs(error) < 5 * sigma).all()  # 5 sigma at every epoch and state: an honest covariance


def test_a_newcomers_problem_is_pictured(tmp_path):
    """As its writer would: one command, and a page that shows what was measured and how far off the estimate is."""
    path, page = next(p for p in EXAMPLES if p.stem == "falling_probe"), tmp_path / "page.html"
    made = subprocess.run(
        [PIAZZI, "report", str(path), "--with", "graph", "-o", str(page)], capture_output=True, text=True, timeout=HANGS
    )
    assert made.returncode == 0, made.stderr
    text = page.read_text()
    assert text.count("<svg") + text.count("<canvas") > 0
    for name in ("height", "speed", "drag"):
        assert name in text


@pytest.mark.slow
def test_the_founding_papers_figures(data_dir, tmp_path):
    folder = data_dir / "satellite"
    script = Path(__file__).resolve().parent.parent / "examples" / "founding_figures.py"
    made = subprocess.run(
        [sys.executable, "-W", "error", str(script), str(folder), "-o", str(tmp_path), "--format", "svg"],
        capture_output=True, text=True, timeout=HANGS,
    )  # fmt: skip
    assert made.returncode == 0, made.stderr
    assert sorted(p.name for p in tmp_path.iterdir()) == ["accuracy_ekf.svg", "accuracy_graph.svg", "timing.svg"]


def test_a_newcomers_problem_takes_under_30_lines():
    text = next(path for path in EXAMPLES if path.stem == "falling_probe").read_text()
    assert sum(1 for line in text.splitlines() if line.strip() and not line.startswith("#")) < 30


@pytest.fixture
def ground_stations(monkeypatch):
    """The example, as a module."""
    monkeypatch.syspath_prepend(EXAMPLES[0].parent)
    return import_module("ground_stations")


@pytest.mark.slow
def test_real_tracking_of_a_satellite_by_three_ground_stations(ground_stations, data_dir):
    """Batch and graph leave the noise that the recording's authors state; filters that start close end at the same place."""
    problem, tracking = ground_stations.load(data_dir / "ground_stations" / "range_range_rate.txt")
    batch, graph = (e.estimate(problem, tracking) for e in (pz.BatchLeastSquares(), pz.FactorGraph()))
    sigma = np.sqrt(batch.covariance.diagonal(axis1=1, axis2=2))
    for estimate in (batch, graph):
        assert estimate.success, estimate.message
        assert estimate.iterations <= 6
        rms = ground_stations.residual_rms(problem, tracking, estimate)
        assert [round(rms[0], 4), round(rms[1], 5)] == [0.0097, 0.00100]
        assert (abs(estimate.mean - batch.mean) <= 1e-3 * sigma).all()
    close = ground_stations.started_from(problem, batch, 10.0)
    for estimator in (pz.ExtendedKalmanFilter(), pz.SlidingWindow(100)):
        estimate = estimator.estimate(close, tracking)
        assert estimate.success, estimate.message
        assert (abs(estimate.mean[-1] - batch.mean[-1]) <= 3 * sigma[-1]).all()


@pytest.mark.slow
def test_the_last_bits_of_real_tracking_cost_no_iterations(ground_stations, data_dir):
    """Steps that are rounding are known as such though one happens to be smaller than the one before."""
    problem, tracking = ground_stations.load(data_dir / "ground_stations" / "range_range_rate.txt")
    iterations = []
    for seed in range(12):
        bits = np.finfo(float).eps * np.random.default_rng(seed).choice([-1, 0, 1], tracking.values.shape)
        other = pz.Tracking(tracking.row_times, tracking.values * (1 + bits), tracking.row_stations)
        for estimator in (pz.BatchLeastSquares(), pz.FactorGraph()):
            estimate = estimator.estimate(problem, other)
            assert estimate.success, estimate.message
            assert estimate.details["stopped"] == "steps are rounding"
            iterations.append(estimate.iterations)
    assert np.mean(iterations) < 4.5  # single ones are up to chance
