"""The commands that give the figures for outliers and starts still run, on a few seeds."""

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


def printed(*arguments):
    return subprocess.run([sys.executable, *arguments], check=True, capture_output=True, text=True, cwd=ROOT).stdout


@pytest.mark.slow
def test_outliers():
    lines = printed("benchmarks/outliers.py", "--seeds", "1").splitlines()
    ratio = {line[:22].strip(): float(line.split()[-4]) for line in lines[2:]}
    assert ratio["graph, clean"] == 1.0
    assert max(ratio[f"graph:{loss}"] for loss in ("huber", "cauchy", "tukey")) < ratio["graph"]


@pytest.mark.slow
def test_starts():
    text = printed("benchmarks/starts.py", "--truths", "5")
    assert "5 truths from the prior above 6.378e+06 m" in text
    (bank,) = [line for line in text.splitlines() if line.startswith("graph:bank")]
    assert bank.split()[1:3] == ["100.0", "%"]
    assert "the right one of two twins" in text
