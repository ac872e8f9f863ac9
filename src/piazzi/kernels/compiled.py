"""The vocabulary of the kernels as compiled by Numba.  Imported only while something is compiled."""

from __future__ import annotations

import math
from collections import namedtuple
from collections.abc import Callable
from math import inf, isnan, nan, pi, pow  # noqa: A004
from typing import Any

from numba import cfunc, njit, types

from piazzi.expressions.functions import TABLE as _TABLE
from piazzi.kernels.compiler import entry_options
from piazzi.kernels.lanes import (
    alike,
    by_lanes,
    ceil,
    each_lane,
    eight,
    elementary,
    fused,
    gathered,
    heaviside,
    identity,
    load_eights,
    load_lanes,
    load_matrices,
    load_matrix,
    load_packs,
    load_vector,
    matrix,
    maximum,
    minimum,
    mirrored,
    outer,
    plus_outer,
    scattered,
    scratch,
    sign,
    store,
    store_lanes,
    store_packs,
    sums_of_eight,
    unit,
    vector,
)
from piazzi.kernels.lanes.elementary import HELPER, OPTIONS
from piazzi.kernels.lanes.pieces import choose
from piazzi.kernels.plain import sizes
from piazzi.kernels.plain import unless_missing as _unless_missing

# The language's functions: our own where there is one, else the C library's
globals().update(
    {
        f.kernel: getattr(elementary, f.kernel, None) or getattr(math, f.kernel)
        for f in _TABLE.values()
        if f.kernel and not f.code and f.kernel not in globals()
    }
)
Array = types.CPointer(types.float64)
Indices = types.CPointer(types.int64)
SHARED: dict[str, Any] = {}  # what `shared` remembers of the generated modules of this process
_SCALARS = {int: types.int64, float: types.float64}


def inline(function: Callable[..., Any]) -> Any:
    """Mark a helper that disappears into its caller."""
    return njit(forceinline=True, **HELPER)(function)


def outlined(function: Callable[..., Any]) -> Any:
    """Mark a helper that is large and called from several places: it is compiled once and called."""
    return njit(forceinline=False, **HELPER)(function)  # said: what its callers are marked would hold for it too


def entry(function: Callable[..., Any]) -> Any:
    """Compile a function that Python calls, with C's calling convention; its annotations are its types."""
    kinds = [k for name, k in function.__annotations__.items() if name != "return"]
    return cfunc(types.void(*(_SCALARS.get(k, k) for k in kinds)), **entry_options(), **OPTIONS)(function)


def external(symbol: str, *kinds: Any) -> Any:
    """A function of C's calling convention that has its address when the code is loaded."""
    return types.ExternalFunction(symbol, types.void(*(_SCALARS.get(k, k) for k in kinds)))


unless_missing = inline(_unless_missing)


@inline
def store_eight(a: Any, at: Any, value: Any) -> None:
    """Write a register of eight numbers from position `at`."""
    store_packs(a, at, vector(value), 8)  # type: ignore[call-arg]


@inline
def wrap_angle(a: Any) -> Any:
    """The same angle in (-pi, pi], in every lane."""
    return a - 2.0 * pi * ceil((a - pi) / (2.0 * pi))
