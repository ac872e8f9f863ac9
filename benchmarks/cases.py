"""The data that benchmarks run on: the founding recording, variants of it, and long simulated runs."""

from __future__ import annotations

import os
import tempfile
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from figures import UnavailableError
from floor import Floor

import piazzi as pz

ROOT = Path(__file__).resolve().parent.parent
Case = tuple[Any, Any]


@cache
def recording() -> Path:
    """The founding recording, 1441 bearings, below PIAZZI_DATA (default ``../shared/data`` from the repository)."""
    folder = Path(os.environ.get("PIAZZI_DATA") or ROOT.parent / "shared" / "data")
    path = folder / "satellite" / "slide_example.npz"
    if not path.is_file():
        raise UnavailableError(f"no {path}; set PIAZZI_DATA")
    return path


@cache
def floor() -> Floor:
    """The C estimators on the founding recording."""
    try:
        return Floor(recording())
    except FileNotFoundError as error:
        raise UnavailableError(f"the floor needs gcc ({error})") from None


def variants(count: int, **changes: Any) -> list[Case]:
    """Problems and trackings of the recording with measurements that differ in their seventh digit, loaded from files.

    None was used before, so that what an estimator keeps between calls does not count for it.
    """
    with np.load(recording()) as file:
        original = dict(file)
    rng = np.random.default_rng(0)
    out = []
    with tempfile.TemporaryDirectory(prefix="piazzi-bench-") as folder:
        for i in range(count):
            path = Path(folder) / f"{i}.npz"
            np.savez(path, **{**original, "meas": original["meas"] + 1e-6 * rng.normal(size=original["meas"].shape)})
            problem, tracking = pz.load(path)
            out.append((replace(problem, **changes) if changes else problem, tracking))
    return out


def long_runs(epochs: int, count: int = 1) -> list[Case]:
    """The same problem over more epochs, simulated from the prior mean with different noise each time."""
    problem, tracking = pz.load(recording())
    problem = replace(problem, truth=pz.Truth(state=problem.prior.mean))
    dt = float(tracking.times[1] - tracking.times[0])
    return [(problem, pz.simulate(problem, np.arange(epochs) * dt, np.random.default_rng(seed))) for seed in range(count)]


def solved(case: Case | None = None) -> tuple[Any, Any]:
    """A chain of states linearised and solved at the solution of the full graph (default: the recording's), and its solver."""
    from piazzi.estimate.chain import Chain, CovarianceSolver
    from piazzi.estimate.factor_graph import FactorGraph
    from piazzi.problem.inputs import prepare

    problem, tracking = case or pz.load(recording())
    chain = Chain(problem, prepare(problem, tracking))
    chain.x[:] = FactorGraph().estimate(problem, tracking).mean
    chain.linearize()
    solver = CovarianceSolver(chain)
    solver.solve(0.0)
    return chain, solver


def calls(estimator: Any, cases: list[Case]) -> list[Any]:
    """One call of ``estimate`` for each case."""
    return [lambda case=case: estimator.estimate(*case) for case in cases]


def apart(mean: np.ndarray, estimate: Any) -> str:
    """How far these states (K, n) are from an estimate's at most, in its standard deviations: whether both did the same."""
    sigma = np.sqrt(np.diagonal(estimate.covariance, axis1=1, axis2=2))
    return f"{float((np.abs(mean - estimate.mean) / sigma).max()):.0e} sigma apart"
