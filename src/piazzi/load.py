"""One door for everything that holds a problem and its measurements."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np

from piazzi.problem import Problem, Tracking
from piazzi.scenarios import load_scenario
from piazzi.simulate import simulate


def load(source: str | os.PathLike[str], *, seed: int = 0, scenario: str | None = None) -> tuple[Problem, Tracking]:
    """Problem and tracking of a recording, or of a scenario simulated with `seed`.

    Parameters
    ----------
    source : name of a built-in scenario, or a path
        ``.npz`` (founding layout), ``.nc``, ``.csv`` (with `scenario`), or a scenario's ``.toml``.
    seed : int
        Of the simulation; recordings do not use it.
    scenario : name or path, optional
        The problem that a ``.csv`` measures.

    Raises
    ------
    OSError
        Where the file cannot be read.
    ValueError
        For an unknown scenario or a file with something wrong in it: what, the value, and where.
    """
    text = os.fspath(source)
    if Path(text).suffix.lower() == ".npz":
        from piazzi.io.npz import read_npz

        return read_npz(text)
    found = load_scenario(text)
    return found.problem, simulate(found.problem, found.times, np.random.default_rng(seed))
