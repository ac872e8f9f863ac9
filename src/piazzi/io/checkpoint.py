"""Where a live estimate stands, in a file that is always whole: arrays only, never pickled, for one problem only."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from piazzi.io.archive import read_arrays
from piazzi.io.npz import write_arrays
from piazzi.problem import Problem
from piazzi.problem.checks import Array
from piazzi.text import spelled

MARK = "piazzi_checkpoint"
_COUNTS, _DIGESTS = ("lines", "written"), ("consumed", "opening")
_DIGEST_BYTES = hashlib.sha256().digest_size
_MOST = 2**62


def fingerprint(problem: Problem, estimator: object) -> Array:
    """Digest of a problem and an estimator's settings as numbers: a checkpoint fits only what it was made with."""
    given = np.append(problem.given, problem.given_bundle.manoeuvres) if problem.manoeuvres else problem.given
    arrays = (problem.mean, problem.covariance, problem.process_noise.covariance, given, problem.station_noise)
    numbers = b"".join(np.ascontiguousarray(a).tobytes() for a in (*arrays, problem.station_numbers))
    noise = problem.process_noise
    kind = (noise.per, noise.method, noise.axes)
    words = spelled(
        (problem.model, problem.integrator, problem.prior_time, [s.name for s in problem.stations], kind, estimator)
    )
    if problem.epoch is not None:  # those without one keep the digest that they had
        words += problem.epoch.exact()
    words += "".join(f"{name} {checksum}" for name, checksum in problem.checksums.items())
    digest = hashlib.sha256(numbers + words.encode()).digest()
    return np.frombuffer(digest, dtype=np.uint8).astype(float)


@dataclass(frozen=True)
class Progress:
    """How far a stream has been followed.

    Attributes
    ----------
    lines, written : lines that were read, and bytes of estimates that were written
    consumed, opening : SHA-256 of those lines, and of the first two with anything in them; empty before there are two
    """

    lines: int
    written: int
    consumed: bytes
    opening: bytes


def write_checkpoint(path: str | os.PathLike[str], mark: Array, session: Mapping[str, Array], progress: Progress) -> None:
    """Write a session's arrays and the progress of its stream, all or nothing; raises OSError."""
    arrays = {MARK: mark} | {"session_" + name: value for name, value in session.items()}
    for name in _COUNTS:
        arrays["progress_" + name] = np.asarray(getattr(progress, name))
    for name in _DIGESTS:
        arrays["progress_" + name] = np.frombuffer(getattr(progress, name), dtype=np.uint8)
    write_arrays(path, arrays)


def read_checkpoint(path: str | os.PathLike[str], mark: Array, names: Iterable[str]) -> tuple[dict[str, Array], Progress]:
    """Arrays of the session, of these names and not looked at any further, and the progress of its stream.

    Raises
    ------
    OSError
        Where the file cannot be read.
    ValueError
        Where it is no checkpoint, is damaged, or was made with another problem or estimator.
    """
    own = [MARK, *("progress_" + name for name in (*_COUNTS, *_DIGESTS))]
    arrays = read_arrays(path, [*own, *("session_" + name for name in names)], own)
    if arrays[MARK].shape != mark.shape or not np.array_equal(arrays[MARK], mark):
        raise ValueError(f"{os.fspath(path)}: the checkpoint was made with another problem or estimator")
    try:
        progress = Progress(
            _count("lines", arrays), _count("written", arrays), _digest("consumed", arrays), _digest("opening", arrays)
        )
    except ValueError as error:
        raise ValueError(f"{os.fspath(path)}: {error}") from None
    prefix = "session_"
    return {name.removeprefix(prefix): value for name, value in arrays.items() if name.startswith(prefix)}, progress


def _count(name: str, arrays: Mapping[str, Array]) -> int:
    value = arrays["progress_" + name]
    if value.shape != () or not (0 <= value <= _MOST and value == np.round(value)):
        shown = f"{value:g}" if value.shape == () else f"an array of shape {value.shape}"
        raise ValueError(f"the checkpoint's progress {name!r} is {shown}; it must be a whole number, not below zero")
    return int(value)


def _digest(name: str, arrays: Mapping[str, Array]) -> bytes:
    value = arrays["progress_" + name]
    if value.dtype != np.uint8 or value.shape not in ((_DIGEST_BYTES,), (0,)):
        raise ValueError(f"the checkpoint's progress {name!r} has shape {value.shape} and type {value.dtype}; it is no digest")
    return value.tobytes()
