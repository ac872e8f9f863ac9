"""`PIAZZI_JIT=0` runs the same source uncompiled and gives the same numbers, on the founding problems."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

import piazzi as pz
from tests.laws.problems import assert_same_estimate, b612, satellite

ROOT = Path(__file__).resolve().parents[2]

# Problem, time step, and how much rounding may grow: without process noise nothing of it is ever forgotten
PROBLEMS = {
    "satellite, taylor": (satellite, 15.0, 1),
    "satellite, rk4": (lambda: satellite(pz.RungeKutta4(2)), 15.0, 1),
    "b612, singular Q": (b612, 0.1, 3),
    "b612, zero Q": (lambda: b612((0.0, 0.0, 0.0, 0.0)), 0.1, 10),
}


@pytest.mark.parametrize("name", PROBLEMS)
@pytest.mark.parametrize("update", ["joint", "components"])
def test_same_numbers(monkeypatch, name, update):
    """To 1e-12 of a standard deviation."""
    make, dt, growth = PROBLEMS[name]
    problem, times = make(), np.arange(60) * dt
    compiled = pz.simulate(problem, times, np.random.default_rng(1))
    a = pz.ExtendedKalmanFilter(update).estimate(problem, compiled)
    monkeypatch.setenv("PIAZZI_JIT", "0")
    plain = pz.simulate(problem, times, np.random.default_rng(1))
    b = pz.ExtendedKalmanFilter(update).estimate(problem, compiled)
    assert_allclose(plain.truth, compiled.truth, rtol=1e-11, atol=1e-11)
    assert_allclose(plain.values, compiled.values, rtol=1e-11, atol=1e-12)
    assert_same_estimate(a, b, 1e-12 * growth)


def test_uncompiled_runs_need_no_compiler():
    """Neither Numba nor llvmlite is imported."""
    code = (
        "import sys; from tests.laws.problems import b612; import piazzi as pz, numpy as np\n"
        "pz.ExtendedKalmanFilter().estimate(b612(), pz.Tracking([0.0, 0.1], [1.0, 1.2]))\n"
        "print({'numba', 'llvmlite'} & set(sys.modules))"
    )
    env = {**os.environ, "PIAZZI_JIT": "0"}
    run = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True, env=env, cwd=ROOT)
    assert run.stdout == "set()\n"
