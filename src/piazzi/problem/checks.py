"""Checks at the door: what was wrong, with the value, in one line."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import is_dataclass
from math import isfinite
from typing import Any

import numpy as np

from piazzi import arrays

Array = arrays.Array


def frozen(a: Any) -> Array:
    """A read-only copy as float64, row by row: kernels take no other order."""
    out = np.array(a, dtype=float, order="C")
    out.setflags(write=False)
    return out


def lock(value: Any) -> None:
    """Make every array in the value and in its parts read-only: copies and unpickled arrays are not."""
    if isinstance(value, np.ndarray):
        value.setflags(write=False)
    elif is_dataclass(value):
        lock(vars(value))
    elif isinstance(value, dict):
        lock(tuple(value.values()))
    elif isinstance(value, (list, tuple)):
        for part in value:
            lock(part)


class Locked:
    """A frozen dataclass whose copies can be written into as little as itself; parts that are such see to it themselves."""

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        lock([value for value in state.values() if not is_dataclass(value)])


def numeric(value: Any, what: str) -> Array:
    """A copy of the value as a float64 array, row by row; raises ValueError where it is not made of real numbers."""
    try:
        out = np.asarray(value)
        if out.dtype.kind not in "biuf":
            raise TypeError(f"it has type {out.dtype}")
        with np.errstate(over="ignore", invalid="ignore"):  # of longer doubles, and of signalling NaN
            return np.array(out, dtype=float, order="C")
    except (TypeError, ValueError) as error:
        raise ValueError(f"{what} is not made of real numbers: {error}") from None


def backwards(times: Array) -> int | None:
    """Index of the first time that is before the one before it, None where there is none."""
    down = np.flatnonzero(times[1:] < times[:-1])  # a difference may overflow
    return int(down[0]) + 1 if down.size else None


def check_span(first: float, last: float, what: str) -> None:
    """Raise ValueError where the seconds from the first of some times to the last are more than a number holds."""
    if not isfinite(float(last) - float(first)):
        raise ValueError(f"{what} is at {last:g} s, too far after {first:g} s: the interval is not finite")


def finite_vector(value: Any, n: int, what: str, names: Sequence[str]) -> Array:
    """The value as n finite numbers."""
    out = numeric(value, what).reshape(-1)
    if out.shape != (n,):
        raise ValueError(f"{what} has {out.size} values; it needs {n} ({', '.join(names)})")
    bad = np.flatnonzero(~np.isfinite(out))
    if bad.size:
        raise ValueError(f"{what} of {names[bad[0]]!r} is {out[bad[0]]}; it must be finite")
    return frozen(out)


def covariance(value: Any, n: int, what: str, names: Sequence[str], *, definite: bool = False) -> Array:
    """The value as a symmetric, positive semidefinite (or definite) matrix (n, n); one number or n of them give a diagonal."""
    out = numeric(value, what)
    if out.ndim == 0 and n == 1:
        out = out.reshape(1, 1)
    if out.ndim == 1 and out.shape == (n,):
        out = np.diag(out)
    if out.shape != (n, n):
        raise ValueError(f"{what} has shape {out.shape}; it must be ({n}, {n}) ({', '.join(names)})")
    bad = np.argwhere(~np.isfinite(out))
    if bad.size:
        i, j = bad[0]
        raise ValueError(f"{what} has {out[i, j]} at ({names[i]}, {names[j]}); it must be finite")
    with np.errstate(over="ignore"):  # of numbers near the largest double
        _check_symmetric(out, what, names)
        _check_definite(out, what, names, definite)
    return frozen(0.5 * out + 0.5 * out.T)


def _check_symmetric(a: Array, what: str, names: Sequence[str]) -> None:
    sigma = np.sqrt(np.abs(np.diag(a)))
    quarter = 0.25 * a  # so that sums of the largest numbers do not overflow
    scale = np.outer(0.5 * sigma, 0.5 * sigma) + np.abs(quarter) + np.abs(quarter.T)
    off = np.abs(quarter - quarter.T) > 1e-9 * scale
    if off.any():
        i, j = np.argwhere(off)[0]
        raise ValueError(
            f"{what} is not symmetric: ({names[i]}, {names[j]}) is {a[i, j]:g} and ({names[j]}, {names[i]}) is {a[j, i]:g}"
        )


def _check_definite(a: Array, what: str, names: Sequence[str], definite: bool) -> None:
    word = "definite" if definite else "semidefinite"
    d = np.diag(a)
    bad = np.flatnonzero(d <= 0 if definite else d < 0)
    if bad.size:
        name = names[bad[0]]
        raise ValueError(f"{what} must be positive {word}: the variance of {name!r} is {d[bad[0]]:g}")
    sigma = np.sqrt(d)
    flat = np.argwhere((np.outer(sigma, sigma) == 0) & (a != 0))
    if flat.size:
        i, j = flat[0]
        raise ValueError(f"{what} must be positive {word}: ({names[i]}, {names[j]}) is {a[i, j]:g} beside a zero variance")
    unit = np.where(sigma > 0, sigma, 1.0)
    lowest = np.linalg.eigvalsh(a / np.outer(unit, unit)).min()
    if lowest < -1e-9 or (definite and lowest < 1e-14):
        raise ValueError(f"{what} must be positive {word}: the smallest eigenvalue of its correlations is {lowest:.3g}")
