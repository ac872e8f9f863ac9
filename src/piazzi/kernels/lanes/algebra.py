"""The algebra of vectors and matrices as LLVM instructions."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from llvmlite import ir
from numba import types

from piazzi.kernels.compiler import alloca_once, for_range, get_or_insert_function
from piazzi.kernels.lanes.kinds import DOUBLE, FUSE, INDEX, Matrix, Pack, Vector, element, llvm_type

# `b` is the IR builder throughout; values are LLVM values of the types above.


def splat(b: Any, x: Any, width: int) -> Any:
    """`width` copies of the double `x`."""
    vector = ir.VectorType(DOUBLE, width)
    first = b.insert_element(ir.Constant(vector, ir.Undefined), x, ir.Constant(INDEX, 0))
    return b.shuffle_vector(first, ir.Constant(vector, ir.Undefined), ir.Constant(ir.VectorType(INDEX, width), [0] * width))


def get(b: Any, v: Any, i: int) -> Any:
    """Entry `i` of a vector, row `i` of a matrix."""
    if isinstance(v.type, ir.VectorType):
        return b.extract_element(v, ir.Constant(INDEX, i))
    return b.extract_value(v, i)


def join(b: Any, ty: types.Type, parts: Sequence[Any]) -> Any:
    """The vector of these entries, or the matrix of these rows."""
    out = ir.Constant(llvm_type(ty), ir.Undefined)
    for i, part in enumerate(parts):
        if isinstance(out.type, ir.VectorType):
            out = b.insert_element(out, part, ir.Constant(INDEX, i))
        else:
            out = b.insert_value(out, part, i)
    return out


def parts(b: Any, v: Any) -> list[Any]:
    """The entries of a vector, or the rows of a matrix."""
    return [get(b, v, i) for i in range(v.type.count)]


def zipped(b: Any, op: Callable[..., Any], *args: Any) -> Any:
    """`op` on every entry; an array of registers is taken apart, a single register is not."""
    if not isinstance(args[0].type, ir.ArrayType):
        return op(*args)
    out = ir.Constant(args[0].type, ir.Undefined)
    for i in range(args[0].type.count):
        out = b.insert_value(out, zipped(b, op, *(b.extract_value(a, i) for a in args)), i)
    return out


def widen(b: Any, have: Any, want: Any, v: Any) -> Any:
    """A value of one problem as the same value in every lane; anything else unchanged."""
    if have == want or not isinstance(want, (Pack, Vector, Matrix)):
        return v
    if isinstance(want, Pack):
        return v if isinstance(have, Pack) else splat(b, v, want.w)
    kind, inner = (element(ty.w) if isinstance(ty, Vector) else ty.row for ty in (have, want))
    return join(b, want, [widen(b, kind, inner, part) for part in parts(b, v)])


def scale(b: Any, s: Any, x: Any) -> Any:
    """The element `s` times everything in `x`."""

    def times(register: Any) -> Any:
        factor = s if s.type == register.type else splat(b, s, register.type.count)
        return b.fmul(factor, register, flags=FUSE)

    return zipped(b, times, x)


def fused_sum(b: Any, x: Any, y: Any, z: Any) -> Any:
    """x y + z, registers all: rounded once where the processor can.

    Said in one piece, because of a sum of two products the compiler fuses either one, and may choose otherwise in lanes.
    """
    kind = z.type
    suffix = f"v{kind.count}f64" if isinstance(kind, ir.VectorType) else "f64"
    callee = get_or_insert_function(b.module, ir.FunctionType(kind, [kind] * 3), f"llvm.fmuladd.{suffix}")
    return b.call(callee, [x, y, z])


def scaled_sum(b: Any, s: Any, x: Any, y: Any) -> Any:
    """The element `s` times everything in `x`, plus `y`, fused."""

    def times_plus(register: Any, other: Any) -> Any:
        factor = s if s.type == register.type else splat(b, s, register.type.count)
        return fused_sum(b, factor, register, other)

    return zipped(b, times_plus, x, y)


def combine(b: Any, coefficients: Sequence[Any], rows: Sequence[Any]) -> Any:
    """sum of coefficient * row."""
    total = scale(b, coefficients[0], rows[0])
    for c, row in zip(coefficients[1:], rows[1:], strict=True):
        total = scaled_sum(b, c, row, total)
    return total


def _piece(b: Any, v: Any, start: int, count: int) -> Any:
    """So many entries of a register from one on, as a register."""
    places = ir.Constant(ir.VectorType(INDEX, count), list(range(start, start + count)))
    return b.shuffle_vector(v, ir.Constant(v.type, ir.Undefined), places)


def _halves(b: Any, v: Any) -> tuple[Any, Any]:
    """The first and the second half of the entries, without the last of an odd number: registers, or lists of lanes."""
    if isinstance(v, list):
        return v[: len(v) // 2], v[len(v) // 2 : len(v) // 2 * 2]
    half = v.type.count // 2
    return _piece(b, v, 0, half), _piece(b, v, half, half)


def _each(op: Callable[..., Any], *args: Any) -> Any:
    return [op(*entries) for entries in zip(*args, strict=True)] if isinstance(args[0], list) else op(*args)


def _size(v: Any) -> int:
    return len(v) if isinstance(v, list) else int(v.type.count)


def _entry(b: Any, v: Any, i: int) -> Any:
    return v[i] if isinstance(v, list) else get(b, v, i)


def _total(b: Any, v: Any) -> Any:
    """The sum of the entries, by halves."""
    if _size(v) == 1:
        return _entry(b, v, 0)
    both = _total(b, _each(b.fadd, *_halves(b, v)))
    return b.fadd(both, _entry(b, v, _size(v) - 1)) if _size(v) % 2 else both


def dot(b: Any, x: Any, y: Any) -> Any:
    """The sum of products of the entries of two registers, or of two lists of lanes: the same roundings, so the same bits.

    The products of the second half are fused to those of the first, and the sums taken by halves.
    """
    n = _size(x)
    if n == 1:
        return b.fmul(_entry(b, x, 0), _entry(b, y, 0), flags=FUSE)
    (x_low, x_high), (y_low, y_high) = _halves(b, x), _halves(b, y)
    sums = _each(lambda u, v, low, high: fused_sum(b, u, v, b.fmul(low, high)), x_high, y_high, x_low, y_low)
    both = _total(b, sums)
    return fused_sum(b, _entry(b, x, n - 1), _entry(b, y, n - 1), both) if n % 2 else both


# rows beyond which products and transposes are loops over memory: registers do not hold them, and straight code is long
LOOPED = 8


class Table:
    """A matrix in memory, row by row without gaps, for loops over its rows."""

    def __init__(self, b: Any, ty: Matrix) -> None:
        self.b, self.ty = b, ty
        self.place = alloca_once(b, ir.ArrayType(ir.ArrayType(DOUBLE, ty.n), ty.r))

    def entry(self, i: Any, j: int) -> Any:
        """Pointer to an entry."""
        return self.b.gep(self.place, [ir.Constant(INDEX, 0), i, ir.Constant(INDEX, j)])

    def put(self, i: Any, row: Any) -> None:
        self.b.store(row, self.b.bitcast(self.entry(i, 0), row.type.as_pointer())).align = 8

    def fill(self, value: Any) -> Table:
        for i, row in enumerate(parts(self.b, value)):
            self.put(ir.Constant(INDEX, i), row)
        return self

    def value(self) -> Any:
        """The matrix."""
        row = llvm_type(self.ty.row).as_pointer()
        rows = [self.b.load(self.b.bitcast(self.entry(ir.Constant(INDEX, i), 0), row)) for i in range(self.ty.r)]
        for r in rows:
            r.align = 8
        return join(self.b, self.ty, rows)


def looped_product(b: Any, left: Matrix, a: Any, result: Matrix, c: Any) -> Any:
    """A C, one row of A after the other."""
    A, out, rows = Table(b, left).fill(a), Table(b, result), parts(b, c)
    with for_range(b, ir.Constant(INDEX, left.r)) as loop:
        out.put(loop.index, combine(b, [b.load(A.entry(loop.index, j)) for j in range(left.n)], rows))
    return out.value()


def looped_transpose(b: Any, ty: Matrix, a: Any) -> Any:
    """A^T, one column of A after the other."""
    A, out, row = Table(b, ty).fill(a), Table(b, Matrix(ty.n, ty.r)), Vector(ty.r)
    with for_range(b, ir.Constant(INDEX, ty.n)) as loop:
        zero = ir.Constant(INDEX, 0)
        places = [b.gep(A.place, [zero, ir.Constant(INDEX, i), loop.index]) for i in range(ty.r)]
        out.put(loop.index, join(b, row, [b.load(place) for place in places]))
    return out.value()


def transpose(b: Any, ty: Matrix, a: Any) -> Any:
    """A^T."""
    if ty.w == 1 and min(ty.r, ty.n) > LOOPED:
        return looped_transpose(b, ty, a)
    rows = [parts(b, row) for row in parts(b, a)] if ty.w > 1 or max(ty.r, ty.n) > 8 else None
    target = Matrix(ty.n, ty.r, ty.w)
    if rows is not None:
        return join(b, target, [join(b, target.row, [rows[i][j] for i in range(ty.r)]) for j in range(ty.n)])
    return join(b, target, _transpose_by_shuffles(b, parts(b, a), ty.n))


def _transpose_by_shuffles(b: Any, rows: list[Any], n: int) -> list[Any]:
    """Transpose of registers: log2 rounds of interleaving, each of which doubles the length of the finished runs."""
    r = len(rows)
    size = 1 << (max(r, n) - 1).bit_length()
    undefined = ir.Constant(ir.VectorType(DOUBLE, n), ir.Undefined)

    def shuffle(x: Any, y: Any, mask: list[int]) -> Any:
        return b.shuffle_vector(x, y, ir.Constant(ir.VectorType(INDEX, len(mask)), mask))

    widen = list(range(n)) + [0] * (size - n)
    work = [shuffle(rows[i] if i < r else undefined, undefined, widen) for i in range(size)]
    low = [k // 2 + (k % 2) * size for k in range(size)]
    high = [k + size // 2 for k in low]
    for _ in range(size.bit_length() - 1):  # a perfect shuffle of the whole square, log2(size) times, transposes it
        half = size // 2
        work = [shuffle(work[i // 2], work[i // 2 + half], low if i % 2 == 0 else high) for i in range(size)]
    return [shuffle(work[j], work[j], list(range(r))) for j in range(n)]
