"""Cubic splines through nodes at any distances: their slopes at the nodes, and what they are between."""

from __future__ import annotations

import numpy as np

from piazzi.arrays import Array


def slopes(x: Array, f: Array) -> Array:
    """Slopes at the nodes (n,) of the cubic splines through values (n, columns).

    The third derivative does not jump at the second node nor at the last but one ("not a knot"); through three nodes goes a
    parabola, through two a line.
    """
    n, h = len(x), np.diff(x)[:, None]
    secant = np.diff(f, axis=0) / h
    if n == 2:
        return np.repeat(secant, 2, axis=0)
    if n == 3:
        bend = (secant[1] - secant[0]) / (h[0] + h[1])
        return np.stack([secant[0] - bend * h[0], secant[0] + bend * h[0], secant[1] + bend * h[1]])
    first, last = h[0] + h[1], h[-1] + h[-2]
    below = np.concatenate([h[1:], last[None]])  # of the diagonal
    diagonal = np.concatenate([h[1][None], 2.0 * (h[:-1] + h[1:]), h[-2][None]])
    above = np.concatenate([first[None], h[:-1]])
    right = np.empty_like(f)
    right[0] = ((h[0] + 2.0 * first) * h[1] * secant[0] + h[0] ** 2 * secant[1]) / first
    right[1:-1] = 3.0 * (h[1:] * secant[:-1] + h[:-1] * secant[1:])
    right[-1] = (h[-1] ** 2 * secant[-2] + (2.0 * last + h[-1]) * h[-2] * secant[-1]) / last
    for i in range(1, n):
        factor = below[i - 1] / diagonal[i - 1]
        diagonal[i] = diagonal[i] - factor * above[i - 1]
        right[i] -= factor * right[i - 1]
    out = right
    out[-1] = right[-1] / diagonal[-1]
    for i in range(n - 2, -1, -1):
        out[i] = (right[i] - above[i] * out[i + 1]) / diagonal[i]
    return out


def between(x: Array, f: Array, d: Array, at: Array) -> tuple[Array, Array]:
    """Values and slopes (K, columns) at places within the nodes, by values and slopes (n, columns) there."""
    i = np.clip(np.searchsorted(x, at, side="right") - 1, 0, len(x) - 2)
    h = (x[i + 1] - x[i])[:, None]
    s = ((at - x[i]) / h[:, 0])[:, None]
    rise, d0, d1 = f[i + 1] - f[i], h * d[i], h * d[i + 1]
    b, c = 3.0 * rise - 2.0 * d0 - d1, d0 + d1 - 2.0 * rise
    return f[i] + s * (d0 + s * (b + s * c)), (d0 + s * (2.0 * b + 3.0 * s * c)) / h


def foretold(x: Array, f: Array) -> Array:
    """Estimated errors between the nodes, of the splines through values (n, columns) and of their slopes, (2,).

    Splines through every second node, and through every fourth, tell what they miss at those left out; how much the first
    misses less than the second is how much less again all nodes together miss: values a sixteenth at best, slopes, which are
    worst at the ends, a fourth.  NaN for few nodes.
    """
    if len(x) < 9:
        return np.full(2, np.nan)
    d = slopes(x, f)
    missed = np.array([_missed(x, f, d, step) for step in (2, 4)])
    gain = np.clip(missed[0] / np.maximum(missed[1], 1e-300), [1 / 16, 1 / 4], 1.0)
    return np.asarray(2.0 * gain * missed[0])


def _missed(x: Array, f: Array, d: Array, step: int) -> Array:
    """The most that splines through every so many nodes, and the last, miss at the others, of values and of slopes."""
    kept = np.unique([*range(0, len(x), step), len(x) - 1])
    left = np.setdiff1d(np.arange(len(x)), kept)
    own, many = slopes(x[kept], f[kept]), np.append(x, 0.5 * (x[1:] + x[:-1]))  # half-way between nodes slopes are too good
    value, slope = between(x[kept], f[kept], own, x[left])[0], between(x[kept], f[kept], own, many)[1]
    return np.array([np.abs(value - f[left]).max(), np.abs(slope - between(x, f, d, many)[1]).max()])
