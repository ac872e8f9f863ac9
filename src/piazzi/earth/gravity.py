"""A gravity field of any degree as a function of equations: acceleration and gradient in axes fixed to the body."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from piazzi.arrays import Array
from piazzi.earth.fields import GravityField, gravity_field
from piazzi.model.functions import Signature
from piazzi.outside.evaluation import aligned, check_count, checksum, derivatives, value
from piazzi.text import brief

SIGNATURE = Signature("gravity", 3, 3, tuple((i, j) for i in range(3) for j in range(3)))
MOST = 720  # beyond, unscaled Legendre functions and powers of the cosine of the latitude leave the range of doubles
_HEADER, _ROW, _LANES = 8, 32, 8


@dataclass(frozen=True)
class Gravity:
    """The acceleration of a gravity field at a place in axes fixed to its body, the central term included.

    Parameters
    ----------
    model : name of a field in the package, a file (.gfc or of the EGM96 layout), or a `GravityField`
    degree : of the acceleration; default as far as the field goes
    gradient_degree : of its gradient, default the same; less is cheaper where derivatives may be less exact
    on : False gives zeros, and evaluates nothing

    Raises
    ------
    ValueError
        Where there is no such field, or its degree is exceeded.
    """

    model: str | Path | GravityField = "EGM2008"
    degree: int | None = None
    gradient_degree: int | None = None
    on: bool = True
    signature: Signature = field(default=SIGNATURE, init=False, repr=False)

    __repr__ = brief

    def __post_init__(self) -> None:
        found = self.field
        highest = min(found.degree, MOST)
        degree = highest if self.degree is None else self.degree
        object.__setattr__(self, "degree", degree)
        if self.gradient_degree is None:
            object.__setattr__(self, "gradient_degree", degree)
        for name, most, what in (
            ("degree", highest, f"of {found.name} ({found.source}), which goes to {found.degree}"),
            ("gradient_degree", degree, f"beyond the field's, {degree}"),
        ):
            given = getattr(self, name)
            if isinstance(given, bool) or not isinstance(given, int) or given < 0:
                raise ValueError(f"{name} is {given!r}; it must be a whole number, 0 or more")
            if given > most:
                limit = f"; fields are summed to degree {MOST}" if name == "degree" and found.degree > MOST else ""
                raise ValueError(f"{name} {given} is asked for {what}{limit}")

    @cached_property
    def field(self) -> GravityField:
        """The coefficients, as far as they go."""
        return self.model if isinstance(self.model, GravityField) else gravity_field(self.model)

    @property
    def exact(self) -> Gravity:
        """The same whose gradient is that of its acceleration, which it is where the degrees are the same."""
        return self if self.gradient_degree == self.degree else replace(self, gradient_degree=self.degree)

    @property
    def span(self) -> None:
        """Known at any time."""
        return

    @cached_property
    def checksum(self) -> str:
        """Hash of what the data are."""
        return checksum("gravity", self.data)

    def block(self, first: float = 0.0, last: float = 0.0) -> Array:
        """The data as kernels read them, whatever the times."""
        return self.data

    @cached_property
    def data(self) -> Array:
        """The data as kernels read them: see the fragment ``function_gravity``."""
        N, f = int(self.degree or 0), self.field
        blocks = N // _LANES + 1
        sizes = [N - _LANES * b + 1 for b in range(blocks)]
        seeds_at = _HEADER + _ROW * sum(sizes)
        out = aligned(seeds_at + _LANES * _LANES * blocks)
        out[:7] = self.on, N, int(self.gradient_degree or 0), f.gm, f.radius, _HEADER, seeds_at
        a, b, first = recursion(N)
        tables = np.zeros((4, N + 1, blocks * _LANES))
        tables[:, :, : N + 1] = a, b, f.c[: N + 1, : N + 1], f.s[: N + 1, : N + 1]
        at = _HEADER
        for k, size in enumerate(sizes):
            rows = tables[:, _LANES * k :, _LANES * k : _LANES * (k + 1)].transpose(1, 0, 2)
            out[at : at + _ROW * size] = rows.ravel()
            at += _ROW * size
        orders = np.arange(N + 1)
        out[seeds_at + _LANES * orders + orders % _LANES] = first
        out.flags.writeable = False
        return out

    def value(self, *place: float) -> tuple[float, ...]:
        """The acceleration (m/s^2) at x, y, z (m)."""
        return value(SIGNATURE, self.data, *place)

    def derivatives(self, *place: float) -> Array:
        """The gradient of the acceleration, (3, 3), in 1/s^2."""
        check_count(SIGNATURE, place)
        return derivatives(SIGNATURE, self.data, *place)


def recursion(N: int) -> tuple[Array, Array, Array]:
    """Factors a and b of A_nm = a u A_(n-1)m + b A_(n-2)m, and the normalised A_mm: derivatives of Legendre polynomials."""
    n, m = np.arange(N + 1.0)[:, None], np.arange(N + 1.0)
    with np.errstate(all="ignore"):
        a = np.sqrt((2 * n + 1) * (2 * n - 1) / ((n - m) * (n + m)))
        b = -np.sqrt((2 * n + 1) * (n - m - 1) * (n + m - 1) / ((2 * n - 3) * (n + m) * (n - m)))
    first = [1.0]
    for k in range(1, N + 1):
        first.append(first[-1] * (math.sqrt(3.0) if k == 1 else math.sqrt((2 * k + 1) / (2 * k))))
    return np.where(n > m, a, 0.0), np.where(n > m + 1, b, 0.0), np.array(first)
