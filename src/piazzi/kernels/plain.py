"""The vocabulary of the kernels on NumPy arrays: the generated source runs on it uncompiled (`PIAZZI_JIT=0`)."""

from __future__ import annotations

from collections import namedtuple
from collections.abc import Callable
from math import inf, isnan, nan, pi
from typing import Any

import numpy as np

# NumPy's, because `math` raises where C gives NaN or infinity
from numpy import ceil
from numpy import power as pow  # noqa: A004

from piazzi.expressions.functions import TABLE as _TABLE

globals().update({f.kernel: f.on_arrays for f in _TABLE.values() if f.kernel and not f.code and not f.derived})

Array = np.ndarray[Any, Any]
Indices = np.ndarray[Any, Any]


def inline(function: Callable[..., Any]) -> Callable[..., Any]:
    """Mark a helper that disappears into its caller."""
    return function


def outlined(function: Callable[..., Any]) -> Callable[..., Any]:
    """Mark a helper that is large and called from several places."""
    return function


def entry(function: Callable[..., Any]) -> Callable[..., Any]:
    """Mark a function that Python calls."""
    return function


def sizes(**_: str) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Say how long an entry's arrays are, and which of its numbers are sizes, as bundles say it."""
    return lambda function: function


def vector(*entries: Any) -> Array:
    """The vector of these entries."""
    return np.array(entries, dtype=float)


def alike(x: Array, *entries: float) -> Array:
    """The vector of these entries, kept as `x` is."""
    return np.array(entries, dtype=float)


def scattered(x: Array) -> Array:
    """The same vector, its entries apart."""
    return x


def gathered(x: Array) -> Array:
    """The same vector in one piece."""
    return x


def matrix(*rows: Array) -> Array:
    """The matrix of these rows."""
    return np.array(rows, dtype=float)


def fused(s: float, x: Any, y: Any) -> Any:
    """s x + y."""
    return s * x + y


def outer(u: Array, v: Array) -> Array:
    """The matrix u v^T."""
    return np.outer(u, v)


def plus_outer(A: Array, u: Array, v: Array) -> Array:
    """A + u v^T."""
    return np.asarray(A + np.outer(u, v))


def mirrored(A: Array) -> Array:
    """The symmetric matrix whose upper triangle is that of A."""
    return np.triu(A) + np.triu(A, 1).T


def unit(i: int, n: int) -> Array:
    """Row `i` of the identity of size `n`, all zero where `i` is negative."""
    return np.array([1.0 if j == i else 0.0 for j in range(n)])


def identity(n: int) -> Array:
    """The identity of size `n`."""
    return np.eye(n)


def scratch(n: int) -> Array:
    """Work space of `n` numbers: not numbers yet, so that reading one too early shows."""
    return np.full(n, nan)


def load_vector(a: Array, at: int, n: int) -> Array:
    """The `n` numbers of the flat array `a` from position `at`."""
    return a[at : at + n].copy()


def load_matrix(a: Array, at: int, r: int, n: int) -> Array:
    """The `r` rows of `n` numbers of the flat array `a` from position `at`."""
    return a[at : at + r * n].reshape(r, n).copy()


def store(a: Array, at: int, value: Array) -> None:
    """Write a vector, or a matrix row by row, into the flat array `a` from position `at`."""
    a[at : at + value.size] = value.reshape(-1)


def load_lanes(a: Array, at: int, n: int, stride: int, w: int) -> Array:
    """The vector of `n` numbers at `at`: uncompiled code works on one problem at a time."""
    return load_vector(a, at, n)


def load_matrices(a: Array, at: int, r: int, n: int, stride: int, w: int) -> Array:
    """The matrix of `r` rows of `n` numbers at `at`."""
    return load_matrix(a, at, r, n)


def store_lanes(a: Array, at: int, stride: int, value: Array) -> None:
    """Write a vector or matrix from position `at`."""
    store(a, at, value)


def load_packs(a: Array, at: int, n: int, w: int) -> Array:
    """The vector of `n` numbers at `at`."""
    return load_vector(a, at, n)


def store_packs(a: Array, at: int, value: Array, w: int) -> None:
    """Write a vector or matrix from position `at`."""
    store(a, at, value)


def by_lanes(one: Callable[..., Any], several: Callable[..., Any], *arguments: Any) -> Any:
    """``one(*arguments)``: uncompiled code works on one problem at a time."""
    return one(*arguments)


def each_lane(function: Callable[..., Any], *arguments: Any) -> Any:
    """``function(*arguments)``: uncompiled code works on one problem at a time."""
    return function(*arguments)


def eight(v: Array) -> Any:
    """The entries of a vector of eight, to be worked on at once."""
    return v


def load_eights(a: Array, at: int, n: int) -> Any:
    """The `n` registers of eight consecutive numbers each from position `at`."""
    return a[at : at + 8 * n].reshape(n, 8).copy()


def store_eight(a: Array, at: int, value: Array) -> None:
    """Write a register of eight numbers from position `at`."""
    a[at : at + 8] = value


def sums_of_eight(v: Array) -> Any:
    """The sums of the rows."""
    return v.sum(axis=1)


def sign(x: float) -> float:
    """-1, 0 or 1."""
    return (x > 0.0) * 1.0 - (x < 0.0) * 1.0


def heaviside(x: float) -> float:
    """1 above zero, 0 below, 1/2 at zero: the derivative of max(x, 0)."""
    return 0.5 + 0.5 * sign(x)


def choose(x: float, y: float, yes: float, no: float) -> float:
    """`yes` where x is larger than y, else `no`."""
    return yes if x > y else no


def maximum(x: float, y: float) -> float:
    """The larger one."""
    return y if y > x else x


def minimum(x: float, y: float) -> float:
    """The smaller one."""
    return y if y < x else x


def wrap_angle(a: float) -> float:
    """The same angle in (-pi, pi]."""
    return a - 2.0 * pi * ceil((a - pi) / (2.0 * pi))  # type: ignore[no-any-return]


def unless_missing(z: float, nu: float) -> float:
    """The innovation `nu` of `z`; infinite where there is a `z` but its prediction has no value, so that the failure shows."""
    return inf if isnan(nu) and not isnan(z) else nu
