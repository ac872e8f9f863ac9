"""What elementary functions are made of, for numbers and for packs: choices, bits of a double, polynomials, exceptions."""

from __future__ import annotations

import struct
from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from piazzi.kernels.compiler import alloca_once_value, get_or_insert_function
from piazzi.kernels.lanes.algebra import get, join, widen
from piazzi.kernels.lanes.kinds import FUSE, Pack, element, lanes_of

_MAGIC = 6755399441055744.0  # 1.5 2^52: a small whole number added to it is in its lowest bits
_EXPONENT_BITS, _BIAS = 52, 1023


def constant(ty: Any, value: Any) -> Any:
    """The same number in every lane of the LLVM type."""
    return ir.Constant(ty, [value] * ty.count if isinstance(ty, ir.VectorType) else value)


def _bits_of(value: float) -> int:
    return int(struct.unpack("<q", struct.pack("<d", value))[0])


def _integers(ty: Any) -> Any:
    return ir.VectorType(ir.IntType(64), ty.count) if isinstance(ty, ir.VectorType) else ir.IntType(64)


def _of_one_kind(name: str, build: Callable[..., Any], arguments: int) -> Any:
    """An intrinsic of numbers and packs, all in the lanes of the widest; `build` gets the IR builder and the values."""

    def work(kinds: tuple[Any, ...]) -> Any:
        if not all(isinstance(k, (types.Number, Pack)) for k in kinds):
            return None
        result = element(max(lanes_of(k) for k in kinds))
        taken = [types.float64 if isinstance(k, types.Number) else k for k in kinds]

        def lower(context: Any, b: Any, sig: Any, args: Any) -> Any:
            values = [widen(b, have, result, v) for have, v in zip(sig.args, args, strict=True)]
            return build(context, b, *values)

        return result(*taken), lower

    def one(typing: Any, x: Any) -> Any:
        return work((x,))

    def two(typing: Any, x: Any, y: Any) -> Any:
        return work((x, y))

    def four(typing: Any, x: Any, y: Any, u: Any, v: Any) -> Any:
        return work((x, y, u, v))

    def five(typing: Any, x: Any, y: Any, u: Any, v: Any, w: Any) -> Any:
        return work((x, y, u, v, w))

    function = {1: one, 2: two, 4: four, 5: five}[arguments]
    function.__name__ = name
    return intrinsic(function)


def _instruction(name: str) -> Callable[..., Any]:
    def build(context: Any, b: Any, *values: Any) -> Any:
        ty = values[0].type
        suffix = f"v{ty.count}f64" if isinstance(ty, ir.VectorType) else "f64"
        kind = ir.FunctionType(ty, [ty] * len(values))
        return b.call(get_or_insert_function(b.module, kind, f"llvm.{name}.{suffix}"), values)

    return build


def _choose(context: Any, b: Any, x: Any, y: Any, yes: Any, no: Any) -> Any:
    return b.select(b.fcmp_ordered(">", x, y), yes, no)


def _two_to(context: Any, b: Any, k: Any) -> Any:
    whole = b.bitcast(b.fadd(k, constant(k.type, _MAGIC)), _integers(k.type))
    exponent = b.sub(whole, constant(whole.type, _bits_of(_MAGIC) - _BIAS))
    return b.bitcast(b.shl(exponent, constant(whole.type, _EXPONENT_BITS)), k.type)


def _exponent(context: Any, b: Any, x: Any) -> Any:
    bits = b.bitcast(x, _integers(x.type))
    over = b.sub(bits, constant(bits.type, _bits_of(0.5**0.5)))
    return b.sitofp(b.ashr(over, constant(bits.type, _EXPONENT_BITS)), x.type)


choose = _of_one_kind("choose", _choose, 4)  # the third where the first is larger than the second, else the fourth
nearest = _of_one_kind("nearest", _instruction("nearbyint"), 1)  # whole number
below = _of_one_kind("below", _instruction("floor"), 1)  # whole number
with_sign = _of_one_kind("with_sign", _instruction("copysign"), 2)  # of the second
two_to = _of_one_kind("two_to", _two_to, 1)  # 2^k for a whole number k from -1022 to 1023
exponent = _of_one_kind("exponent", _exponent, 1)  # k with x = 2^k m, sqrt(1/2) <= m < sqrt(2), for a normal x > 0


def polynomial(name: str, *coefficients: float) -> Any:
    """c0 + c1 z + c2 z^2 ..., in pairs of pairs (Estrin): as many steps one after the other as the degree has binary digits."""

    def build(context: Any, b: Any, z: Any) -> Any:
        terms, power = [constant(z.type, c) for c in coefficients], z
        while len(terms) > 1:
            pairs = [terms[i : i + 2] for i in range(0, len(terms), 2)]
            terms = [
                b.fadd(pair[0], b.fmul(power, pair[1], flags=FUSE), flags=FUSE) if len(pair) == 2 else pair[0] for pair in pairs
            ]
            power = b.fmul(power, power, flags=FUSE)
        return terms[0]

    return _of_one_kind(name, build, 1)


def mended(function: Any, arguments: int) -> Any:
    """An intrinsic ``mend(value, size, limit, *arguments)``: `value` where `size` is below `limit`, else the C library's word.

    Where the function takes two arguments, `size` must also be above the inverse of the limit.  The library is asked lane by
    lane, in a branch that is hardly ever taken.
    """

    def build(context: Any, b: Any, value: Any, size: Any, limit: Any, *given: Any) -> Any:
        good = b.fcmp_ordered("<", size, limit)
        if arguments == 2:
            good = b.and_(good, b.fcmp_ordered("<", b.fdiv(constant(size.type, 1.0), limit), size))
        w = value.type.count if isinstance(value.type, ir.VectorType) else 1
        whole = ir.IntType(w)
        every = good if w == 1 else b.icmp_signed("==", b.bitcast(good, whole), ir.Constant(whole, -1))
        result = alloca_once_value(b, value)
        with b.if_then(b.not_(every), likely=False):
            scalar = context.get_function(function, types.float64(*[types.float64] * arguments))
            lanes = [scalar(b, [get(b, v, i) if w > 1 else v for v in given]) for i in range(w)]
            b.store(b.select(good, value, join(b, element(w), lanes) if w > 1 else lanes[0]), result)
        return b.load(result)

    return _of_one_kind(f"mended_{function.__name__}", build, 3 + arguments)
