"""Functions of time as pieces of polynomials of equal length, as long as a stated error allows, and as kernels read them."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np

from piazzi.arrays import Array
from piazzi.kernels.tables import padded
from piazzi.outside.evaluation import aligned, whole_registers

MOST_PIECES = 1 << 18
ROUNDING = 2e-14  # of a column's size: less is not asked for
_HEADER = 8


@dataclass(frozen=True, eq=False)
class Pieces:
    """Polynomials of equal pieces of time.

    Parameters
    ----------
    start, length : the first instant, seconds of a piece
    coefficients : (pieces, terms, columns), highest power first, in tau = -1 to 1 along a piece
    error, rate_error : (columns,), the largest found between the nodes, of values and of their time derivatives
    """

    start: float
    length: float
    coefficients: Array
    error: Array
    rate_error: Array

    @property
    def end(self) -> float:
        """The last instant."""
        return self.start + self.length * len(self.coefficients)

    @property
    def block(self) -> Array:
        """The data as kernels read them: see `piazzi.kernels.tables`."""
        pieces, terms, columns = self.coefficients.shape
        width = padded(columns)
        out = aligned(_HEADER + whole_registers(pieces * terms * width))
        out[:6] = self.start, 1.0 / self.length, pieces, self.length, _HEADER, self.end
        rows = out[_HEADER : _HEADER + pieces * terms * width].reshape(pieces, terms, width)
        rows[:, :, :columns] = self.coefficients
        out.flags.writeable = False
        return out

    def __call__(self, t: Array) -> tuple[Array, Array]:
        """Values and time derivatives, (times, columns) each; the first and last piece are continued."""
        piece = np.clip((t - self.start) / self.length, 0, len(self.coefficients) - 1).astype(int)
        tau = (2.0 * (t - self.start - piece * self.length) / self.length - 1.0)[:, None]
        value = np.zeros((len(t), self.coefficients.shape[2]))
        rate = np.zeros_like(value)
        for row in self.coefficients.transpose(1, 0, 2):
            rate = tau * rate + value
            value = tau * value + row[piece]
        return value, rate * (2.0 / self.length)


def fitted(function: Callable[[Array], Array], start: float, length: float, count: int, terms: int) -> Pieces:
    """`count` pieces of `length` through the Chebyshev nodes of each; errors are zero until they are known."""
    nodes, to_series, to_powers = _nodes(terms)
    times = start + length * (np.arange(count)[:, None] + 0.5 * (nodes + 1.0))
    values = np.asarray(function(times.ravel()), dtype=float).reshape(count, terms, -1)
    zero = np.zeros(values.shape[2])
    series = np.einsum("ij,pjc->pic", to_series, values)  # then powers: large factors meet small terms only
    return Pieces(start, length, np.einsum("ij,pjc->pic", to_powers, series), zero, zero)


def pieces_of(
    function: Callable[[Array], Array],
    first: float,
    last: float,
    error: float | Array | None = None,
    terms: int = 12,
    length: float | None = None,
) -> Pieces:
    """A function of time, ``function(times) -> (times, columns)``, as pieces of polynomials from `first` to `last`.

    Parameters
    ----------
    error : the largest, of all columns or of each; where a `length` is given, only measured
    terms : of a piece; they are part of what is compiled, so the length of pieces is what is chosen
    length : seconds of a piece; default the longest of the span's halves, quarters ... that keeps the error

    Raises
    ------
    ValueError
        Where no length keeps the error, or the function has no finite values.
    """
    if not (math.isfinite(first) and math.isfinite(last) and first < last):
        raise ValueError(f"a table from {first:g} to {last:g} s: its span must be finite, and end after it begins")
    if length is not None:
        found = fitted(function, first, length, max(math.ceil((last - first) / length - 1e-9), 1), terms)
        return _measured(found, fitted(function, first, length / 2, 2 * len(found.coefficients), terms), function)
    count, coarse = 1, fitted(function, first, last - first, 1, terms)
    while count <= MOST_PIECES:
        fine = fitted(function, first, (last - first) / (2 * count), 2 * count, terms)
        found = _measured(coarse, fine, function)
        if not np.isfinite(found.error).all():
            raise ValueError(f"a table from {first:g} to {last:g} s: the function has no finite value in it")
        size = np.abs(fine.coefficients).max(axis=(0, 1))
        if (found.error <= np.maximum(0.0 if error is None else error, ROUNDING * size)).all():
            return found
        count, coarse = 2 * count, fine
    asked, left = np.max(np.asarray(error)), np.max(found.error)
    raise ValueError(
        f"a table from {first:g} to {last:g} s: {MOST_PIECES} pieces leave an error of {left:.2g}, not {asked:.2g}"
    )


def _measured(coarse: Pieces, fine: Pieces, function: Callable[[Array], Array]) -> Pieces:
    """The coarse pieces with their errors: by the function half-way between nodes and at ends, and by the finer pieces."""
    count, terms, _ = coarse.coefficients.shape
    places = 0.5 * (1.0 - np.cos(np.pi * np.arange(terms + 1) / terms))
    times = (coarse.start + coarse.length * (np.arange(count)[:, None] + places)).ravel()
    value, rate = coarse(times)
    error = np.abs(value - np.asarray(function(times), dtype=float).reshape(value.shape)).max(axis=0)
    return Pieces(coarse.start, coarse.length, coarse.coefficients, error, np.abs(rate - fine(times)[1]).max(axis=0))


@cache
def _nodes(terms: int) -> tuple[Array, Array, Array]:
    """Chebyshev nodes, the matrix from values there to a Chebyshev series, and from that to powers, highest first."""
    order = np.arange(terms)
    angles = np.pi * (order + 0.5) / terms
    to_series = np.cos(np.outer(order, angles)) * (2.0 / terms)
    to_series[0] *= 0.5
    powers = np.zeros((terms, terms))
    for k in range(terms):
        powers[: k + 1, k] = np.polynomial.chebyshev.cheb2poly([0.0] * k + [1.0])
    return np.cos(angles), to_series, powers[::-1]
