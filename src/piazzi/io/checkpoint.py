"""Where a live estimate stands, in a file that is always whole: arrays only, never pickled, for one problem only."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from piazzi.io.archive import read_arrays
from piazzi.io.npz import write_arrays
from piazzi.problem import Problem
from piazzi.problem.checks import Array

MARK = "piazzi_checkpoint"


def fingerprint(problem: Problem, estimator: object) -> Array:
    """Digest of a problem and an estimator's settings as numbers: a checkpoint fits only what it was made with."""
    arrays = (problem.mean, problem.covariance, problem.process_noise.covariance, problem.given, problem.station_noise)
    numbers = b"".join(np.ascontiguousarray(a).tobytes() for a in (*arrays, problem.station_numbers))
    noise = problem.process_noise
    kind = (noise.per, noise.method, noise.axes)
    words = repr((problem.model, problem.integrator, problem.prior_time, [s.name for s in problem.stations], kind, estimator))
    digest = hashlib.sha256(numbers + words.encode()).digest()
    return np.frombuffer(digest, dtype=np.uint8).astype(float)


def write_checkpoint(
    path: str | os.PathLike[str], mark: Array, session: Mapping[str, Array], progress: Mapping[str, Any]
) -> None:
    """Write a session's arrays and the progress of its stream, all or nothing; raises OSError."""
    own = {"progress_" + k: np.asarray(v) for k, v in progress.items()}
    write_arrays(path, {MARK: mark, **{"session_" + k: v for k, v in session.items()}, **own})


def read_checkpoint(
    path: str | os.PathLike[str], mark: Array, names: Iterable[str], progress: Iterable[str]
) -> tuple[dict[str, Array], dict[str, Array]]:
    """Arrays of the session, of these names, and of the progress of its stream.

    Raises
    ------
    OSError
        Where the file cannot be read.
    ValueError
        Where it is no checkpoint, is damaged, or was made with another problem or estimator.
    """
    keys = [MARK, *("session_" + n for n in names), *("progress_" + n for n in progress)]
    arrays = read_arrays(path, keys, (MARK, *("progress_" + n for n in progress)))
    if arrays[MARK].shape != mark.shape or not np.array_equal(arrays[MARK], mark):
        raise ValueError(f"{os.fspath(path)}: the checkpoint was made with another problem or estimator")
    parts: dict[str, dict[str, Array]] = {"session": {}, "progress": {}}
    for name, value in arrays.items():
        kind, _, rest = name.partition("_")
        if kind in parts:
            parts[kind][rest] = value
    return parts["session"], parts["progress"]
