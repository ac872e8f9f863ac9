"""``+ - * / @``, negation, ``v[0]`` and ``A.T`` for Numba."""

from __future__ import annotations

import operator
from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import infer, infer_getattr, intrinsic, lower_builtin, lower_getattr

from piazzi.kernels.compiler import AbstractTemplate, AttributeTemplate, infer_global
from piazzi.kernels.lanes.algebra import (
    LOOPED,
    combine,
    dot,
    get,
    join,
    looped_product,
    parts,
    scale,
    scaled_sum,
    transpose,
    widen,
    zipped,
)
from piazzi.kernels.lanes.kinds import FUSE, Matrix, Pack, Vector, element, is_element, lanes_of, wider


def _shape(ty: types.Type) -> tuple[int, ...]:
    return (ty.r, ty.n) if isinstance(ty, Matrix) else (ty.n,) if isinstance(ty, Vector) else ()


def _same(a: types.Type, c: types.Type) -> types.Type | None:
    """Type of a sum: equal shapes, in the lanes of the wider one."""
    a = c if getattr(c, "apart", False) else a
    return wider(a, max(lanes_of(a), lanes_of(c))) if _shape(a) == _shape(c) else None


def _product(a: types.Type, c: types.Type) -> types.Type | None:
    """Type of ``a * c``: an element on one side at least."""
    if not (is_element(a) or is_element(c)):
        return None
    return wider(c if is_element(a) else a, max(lanes_of(a), lanes_of(c)))


def _quotient(a: types.Type, c: types.Type) -> types.Type | None:
    return _same(a, c) if is_element(a) and is_element(c) else None


def _matmul(a: Any, c: Any) -> types.Type | None:
    if isinstance(a, Matrix) and isinstance(c, Matrix) and a.n == c.r:
        return Matrix(a.r, c.n, max(a.w, c.w))
    if max(a.w, c.w) != min(a.w, c.w):
        return None
    if isinstance(a, Matrix) and isinstance(c, Vector) and a.n == c.n:
        return Vector(a.r, a.w)
    if isinstance(a, Vector) and isinstance(c, Matrix) and a.n == c.r:
        return Vector(c.n, a.w)
    return element(a.w) if isinstance(a, Vector) and isinstance(c, Vector) and a.n == c.n else None


def _lower_times(b: Any, sig: Any, x: Any, y: Any) -> Any:
    a, c = sig.args
    if not is_element(a):
        a, c, x, y = c, a, y, x
    target = sig.return_type
    factor, other = widen(b, a, element(target.w), x), widen(b, c, target, y)
    return b.fmul(factor, other, flags=FUSE) if is_element(c) else scale(b, factor, other)


def _lower_matmul(b: Any, sig: Any, x: Any, y: Any) -> Any:
    a, c = sig.args
    if isinstance(a, Matrix) and isinstance(c, Matrix):
        x, y = widen(b, a, wider(a, sig.return_type.w), x), widen(b, c, wider(c, sig.return_type.w), y)
        if sig.return_type.r > LOOPED and sig.return_type.w == 1:
            return looped_product(b, a, x, sig.return_type, y)
        rows = parts(b, y)
        return join(b, sig.return_type, [combine(b, parts(b, row), rows) for row in parts(b, x)])
    if isinstance(a, Matrix):  # A v is a combination of the columns of A
        return combine(b, parts(b, y), parts(b, transpose(b, a, x)))
    if isinstance(c, Matrix):
        return combine(b, parts(b, x), parts(b, y))
    if isinstance(x.type, ir.VectorType):
        return dot(b, x, y)
    return dot(b, parts(b, x), parts(b, y))


def _lower_plain(name: str) -> Callable[..., Any]:
    def lower(b: Any, sig: Any, x: Any, y: Any) -> Any:
        u, v = (widen(b, have, sig.return_type, value) for have, value in zip(sig.args, (x, y), strict=True))
        return zipped(b, lambda p, q: getattr(b, name)(p, q, flags=FUSE), u, v)

    return lower


def _register(op: Any, result: Callable[..., Any], lower: Callable[..., Any]) -> None:
    @infer_global(op)
    class Template(AbstractTemplate):
        def generic(self, args: Any, kws: Any) -> Any:
            if len(args) != 2 or not any(isinstance(a, (Pack, Vector, Matrix)) for a in args):
                return None
            ty = result(*args)
            return None if ty is None else ty(*(types.float64 if isinstance(a, types.Number) else a for a in args))

    def implement(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return lower(builder, sig, *args)

    for left in (Pack, Vector, Matrix):
        lower_builtin(op, left, types.Float)(implement)
        lower_builtin(op, types.Float, left)(implement)
        for right in (Pack, Vector, Matrix):
            lower_builtin(op, left, right)(implement)


_register(operator.add, _same, _lower_plain("fadd"))
_register(operator.sub, _same, _lower_plain("fsub"))
_register(operator.truediv, _quotient, _lower_plain("fdiv"))
_register(operator.mul, _product, _lower_times)
_register(operator.matmul, _matmul, _lower_matmul)


@intrinsic
def fused(typing: Any, s: Any, x: Any, y: Any) -> Any:
    """s x + y for an element `s`, with one rounding where the processor can: the same one with lanes and without."""
    kinds = [types.float64 if isinstance(k, types.Number) else k for k in (s, x, y)]
    same = _same(kinds[1], kinds[2])
    if same is None or not is_element(s):
        return None
    result = wider(same, max(map(lanes_of, kinds)))

    def lower(context: Any, b: Any, sig: Any, args: Any) -> Any:
        factor = widen(b, kinds[0], element(lanes_of(result)), args[0])
        return scaled_sum(b, factor, *(widen(b, have, result, v) for have, v in zip(kinds[1:], args[1:], strict=True)))

    return result(*kinds), lower


@infer_global(operator.neg)
class _Negative(AbstractTemplate):
    def generic(self, args: Any, kws: Any) -> Any:
        return args[0](args[0]) if isinstance(args[0], (Pack, Vector, Matrix)) else None


def _lower_neg(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    return zipped(builder, builder.fneg, args[0])


for _kind in (Pack, Vector, Matrix):
    lower_builtin(operator.neg, _kind)(_lower_neg)


@infer
class _Entry(AbstractTemplate):
    """``v[0]``: the index is a constant in the source, because registers have no addresses."""

    key = "static_getitem"

    def generic(self, args: Any, kws: Any) -> Any:
        v, _ = args
        if isinstance(v, Matrix):
            return v.row(*args)
        return element(v.w)(*args) if isinstance(v, Vector) else None


def _lower_entry(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    return get(builder, *args)


for _kind in (Vector, Matrix):
    lower_builtin("static_getitem", _kind, types.IntegerLiteral)(_lower_entry)


@infer_getattr
class _MatrixAttributes(AttributeTemplate):
    key = Matrix

    def resolve_T(self, a: Any) -> Any:
        return Matrix(a.n, a.r, a.w)


@lower_getattr(Matrix, "T")  # type: ignore[untyped-decorator]
def _lower_transpose(context: Any, builder: Any, ty: Any, value: Any) -> Any:
    return transpose(builder, ty, value)
