"""The founding layout: one ``.npz`` with the numbers of a satellite-bearing problem and its measurements."""

from __future__ import annotations

import os
from math import ceil
from pathlib import Path
from typing import Any

import numpy as np

from piazzi.io.archive import read_arrays
from piazzi.kernels import Taylor
from piazzi.problem import Gaussian, Problem, ProcessNoise, Station, Tracking
from piazzi.problem.checks import Array, covariance, finite_vector, numeric
from piazzi.scenarios import load_scenario

BASE = "satellite-bearing"
REQUIRED = ("R", "Q", "dt", "meas", "x0", "P0")
MAX_SUBSTEPS = 10**9


def read_npz(path: str | os.PathLike[str]) -> tuple[Problem, Tracking]:
    """Problem and tracking of a file in the founding layout.

    Keys: R (variance, rad^2), Q (4, 4) per second, dt (s), meas (K,) bearings (rad), x0 (4,), P0 (4, 4), and truth (K, 4),
    which may be missing.  The problem is satellite-bearing with these numbers: ceil(dt) Taylor substeps, Q dt per step,
    epochs at k dt, and a measurement at every one of them.

    Raises
    ------
    OSError
        Where the file cannot be read.
    ValueError
        Where it is no such file, or holds other than finite numbers of these shapes; the message names file and key.
    """
    arrays = read_arrays(path, (*REQUIRED, "truth"), REQUIRED)
    try:
        return _problem(arrays), _tracking(arrays)
    except ValueError as error:
        raise ValueError(f"{os.fspath(path)}: {error}") from None


def _problem(arrays: dict[str, Array]) -> Problem:
    base = load_scenario(BASE).problem
    states, station = base.model.states, base.stations[0]
    mean = finite_vector(arrays["x0"], 4, "key 'x0'", states)
    P0 = covariance(arrays["P0"], 4, "key 'P0'", states)
    Q = covariance(arrays["Q"], 4, "key 'Q'", states)
    R = covariance(arrays["R"], 1, "key 'R'", ["bearing"], definite=True)
    dt = _dt(arrays)
    return Problem(
        model=base.model,
        prior=Gaussian(mean, P0),
        process_noise=ProcessNoise(Q, "second", "scaled"),
        stations=[Station(station.name, station.sensor, R)],
        parameters=base.parameters,
        integrator=Taylor(ceil(dt)),
        name=BASE,
    )


def _dt(arrays: dict[str, Array]) -> float:
    value = numeric(arrays["dt"], "key 'dt'")
    if value.size != 1 or not (np.isfinite(value).all() and value.min() > 0):
        raise ValueError(f"key 'dt' is {_shown(value)}; it must be one positive number of seconds")
    dt, epochs = float(value.reshape(-1)[0]), max(int(np.size(arrays["meas"])), 1)
    if dt * epochs > MAX_SUBSTEPS:
        raise ValueError(f"key 'dt' is {dt:g} s over {epochs} measurements: one-second substeps are too many (limit {MAX_SUBSTEPS:g})")
    return dt


def _tracking(arrays: dict[str, Array]) -> Tracking:
    meas = numeric(arrays["meas"], "key 'meas'")
    if meas.ndim > 1 and meas.size != max(meas.shape):
        raise ValueError(f"key 'meas' has shape {meas.shape}; it must be (K,), one bearing each")
    meas = meas.reshape(-1)
    truth = arrays.get("truth")
    if truth is not None and truth.shape != (len(meas), 4):
        raise ValueError(f"key 'truth' has shape {truth.shape}; it must be ({len(meas)}, 4), as there are {len(meas)} measurements")
    if np.isinf(meas).any():
        k = int(np.argmax(np.isinf(meas)))
        raise ValueError(f"key 'meas' is {meas[k]} at {k}; write NaN for a missing one")
    if np.isnan(meas).all():
        raise ValueError(f"key 'meas' has no measurements ({len(meas)} values, none a number)")
    return Tracking(np.arange(len(meas)) * _dt(arrays), meas, truth=truth)


def _shown(value: Any) -> str:
    flat = np.ravel(value)
    return f"{flat[0]:g}" if flat.size == 1 else f"an array of shape {np.shape(value)}"


def write_npz(path: str | os.PathLike[str], problem: Problem, tracking: Tracking) -> None:
    """Write a problem and its tracking in the founding layout."""
    raise NotImplementedError(Path(path))
