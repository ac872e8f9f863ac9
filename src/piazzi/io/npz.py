"""The founding layout: one ``.npz`` with the numbers of a satellite-bearing problem and its measurements."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import replace
from math import ceil
from typing import TYPE_CHECKING, Any

import numpy as np

from piazzi.io.archive import read_arrays
from piazzi.io.atomic import atomic_path
from piazzi.kernels import ConstantAcceleration
from piazzi.problem import Gaussian, Problem, ProcessNoise, Station, Tracking, Truth
from piazzi.problem.checks import Array, covariance, finite_vector, numeric
from piazzi.problem.epochs import epoch_of
from piazzi.scenarios import load_scenario

if TYPE_CHECKING:
    from piazzi.earth import Epoch

BASE = "satellite-bearing"
REQUIRED = ("R", "Q", "dt", "meas", "x0", "P0")
EPOCH = "epoch_tt"
_MOST_SECONDS = 6e10  # of the years that calendars have four digits for
MAX_SUBSTEPS = 10**10


def read_npz(path: str | os.PathLike[str]) -> tuple[Problem, Tracking]:
    """Problem and tracking of a file in the founding layout.

    Keys: R (variance, rad^2), Q (4, 4) per second, dt (s), meas (K,) bearings (rad), x0 (4,), P0 (4, 4), and two that may be
    missing: truth (K, 4), and epoch_tt (2,), the instant of time zero as whole seconds of TT past J2000.0 and a fraction.
    The problem is satellite-bearing with these numbers: ceil(dt) Taylor substeps, Q dt per step, epochs at k dt, and a
    measurement at every one of them.

    Raises
    ------
    OSError
        Where the file cannot be read.
    ValueError
        Where it is no such file, or holds other than finite numbers of these shapes; the message names file and key.
    """
    arrays = read_arrays(path, (*REQUIRED, "truth", EPOCH), REQUIRED)
    try:
        epoch = _epoch(arrays)
        return replace(_problem(arrays), epoch=epoch), replace(_tracking(arrays), epoch=epoch)
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
        integrator=ConstantAcceleration(ceil(dt)),
        prior_time=0.0,
        name=BASE,
    )


def _dt(arrays: dict[str, Array]) -> float:
    value = numeric(arrays["dt"], "key 'dt'")
    if value.size != 1 or not (np.isfinite(value).all() and value.min() > 0):
        raise ValueError(f"key 'dt' is {_shown(value)}; it must be one positive number of seconds")
    dt, epochs = float(value.reshape(-1)[0]), max(int(np.size(arrays["meas"])), 1)
    if dt * epochs > MAX_SUBSTEPS:
        raise ValueError(f"key 'dt' is {dt:g} s over {epochs} epochs: too many one-second substeps (limit {MAX_SUBSTEPS:g})")
    return dt


def _tracking(arrays: dict[str, Array]) -> Tracking:
    meas = numeric(arrays["meas"], "key 'meas'")
    if meas.ndim > 1 and meas.size != max(meas.shape):
        raise ValueError(f"key 'meas' has shape {meas.shape}; it must be (K,), one bearing each")
    meas = meas.reshape(-1)
    truth = arrays.get("truth")
    if truth is not None and truth.shape != (len(meas), 4):
        raise ValueError(f"key 'truth' has shape {truth.shape}; with {len(meas)} measurements it must be ({len(meas)}, 4)")
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
    """Write a problem and its measurements in the founding layout, such that `read_npz` gives them back bit for bit.

    Raises
    ------
    OSError
        Where the file cannot be written.
    ValueError
        For anything that the layout cannot hold: it says what, and that ``.nc`` holds everything.
    """
    reason = _misfit(problem, tracking)
    if reason:
        raise ValueError(f"{os.fspath(path)}: the .npz layout cannot hold this: {reason}; .nc can")
    arrays = {
        "R": problem.stations[0].noise[0, 0], "Q": problem.process_noise.covariance, "dt": _step(problem, tracking.times),
        "meas": tracking.values[:, 0], "x0": problem.prior.mean, "P0": problem.prior.covariance,
    }  # fmt: skip
    write_arrays(path, arrays | ({} if tracking.truth is None else {"truth": tracking.truth}) | instant(problem, tracking))


def instant(problem: Problem, tracking: Tracking) -> dict[str, Array]:
    """The epoch, where there is one, as whole seconds of TT past J2000.0 and a fraction, and beside it as text."""
    epoch = epoch_of(problem, tracking)
    return {} if epoch is None else {EPOCH: np.array([epoch.whole, epoch.fraction]), "epoch": np.array(epoch.exact())}


def _epoch(arrays: dict[str, Array]) -> Epoch | None:
    if EPOCH not in arrays:
        return None
    found = arrays[EPOCH]
    if found.shape != (2,) or not (abs(found[0]) < _MOST_SECONDS and 0 <= found[1] < 1):
        raise ValueError(f"key {EPOCH!r} is {_shown(found)}; it must be whole seconds of TT past J2000.0, and a fraction")
    from piazzi.earth.epoch import Epoch

    return Epoch.at(*found.tolist())


def write_arrays(path: str | os.PathLike[str], arrays: Mapping[str, Any]) -> None:
    """Write arrays by key, whole or not at all."""
    with atomic_path(path) as work, open(work, "wb") as file:
        np.savez(file, allow_pickle=False, **{key: np.asarray(value) for key, value in arrays.items()})


def _step(problem: Problem, times: Array) -> float | None:
    """The number dt for which the epochs are k dt exactly, None where there is none."""
    if len(times) == 1:  # any number will do that makes as many substeps
        return float(getattr(problem.integrator, "substeps", None) or 1) if times[0] == 0 else None
    dt = float(times[1])
    return dt if np.array_equal(np.arange(len(times)) * dt, times) else None


def _misfit(problem: Problem, tracking: Tracking) -> str:
    """What the founding layout has no place for, "" where it has one for everything."""
    base = load_scenario(BASE).problem
    noise, dt = problem.process_noise, _step(problem, tracking.times)
    steps = ConstantAcceleration(ceil(dt or 1.0))
    faults = {
        f"its model is not that of {BASE}": problem.model != base.model or problem.parameters != base.parameters,
        "it has other than one station": len(problem.stations) != 1,
        "its process noise is not Q dt per step": (noise.per, noise.method, noise.axes) != ("second", "scaled", "states"),
        "it has manoeuvres": bool(problem.manoeuvres),
        "its prior is not at the first epoch": problem.prior_time not in (None, 0.0),
        "its epochs are not k dt": dt is None,
        "it has more than one measurement at an epoch": len(tracking.row_times) != len(tracking.times),
        f"its integrator is not {steps}": problem.integrator != steps,
        "its truth differs from its model": problem.truth is not None and not _is_plain(problem.truth),
    }
    return next((fault for fault, here in faults.items() if here), "")


def _is_plain(truth: Truth) -> bool:
    """Whether a truth half says nothing."""
    nothing = (truth.state, truth.process_noise, truth.integrator, truth.manoeuvres)
    other = truth.parameters or truth.dynamics or truth.definitions or truth.functions or truth.stations
    return all(part is None for part in nothing) and not other and truth.measurement_noise
