"""Every example is checked, simulated and estimated, as its reader would."""

import subprocess
import sys
from pathlib import Path

import pytest

import piazzi as pz

EXAMPLES = sorted((Path(__file__).resolve().parent.parent / "examples").glob("*.toml"))
PIAZZI = str(Path(sys.executable).with_name("piazzi"))


def test_there_are_examples():
    assert EXAMPLES


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_an_example_is_sound_and_its_graph_knows_its_errors(path):
    checked = subprocess.run([PIAZZI, "scenarios", "check", str(path)], capture_output=True, text=True, timeout=60)
    assert checked.returncode == 0, checked.stderr
    problem, tracking = pz.load(path)
    estimate = pz.FactorGraph().estimate(problem, tracking)
    assert estimate.success, estimate.message
    error = estimate.mean - tracking.truth
    sigma = estimate.covariance.diagonal(axis1=1, axis2=2) ** 0.5
    assert (abs(error) < 5 * sigma).all()  # 5 sigma at every epoch and state: an honest covariance


def test_a_newcomers_problem_takes_under_30_lines():
    text = next(path for path in EXAMPLES if path.stem == "falling_probe").read_text()
    assert sum(1 for line in text.splitlines() if line.strip() and not line.startswith("#")) < 30
