"""Calls of functions that work on numbers from code that works on lanes, and registers of eight numbers within one problem."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from piazzi.kernels.lanes.algebra import get, join
from piazzi.kernels.lanes.kinds import INDEX, Pack, Vector, element, lanes_of, llvm_type

EIGHT = 8


def _called(typing: Any, function: Any, kinds: Sequence[Any]) -> Any:
    """How a function is called with arguments of these types."""
    return typing.resolve_function_type(function, tuple(types.unliteral(k) for k in kinds), {})


def _arguments(context: Any, b: Any, kinds: Sequence[Any], wanted: Sequence[Any], given: Any) -> list[Any]:
    values = [b.extract_value(given, i) for i in range(len(kinds))]
    return [context.cast(b, v, have, want) for v, have, want in zip(values, kinds, wanted, strict=True)]


@intrinsic
def by_lanes(typing: Any, one: Any, several: Any, *arguments: Any) -> Any:
    """``several(*arguments)`` where one of them is a pack, else ``one(*arguments)``."""
    chosen = several if any(isinstance(a, Pack) for a in arguments) else one
    called = _called(typing, chosen, arguments)

    def lower(context: Any, b: Any, sig: Any, args: Any) -> Any:
        return context.get_function(chosen, called)(b, _arguments(context, b, arguments, called.args, args[2]))

    return called.return_type(one, several, types.StarArgTuple(arguments)), lower


@intrinsic
def each_lane(typing: Any, function: Any, *arguments: Any) -> Any:
    """``function(*arguments)``, a tuple of numbers; of packs, lane by lane: the same bits."""
    w = max(lanes_of(a) for a in arguments)
    called = _called(typing, function, [types.float64 if isinstance(a, Pack) else a for a in arguments])
    outputs = len(called.return_type)
    result = types.UniTuple(element(w), outputs) if w > 1 else called.return_type

    def lower(context: Any, b: Any, sig: Any, args: Any) -> Any:
        run = context.get_function(function, called)
        if w == 1:
            return run(b, _arguments(context, b, arguments, called.args, args[1]))
        values = [b.extract_value(args[1], i) for i in range(len(arguments))]
        found = []
        for lane in range(w):
            of_lane = [get(b, v, lane) if isinstance(k, Pack) else v for v, k in zip(values, arguments, strict=True)]
            kinds = [types.float64 if isinstance(k, Pack) else k for k in arguments]
            found.append(run(b, [context.cast(b, v, k, want) for v, k, want in zip(of_lane, kinds, called.args, strict=True)]))
        lanes = [[b.extract_value(f, i) for f in found] for i in range(outputs)]
        return context.make_tuple(b, result, [join(b, element(w), of_output) for of_output in lanes])

    return result(function, types.StarArgTuple(arguments)), lower


@intrinsic
def eight(typing: Any, v: Any) -> Any:
    """The entries of a vector of eight as a pack, which lives in one register."""
    return (Pack(EIGHT)(v), lambda context, b, sig, args: args[0]) if v == Vector(EIGHT) else None


@intrinsic(prefer_literal=True)
def load_eights(typing: Any, a: Any, at: Any, n: Any) -> Any:
    """The `n` registers of eight consecutive numbers each from position `at`."""
    result = Vector(n.literal_value, EIGHT)

    def lower(context: Any, b: Any, sig: Any, args: Any) -> Any:
        register = llvm_type(Pack(EIGHT)).as_pointer()
        places = [b.gep(args[0], [b.add(args[1], ir.Constant(args[1].type, i * EIGHT))]) for i in range(result.n)]
        values = [b.load(b.bitcast(place, register)) for place in places]
        for value in values:
            value.align = 8
        return join(b, result, values)

    return result(a, types.intp, n), lower


@intrinsic
def sums_of_eight(typing: Any, v: Any) -> Any:
    """The vector of the sums over the lanes of eight packs of eight: three rounds of halves."""
    if v != Vector(EIGHT, EIGHT):
        return None

    def mixed(b: Any, x: Any, y: Any, width: int) -> Any:
        low = [k if not k & width else k - width + EIGHT for k in range(EIGHT)]
        masks = [ir.Constant(ir.VectorType(INDEX, EIGHT), m) for m in (low, [k + width for k in low])]
        return b.fadd(*[b.shuffle_vector(x, y, mask) for mask in masks])

    def lower(context: Any, b: Any, sig: Any, args: Any) -> Any:
        packs = [b.extract_value(args[0], i) for i in range(EIGHT)]
        for width in (1, 2, 4):
            packs = [mixed(b, packs[2 * i], packs[2 * i + 1], width) for i in range(len(packs) // 2)]
        return packs[0]

    return Vector(EIGHT)(v), lower
