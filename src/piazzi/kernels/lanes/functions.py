"""Functions of packs: in one instruction where the processor has it, else lane by lane with the scalar function's bits."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic, lower_builtin

from piazzi.expressions.functions import TABLE
from piazzi.kernels.compiler import AbstractTemplate, get_or_insert_function, infer_global
from piazzi.kernels.lanes.algebra import get, join, widen
from piazzi.kernels.lanes.kinds import Pack, element, lanes_of


def _vector_instruction(name: str) -> Callable[..., Any]:
    """A function that the processor has for whole registers."""

    def lower(context: Any, b: Any, sig: Any, args: Any) -> Any:
        ty = args[0].type
        callee = get_or_insert_function(b.module, ir.FunctionType(ty, [ty] * len(args)), f"llvm.{name}.v{ty.count}f64")
        return b.call(callee, args)

    return lower


def _lane_by_lane(function: Any) -> Callable[..., Any]:
    """A function that only exists for one number: the same results as the scalar code."""

    def lower(context: Any, b: Any, sig: Any, args: Any) -> Any:
        single = types.float64(*[types.float64] * len(args))
        values = [widen(b, have, sig.return_type, v) for have, v in zip(sig.args, args, strict=True)]
        scalar = context.get_function(function, single)
        return join(b, sig.return_type, [scalar(b, [get(b, v, i) for v in values]) for i in range(sig.return_type.w)])

    return lower


def _register_function(function: Any, lower: Callable[..., Any], arguments: int) -> None:
    @infer_global(function)
    class Template(AbstractTemplate):
        def generic(self, args: Any, kws: Any) -> Any:
            packs = [a for a in args if isinstance(a, Pack)]
            if len(args) != arguments or not packs:
                return None
            return packs[0](*(types.float64 if isinstance(a, types.Number) else a for a in args))

    lower_builtin(function, *[Pack] * arguments)(lower)
    if arguments == 2:
        lower_builtin(function, Pack, types.Float)(lower)
        lower_builtin(function, types.Float, Pack)(lower)


_register_function(math.sqrt, _vector_instruction("sqrt"), 1)
_register_function(math.fabs, _vector_instruction("fabs"), 1)
for _f in TABLE.values():
    if _f.kernel and not _f.code and _f.ulps is None:
        _register_function(getattr(math, _f.kernel), _lane_by_lane(getattr(math, _f.kernel)), _f.arity)
_register_function(math.pow, _lane_by_lane(math.pow), 2)


def _select(b: Any, x: Any, relation: str, y: Any, yes: Any, no: Any) -> Any:
    """`yes` in the lanes where the relation holds, else `no`."""
    return b.select(b.fcmp_ordered(relation, x, y), yes, no)


def _constant(x: Any, value: float) -> Any:
    return ir.Constant(x.type, [value] * x.type.count if isinstance(x.type, ir.VectorType) else value)


def _pair(name: str, relation: str) -> Any:
    def choose(typing: Any, x: Any, y: Any) -> Any:
        result = element(max(lanes_of(x), lanes_of(y)))

        def lower(context: Any, b: Any, sig: Any, args: Any) -> Any:
            u, v = (widen(b, have, result, value) for have, value in zip(sig.args, args, strict=True))
            return _select(b, v, relation, u, v, u)

        return result(*(types.float64 if isinstance(a, types.Number) else a for a in (x, y))), lower

    choose.__name__ = name
    return intrinsic(choose)


maximum, minimum = _pair("maximum", ">"), _pair("minimum", "<")


def _step_function(name: str, above: float, at: float, below: float) -> Any:
    def value(typing: Any, x: Any) -> Any:
        kind = types.float64 if isinstance(x, types.Number) else x

        def lower(context: Any, b: Any, sig: Any, args: Any) -> Any:
            zero = _constant(args[0], 0.0)
            rest = _select(b, args[0], "<", zero, _constant(args[0], below), _constant(args[0], at))
            return _select(b, args[0], ">", zero, _constant(args[0], above), rest)

        return kind(kind), lower

    value.__name__ = name
    return intrinsic(value)


def _ceil(typing: Any, x: Any) -> Any:
    """The next whole number above, as a float."""
    kind = types.float64 if isinstance(x, types.Number) else x

    def lower(context: Any, b: Any, sig: Any, args: Any) -> Any:
        ty = args[0].type
        name = f"llvm.ceil.v{ty.count}f64" if isinstance(ty, ir.VectorType) else "llvm.ceil.f64"
        return b.call(get_or_insert_function(b.module, ir.FunctionType(ty, [ty]), name), args)

    return kind(kind), lower


_ceil.__name__ = "ceil"
sign, heaviside = _step_function("sign", 1.0, 0.0, -1.0), _step_function("heaviside", 1.0, 0.5, 0.0)
ceil: Any = intrinsic(_ceil)
