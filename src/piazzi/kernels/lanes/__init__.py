"""Small vectors and matrices in SIMD registers, for Numba."""

import piazzi.kernels.lanes.operators  # noqa: F401  (registers + - * @ with Numba)
from piazzi.kernels.lanes.functions import ceil, heaviside, maximum, minimum, sign
from piazzi.kernels.lanes.kinds import Matrix, Pack, Vector, element
from piazzi.kernels.lanes.memory import (
    alike,
    gathered,
    identity,
    load_lanes,
    load_matrix,
    load_packs,
    load_vector,
    matrix,
    outer,
    scattered,
    store,
    store_lanes,
    store_packs,
    unit,
    vector,
)

__all__ = [
    "Matrix",
    "Pack",
    "Vector",
    "alike",
    "ceil",
    "element",
    "gathered",
    "heaviside",
    "identity",
    "load_lanes",
    "load_matrix",
    "load_packs",
    "load_vector",
    "matrix",
    "maximum",
    "minimum",
    "outer",
    "scattered",
    "sign",
    "store",
    "store_lanes",
    "store_packs",
    "unit",
    "vector",
]
