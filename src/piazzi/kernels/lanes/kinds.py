"""Small vectors and matrices that live in SIMD registers, as types for Numba.

A kernel is written once, over values that support ``+ - * @ .T``; compiled, they are the three types below; uncompiled,
they are NumPy arrays (`plain.py`).  ``w`` is the number of lanes, that is, of independent problems worked on at once.

=================  ====================  ==========================================
type               one problem (w = 1)   w problems
=================  ====================  ==========================================
element            float64               ``Pack(w)``, LLVM ``<w x double>``
``Vector(n, w)``   ``<n x double>``      ``[n x <w x double>]``
``Matrix(r, n)``   r such rows           r such rows
=================  ====================  ==========================================

With one problem the lanes of the machine run along a row; with w problems they run across problems.  LLVM legalises any
width, so n = 3 or 7 needs no padding here.  Products are marked ``contract``: they may fuse into one rounding.
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import models, register_model

DOUBLE, INDEX = ir.DoubleType(), ir.IntType(32)
FUSE = ("contract",)


class Pack(types.Type):
    """`w` doubles, one of each problem."""

    def __init__(self, w: int) -> None:
        self.w = w
        super().__init__(f"pack{w}")


class Vector(types.Type):
    """`n` elements of `w` lanes; `apart`, each has a register of its own even where there is one lane."""

    def __init__(self, n: int, w: int = 1, apart: bool = False) -> None:
        self.n, self.w, self.apart = n, w, apart and w == 1
        super().__init__(f"vector{n}x{w}{'apart' if self.apart else ''}")


class Matrix(types.Type):
    """`r` rows of `n` elements of `w` lanes."""

    def __init__(self, r: int, n: int, w: int = 1) -> None:
        self.r, self.n, self.w, self.row = r, n, w, Vector(n, w)
        super().__init__(f"matrix{r}x{n}x{w}")


def element(w: int) -> types.Type:
    """The type of one entry: a float, or a pack of `w` of them."""
    return types.float64 if w == 1 else Pack(w)


def llvm_type(ty: types.Type) -> ir.Type:
    """How LLVM holds a value of the type."""
    if isinstance(ty, Pack):
        return ir.VectorType(DOUBLE, ty.w)
    if isinstance(ty, Vector):
        whole = ty.w == 1 and not ty.apart
        return ir.VectorType(DOUBLE, ty.n) if whole else ir.ArrayType(llvm_type(element(ty.w)), ty.n)
    if isinstance(ty, Matrix):
        return ir.ArrayType(llvm_type(ty.row), ty.r)
    return DOUBLE


def _model(kind: type[types.Type]) -> None:
    @register_model(kind)
    class Model(models.PrimitiveModel):
        def __init__(self, manager: Any, ty: types.Type) -> None:
            super().__init__(manager, ty, llvm_type(ty))  # type: ignore[no-untyped-call]


for _kind in (Pack, Vector, Matrix):
    _model(_kind)


def lanes_of(ty: types.Type) -> int:
    """Problems worked on at once; 1 for plain numbers."""
    return getattr(ty, "w", 1)


def wider(ty: types.Type, w: int) -> types.Type:
    """The same shape in `w` lanes."""
    if isinstance(ty, Vector):
        return Vector(ty.n, w, ty.apart)
    return Matrix(ty.r, ty.n, w) if isinstance(ty, Matrix) else element(w)


def is_element(ty: types.Type) -> bool:
    """Whether the type is a number or a pack of them."""
    return isinstance(ty, (types.Number, Pack))
