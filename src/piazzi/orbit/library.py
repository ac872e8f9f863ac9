"""Compiled functions of two-body motion: made once, as the kernels of every model are, and kept with them."""

from __future__ import annotations

from functools import cache
from types import SimpleNamespace

from piazzi import kernels
from piazzi.kernels import Discrete, KernelSpec
from piazzi.model import Model, Sensor

_ARCS = ("kepler", "kepler_arcs", "lambert", "lambert_paths", "gooding")


@cache
def _spec(*fragments: str) -> KernelSpec:
    """They depend on no model; the smallest one stands in its place."""
    nothing = Model(("s",), ("0",), (Sensor("any", ["0"]),), discrete=True)
    return KernelSpec(nothing, Discrete().scheme, fragments, 1)


def orbit_library() -> SimpleNamespace:
    """Lambert's problem and Kepler's, of whole arrays."""
    return kernels.load(_spec(*_ARCS))


def fit_library() -> SimpleNamespace:
    """Two-body orbits fitted to rows of tracking."""
    return kernels.load(_spec("kepler", "two_body_fit"))
