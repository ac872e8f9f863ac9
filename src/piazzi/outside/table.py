"""Samples over time as a function of equations: values and time derivatives by pieces of polynomials."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from piazzi.arrays import Array
from piazzi.model.functions import Signature
from piazzi.outside.evaluation import checksum, derivatives, numbers, value
from piazzi.outside.pieces import ROUNDING, Pieces, pieces_of
from piazzi.outside.samples import read_columns
from piazzi.text import brief

TERMS = 12
_POINTS = (2, 4, 6, 8, 10, 12)


@dataclass(frozen=True, eq=False)
class Table:
    """A function of time given by samples: one value or several, with their time derivatives.

    Between samples a polynomial through the nearest ones is taken, of the number (2 to 12) that foretells samples which are
    left out best; `pieces` of equal length stand for it.  Beyond its samples a table has no value.

    Parameters
    ----------
    times : (K,), seconds of the problem's `t`, ascending
    values : (K,) or (K, columns)
    error : the largest that is allowed, of all columns or of each; default what the samples allow
    terms : of a piece; part of what is compiled

    Raises
    ------
    ValueError
        Where samples are not ascending or not finite, or too far apart for the error.
    """

    times: Any
    values: Any
    error: Any = None
    terms: int = TERMS

    __repr__ = brief

    def __post_init__(self) -> None:
        t, v = numbers(self.times, "times of a table"), numbers(self.values, "values of a table")
        v = v[:, None] if v.ndim == 1 else v
        if t.ndim != 1 or v.ndim != 2 or len(t) != len(v) or len(t) < 2 or not v.shape[1]:
            raise ValueError(f"a table has two or more times and a row of values for each, not {t.shape} and {v.shape}")
        for name, a in (("times", t), ("values", v)):
            if not np.isfinite(a).all():
                row = int(np.argwhere(~np.isfinite(a))[0][0])
                raise ValueError(f"{name} of a table must be finite; row {row} is {a[row]}")
            a.flags.writeable = False
        if not (np.diff(t) > 0.0).all():
            row = int(np.argmin(np.diff(t) > 0.0)) + 1
            raise ValueError(f"times of a table must ascend; row {row} is {t[row]:.17g} after {t[row - 1]:.17g}")
        if not 2 <= self.terms <= 24:
            raise ValueError(f"a table has 2 to 24 terms in a piece, not {self.terms}")
        object.__setattr__(self, "times", t)
        object.__setattr__(self, "values", v)
        if self.error is not None:
            asked = np.broadcast_to(np.asarray(self.error, dtype=float), v.shape[1])
            if not (asked > 0.0).all():
                raise ValueError(f"error of a table is {self.error}; it must be positive")
            if (self.sample_error > asked).any():
                column = int(np.argmax(self.sample_error / asked))
                raise ValueError(
                    f"samples of column {column} of a table are too far apart for an error of {asked[column]:.2g}: "
                    f"those left out are foretold to about {self.sample_error[column]:.2g}"
                )

    def __getstate__(self) -> dict[str, Any]:
        """What it was made of: the polynomials are made again where they are wanted."""
        return {name: getattr(self, name) for name in ("times", "values", "error", "terms")}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        for name in ("times", "values"):
            state[name].flags.writeable = False

    @classmethod
    def read(cls, path: str | Path, error: Any = None, terms: int = TERMS) -> Table:
        """The table of a CSV file: times in the first column, values in the others; raises ValueError with the line."""
        rows = read_columns(Path(path))
        return cls(rows[:, 0], rows[:, 1:], error, terms)

    @cached_property
    def signature(self) -> Signature:
        """The form of the function: one argument, as many outputs as columns."""
        columns = self.values.shape[1]
        return Signature("table", 1, columns, tuple((i, 0) for i in range(columns)), self.terms)

    @property
    def span(self) -> tuple[float, float]:
        """The first and the last time."""
        return float(self.times[0]), float(self.times[-1])

    @cached_property
    def checksum(self) -> str:
        """Hash of what the data are."""
        asked = None if self.error is None else np.asarray(self.error)
        return checksum("table", self.times, self.values, asked, self.terms)

    @cached_property
    def _order(self) -> tuple[int, Array]:
        """How many samples a polynomial goes through, and the estimated errors of value and rate, by columns."""
        scale = np.abs(self.values).max(axis=0) + 1e-300
        found = [(points, sample_error(self.times, self.values, points)) for points in _POINTS if points < len(self.times)]
        best = found[0] if found else (2, np.zeros((2, self.values.shape[1])))
        for points, error in found[1:]:
            if (error[0] / scale).max() < 0.5 * (best[1][0] / scale).max():
                best = points, error
        return best

    @property
    def sample_error(self) -> Array:
        """What lies between the samples, estimated from how well those left out are foretold, by columns."""
        return np.asarray(self._order[1][0])

    @cached_property
    def pieces(self) -> Pieces:
        """The polynomials, with their errors against the curve through the samples."""
        size = ROUNDING * np.abs(self.values).max(axis=0)
        allowed = np.maximum(0.1 * self.sample_error, size)
        if self.error is not None:
            allowed = np.maximum(np.asarray(self.error) - self.sample_error, size)
        points = self._order[0]
        return pieces_of(lambda t: through_nearest(self.times, self.values, t, points), *self.span, allowed, self.terms)

    @property
    def errors(self) -> tuple[Array, Array]:
        """Estimated errors of the values, and of their time derivatives, by columns."""
        found, (between, rate) = self.pieces, self._order[1]
        rounding = 2.0 * ROUNDING * np.abs(self.values).max(axis=0)
        return found.error + between + rounding, found.rate_error + rate + 4.0 * rounding / np.diff(self.times).max()

    def block(self, first: float = 0.0, last: float = 0.0) -> Array:
        """The data as kernels read them, whatever the times."""
        return self.data

    @cached_property
    def data(self) -> Array:
        """The data as kernels read them: see `piazzi.kernels.tables`."""
        return self.pieces.block

    def value(self, *t: float) -> tuple[float, ...]:
        """The columns at `t`."""
        return value(self.signature, self.data, *self._within(*t))

    def derivatives(self, *t: float) -> Array:
        """The time derivatives of the columns at `t`, (columns, 1)."""
        return derivatives(self.signature, self.data, *self._within(*t))

    def _within(self, *t: float) -> tuple[float, ...]:
        first, last = self.span
        if len(t) == 1 and not first <= t[0] <= last:
            raise ValueError(f"t is {t[0]:.17g} s; the table goes from {first:.17g} to {last:.17g} s")
        return t


def through_nearest(times: Array, values: Array, t: Array, points: int) -> Array:
    """The polynomial through the nearest samples, as many before as behind, at each `t` (Neville)."""
    return _neville(times, values, t, _nearest(times, t, min(points, len(times))))


def _nearest(times: Array, t: Array, points: int) -> Array:
    """Which samples are taken at each `t`, (times, points)."""
    first = np.clip(np.searchsorted(times, t, side="right") - points // 2, 0, len(times) - points)
    return np.asarray(first[:, None] + np.arange(points))


def sample_error(times: Array, values: Array, points: int) -> Array:
    """Errors of polynomials through `points` samples, half-way between them, and of their rates at samples, (2, columns).

    It is c prod (t - t_i) with a c that varies little, which each sample tells that the polynomial through as many of the
    nearest others misses.
    """
    k = np.arange(len(times))
    first = np.clip(k - points // 2, 0, len(times) - points - 1)
    index = first[:, None] + np.arange(points + 1)
    others = index[index != k[:, None]].reshape(len(times), points)
    missed = np.abs(_neville(times, values, times, others) - values)
    factor = missed / np.prod(np.abs(times[:, None] - times[others]), axis=1)[:, None]
    near = np.clip(k[:-1, None] + np.arange(-1, 3), 0, len(times) - 1)  # the samples about each interval
    middle = 0.5 * (times[1:] + times[:-1])
    distances = np.prod(np.abs(middle[:, None] - times[_nearest(times, middle, points)]), axis=1)
    ends = np.stack([times[:-1], times[1:]])[:, :, None] - times[_nearest(times, middle, points)]
    slopes = np.prod(np.where(ends == 0.0, 1.0, np.abs(ends)), axis=2).max(axis=0)  # of prod (t - t_i), at samples
    return np.asarray([(factor[near].max(axis=1) * size[:, None]).max(axis=0) for size in (distances, slopes)])


def _neville(times: Array, values: Array, t: Array, index: Array) -> Array:
    x, p = times[index], values[index]
    for j in range(1, index.shape[1]):
        before, behind = x[:, :-j, None], x[:, j:, None]
        p = ((t[:, None, None] - before) * p[:, 1:] - (t[:, None, None] - behind) * p[:, :-1]) / (behind - before)
    return np.asarray(p[:, 0])
