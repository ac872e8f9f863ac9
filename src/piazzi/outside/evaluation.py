"""Functions from outside as Python calls them: the same source that kernels compile, uncompiled, on the same block of data."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from functools import cache
from importlib import import_module
from typing import Any

import numpy as np

from piazzi.arrays import Array
from piazzi.kernels.build import module_of
from piazzi.kernels.tables import table_source
from piazzi.model.functions import Signature

REGISTER = 8  # doubles: blocks are whole ones, so that none lies across two lines of memory
_PLAIN = "from piazzi.kernels.plain import *\n\n\n"


@cache
def plain_functions(signature: Signature) -> tuple[Callable[..., Any], Callable[..., Any]]:
    """The function of a signature and the one with partials, ``(*arguments, data, at)``, uncompiled."""
    if signature.terms:
        module = module_of(_PLAIN + table_source(signature.outputs, signature.terms))
    elif signature.code:
        module = module_of(_PLAIN + signature.code)
    else:
        module = import_module(f"piazzi.kernels.fragments.{signature.fragment}")
    return getattr(module, signature.function), getattr(module, f"{signature.function}_partials")


def value(signature: Signature, block: Array, *arguments: float) -> tuple[float, ...]:
    """The outputs."""
    check_count(signature, arguments)
    with np.errstate(all="ignore"):
        return tuple(map(float, plain_functions(signature)[0](*map(np.float64, arguments), block, 0)))


def derivatives(signature: Signature, block: Array, *arguments: float) -> Array:
    """The derivatives of the outputs (rows) by the arguments; zero where none is known."""
    check_count(signature, arguments)
    with np.errstate(all="ignore"):
        found = plain_functions(signature)[1](*map(np.float64, arguments), block, 0)[signature.outputs :]
    out = np.zeros((signature.outputs, signature.arguments))
    for pair, entry in zip(signature.partials, found, strict=True):
        out[pair] = entry
    return out


def check_count(signature: Signature, arguments: tuple[float, ...]) -> None:
    """Raise ValueError unless there are as many arguments as the function takes."""
    if len(arguments) != signature.arguments:
        takes = f"{signature.arguments} argument{'' if signature.arguments == 1 else 's'}"
        raise ValueError(f"function {signature.kind} takes {takes}, not {len(arguments)}")


def numbers(value: Any, what: str) -> Array:
    """The value as an array of its own; raises ValueError where it is not made of numbers."""
    try:
        return np.array(value, dtype=float)
    except (TypeError, ValueError):
        raise ValueError(f"{what} must be made of numbers, in rows of equal length") from None


def aligned(size: int) -> Array:
    """Zeros that begin at a line of memory: registers that lie across two lines are loaded twice."""
    whole = np.zeros(size + REGISTER)
    skip = (-whole.ctypes.data // whole.itemsize) % REGISTER
    return whole[skip : skip + size]


def whole_registers(size: int) -> int:
    """The next multiple of a register's size."""
    return -(-size // REGISTER) * REGISTER


def checksum(*parts: Any) -> str:
    """Hash of arrays, numbers and text."""
    out = hashlib.sha256()
    for part in parts:
        out.update(np.ascontiguousarray(part, dtype=float).tobytes() if isinstance(part, np.ndarray) else repr(part).encode())
        out.update(b"\0")
    return out.hexdigest()
