"""Compiled functions of two-body motion: made once, as the kernels of every model are, and kept with them."""

from __future__ import annotations

from functools import cache
from types import SimpleNamespace

from piazzi import kernels
from piazzi.kernels import Discrete, KernelSpec
from piazzi.model import Model, Sensor


@cache
def _spec() -> KernelSpec:
    """They depend on no model; the smallest one stands in its place."""
    nothing = Model(("s",), ("0",), (Sensor("any", ["0"]),), discrete=True)
    return KernelSpec(nothing, Discrete().scheme, ("kepler", "kepler_arcs", "lambert", "lambert_paths", "gooding"), 1)


def orbit_library() -> SimpleNamespace:
    """Lambert's problem and Kepler's, of whole arrays."""
    return kernels.load(_spec())
