"""Making vectors and matrices, and moving them between registers and arrays."""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from piazzi.kernels.compiler import alloca_once
from piazzi.kernels.lanes.algebra import get, join, parts, scale, scaled_sum, widen
from piazzi.kernels.lanes.kinds import DOUBLE, Matrix, Vector, element, lanes_of, llvm_type, wider


def _elements(context: Any, b: Any, kinds: Any, want: Any, given: Any) -> list[Any]:
    """The entries of a tuple of numbers and packs, in the lanes of `want`."""
    values = [get(b, given, i) for i in range(len(kinds))]
    values = [
        context.cast(b, v, k, types.float64) if isinstance(k, types.Number) else v for v, k in zip(values, kinds, strict=True)
    ]
    return [widen(b, k, want, v) for v, k in zip(values, kinds, strict=True)]


@intrinsic
def vector(typing: Any, *entries: Any) -> Any:
    """The vector of these entries."""
    kinds: Any = entries[0] if len(entries) == 1 and isinstance(entries[0], types.BaseTuple) else entries
    w = max(getattr(kind, "w", 1) for kind in kinds)
    result, want = Vector(len(kinds), w), element(w)

    def lower(context: Any, b: Any, sig: Any, args: Any) -> Any:
        return join(b, result, _elements(context, b, kinds, want, args[0]))

    return result(types.StarArgTuple(kinds)), lower


@intrinsic
def alike(typing: Any, x: Any, *entries: Any) -> Any:
    """The vector of these entries, kept in registers as `x` is."""
    kinds: Any = entries[0] if len(entries) == 1 and isinstance(entries[0], types.BaseTuple) else entries
    w = max(lanes_of(kind) for kind in (x, *kinds))
    result, want = Vector(len(kinds), w, x.apart), element(w)

    def lower(context: Any, b: Any, sig: Any, args: Any) -> Any:
        return join(b, result, _elements(context, b, kinds, want, args[1]))

    return result(x, types.StarArgTuple(kinds)), lower


@intrinsic
def scattered(typing: Any, x: Any) -> Any:
    """The same vector with every entry in a register of its own: for what is computed entry by entry, in a loop."""
    result = Vector(x.n, x.w, apart=True)
    return result(x), lambda context, b, sig, args: join(b, result, parts(b, args[0]))


@intrinsic
def gathered(typing: Any, x: Any) -> Any:
    """The same vector in one register."""
    result = Vector(x.n, x.w)
    return result(x), lambda context, b, sig, args: join(b, result, parts(b, args[0]))


@intrinsic
def matrix(typing: Any, *rows: Any) -> Any:
    """The matrix of these rows."""
    result = Matrix(len(rows), rows[0].n, max(row.w for row in rows))

    def lower(context: Any, b: Any, sig: Any, args: Any) -> Any:
        return join(b, result, [widen(b, row, result.row, get(b, args[0], i)) for i, row in enumerate(rows)])

    return result(types.StarArgTuple(rows)), lower


@intrinsic
def outer(typing: Any, u: Any, v: Any) -> Any:
    """The matrix u v^T."""
    result = Matrix(u.n, v.n, v.w)

    def lower(context: Any, b: Any, sig: Any, args: Any) -> Any:
        return join(b, result, [scale(b, s, args[1]) for s in parts(b, args[0])])

    return result(u, v), lower


@intrinsic
def plus_outer(typing: Any, A: Any, u: Any, v: Any) -> Any:
    """A + u v^T, fused: the same roundings with lanes and without, whatever else is made of u and v."""
    result = Matrix(A.r, A.n, max(A.w, v.w))
    if (A.r, A.n) != (u.n, v.n) or lanes_of(u) != lanes_of(v):
        return None

    def lower(context: Any, b: Any, sig: Any, args: Any) -> Any:
        rows = parts(b, widen(b, A, result, args[0]))
        return join(b, result, [scaled_sum(b, s, args[2], row) for s, row in zip(parts(b, args[1]), rows, strict=True)])

    return result(A, u, v), lower


@intrinsic
def mirrored(typing: Any, A: Any) -> Any:
    """The symmetric matrix whose upper triangle is that of A: nothing below it is ever computed."""

    def lower(context: Any, b: Any, sig: Any, args: Any) -> Any:
        rows = [parts(b, row) for row in parts(b, args[0])]
        whole = [[rows[min(i, j)][max(i, j)] for j in range(A.n)] for i in range(A.r)]
        return join(b, A, [join(b, A.row, row) for row in whole])

    return (A(A), lower) if A.r == A.n else None


@intrinsic(prefer_literal=True)
def unit(typing: Any, i: Any, n: Any) -> Any:
    """Row `i` of the identity of size `n` (all zero where `i` is negative)."""
    values = [1.0 if j == i.literal_value else 0.0 for j in range(n.literal_value)]

    def lower(context: Any, b: Any, sig: Any, args: Any) -> Any:
        return ir.Constant(ir.VectorType(DOUBLE, len(values)), values)

    return Vector(len(values))(i, n), lower


@intrinsic(prefer_literal=True)
def identity(typing: Any, n: Any) -> Any:
    """The identity of size `n`."""
    size = n.literal_value

    def lower(context: Any, b: Any, sig: Any, args: Any) -> Any:
        row = ir.VectorType(DOUBLE, size)
        return join(b, result, [ir.Constant(row, [1.0 if i == j else 0.0 for j in range(size)]) for i in range(size)])

    result = Matrix(size, size)
    return result(n), lower


@intrinsic(prefer_literal=True)
def scratch(typing: Any, n: Any) -> Any:
    """Work space of `n` numbers, not set, for the length of the call: what is small ends up in registers."""
    size = n.literal_value

    def lower(context: Any, b: Any, sig: Any, args: Any) -> Any:
        place = alloca_once(b, ir.ArrayType(DOUBLE, max(size, 1)))
        return b.bitcast(place, DOUBLE.as_pointer())

    return types.CPointer(types.float64)(n), lower


def _pointer(b: Any, base: Any, at: Any, register: Any) -> Any:
    return b.bitcast(b.gep(base, [at]), register.as_pointer())


@intrinsic(prefer_literal=True)
def load_vector(typing: Any, a: Any, at: Any, n: Any) -> Any:
    """The `n` numbers of the flat array `a` from position `at`."""
    result = Vector(n.literal_value)

    def lower(context: Any, b: Any, sig: Any, args: Any) -> Any:
        value = b.load(_pointer(b, args[0], args[1], llvm_type(result)))
        value.align = 8
        return value

    return result(a, types.intp, n), lower


@intrinsic(prefer_literal=True)
def load_matrix(typing: Any, a: Any, at: Any, r: Any, n: Any) -> Any:
    """The `r` rows of `n` numbers of the flat array `a` from position `at`."""
    result = Matrix(r.literal_value, n.literal_value)

    def lower(context: Any, b: Any, sig: Any, args: Any) -> Any:
        rows = []
        for i in range(result.r):
            start = b.add(args[1], ir.Constant(args[1].type, i * result.n))
            rows.append(b.load(_pointer(b, args[0], start, llvm_type(result.row))))
            rows[-1].align = 8
        return join(b, result, rows)

    return result(a, types.intp, r, n), lower


@intrinsic
def store(typing: Any, a: Any, at: Any, value: Any) -> Any:
    """Write a vector, or a matrix row by row, into the flat array `a` from position `at`; lanes take `store_lanes`."""
    if value.w > 1:
        return None

    def lower(context: Any, b: Any, sig: Any, args: Any) -> Any:
        rows = [args[2]] if isinstance(value, Vector) else parts(b, args[2])
        for i, row in enumerate(rows):
            start = b.add(args[1], ir.Constant(args[1].type, i * value.n))
            b.store(row, _pointer(b, args[0], start, row.type)).align = 8
        return context.get_dummy_value()

    return types.void(a, types.intp, value), lower


def _lane_positions(b: Any, at: Any, stride: Any, w: int, offset: int) -> list[Any]:
    """Positions of entry `offset` in the records that start at `at`, `at + stride`, ..."""
    first = b.add(at, ir.Constant(at.type, offset))
    return [b.add(first, b.mul(stride, ir.Constant(at.type, lane))) for lane in range(w)]


def _load_row(b: Any, a: Any, at: Any, stride: Any, row: Vector) -> Any:
    """A vector whose lanes are at `at`, `at + stride`, ..."""
    if row.w == 1:
        value = b.load(_pointer(b, a, at, llvm_type(row)))
        value.align = 8
        return value
    places = [_lane_positions(b, at, stride, row.w, i) for i in range(row.n)]
    return join(b, row, [join(b, element(row.w), [b.load(b.gep(a, [place])) for place in lanes]) for lanes in places])


@intrinsic(prefer_literal=True)
def load_lanes(typing: Any, a: Any, at: Any, n: Any, stride: Any, w: Any) -> Any:
    """The vectors of `n` numbers at `at`, `at + stride`, ..., one to a lane."""
    result = Vector(n.literal_value, w.literal_value)

    def lower(context: Any, b: Any, sig: Any, args: Any) -> Any:
        return _load_row(b, args[0], args[1], args[3], result)

    return result(a, types.intp, n, types.intp, w), lower


@intrinsic(prefer_literal=True)
def load_matrices(typing: Any, a: Any, at: Any, r: Any, n: Any, stride: Any, w: Any) -> Any:
    """The matrices of `r` rows of `n` numbers at `at`, `at + stride`, ..., one to a lane."""
    result = Matrix(r.literal_value, n.literal_value, w.literal_value)

    def lower(context: Any, b: Any, sig: Any, args: Any) -> Any:
        starts = [b.add(args[1], ir.Constant(args[1].type, i * result.n)) for i in range(result.r)]
        return join(b, result, [_load_row(b, args[0], start, args[4], result.row) for start in starts])

    return result(a, types.intp, r, n, types.intp, w), lower


@intrinsic
def store_lanes(typing: Any, a: Any, at: Any, stride: Any, value: Any) -> Any:
    """Write each lane's vector or matrix from position `at`, `at + stride`, ..."""

    def lower(context: Any, b: Any, sig: Any, args: Any) -> Any:
        rows = [args[3]] if isinstance(value, Vector) else parts(b, args[3])
        for i, row in enumerate(rows):
            for j, pack in enumerate(parts(b, row)):
                places = _lane_positions(b, args[1], args[2], value.w, i * value.n + j)
                lanes = parts(b, pack) if value.w > 1 else [pack]
                for place, lane in zip(places, lanes, strict=True):
                    b.store(lane, b.gep(args[0], [place]))
        return context.get_dummy_value()

    return types.void(a, types.intp, types.intp, value), lower


@intrinsic(prefer_literal=True)
def load_packs(typing: Any, a: Any, at: Any, n: Any, w: Any) -> Any:
    """The `n` packs of `w` consecutive numbers each from position `at`, as `store_packs` wrote them."""
    result = Vector(n.literal_value, w.literal_value)
    register = llvm_type(element(result.w))

    def lower(context: Any, b: Any, sig: Any, args: Any) -> Any:
        values = []
        for i in range(result.n):
            start = b.add(args[1], ir.Constant(args[1].type, i * result.w))
            values.append(b.load(_pointer(b, args[0], start, register)))
            values[-1].align = 8
        return join(b, result, values)

    return result(a, types.intp, n, w), lower


@intrinsic(prefer_literal=True)
def store_packs(typing: Any, a: Any, at: Any, value: Any, w: Any) -> Any:
    """Write a vector or matrix in `w` lanes from position `at`, all lanes of an entry before the next entry."""
    target = wider(value, w.literal_value)

    def lower(context: Any, b: Any, sig: Any, args: Any) -> Any:
        whole = widen(b, value, target, args[2])
        rows = [whole] if isinstance(value, Vector) else parts(b, whole)
        for i, pack in enumerate(pack for row in rows for pack in parts(b, row)):
            start = b.add(args[1], ir.Constant(args[1].type, i * w.literal_value))
            b.store(pack, _pointer(b, args[0], start, pack.type)).align = 8
        return context.get_dummy_value()

    return types.void(a, types.intp, value, w), lower
