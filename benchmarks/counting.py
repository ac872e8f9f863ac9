"""Arithmetic operations of an estimator, counted by running its kernels' own source on numbers that count.

Sums, products, quotients, roots and functions count one each, zeros and ones in dense matrices included.  What Python does
between kernels does not count.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import SimpleNamespace
from typing import Any

import numpy as np

import piazzi as pz
from piazzi import kernels
from piazzi.kernels import plain
from piazzi.kernels.entries import signatures
from piazzi.kernels.members import Bundle


class Number:
    """A double that adds to the count whatever is computed from it."""

    __slots__ = ("value",)
    operations = 0

    def __init__(self, value: float) -> None:
        self.value = float(value)

    def __float__(self) -> float:
        return self.value

    def __int__(self) -> int:
        return int(self.value)

    def __neg__(self) -> Number:
        return Number(-self.value)


def _counted(call: Callable[..., float]) -> Callable[..., Any]:
    def result(*operands: Any) -> Any:
        if any(isinstance(o, np.ndarray) for o in operands):
            return NotImplemented
        Number.operations += 1
        with np.errstate(all="ignore"):
            return Number(call(*(np.float64(float(o)) for o in operands)))

    return result


for _name in ("add", "sub", "mul", "truediv"):
    _operation = getattr(operator, _name)
    setattr(Number, f"__{_name}__", _counted(_operation))
    setattr(Number, f"__r{_name}__", _counted(lambda a, b, f=_operation: f(b, a)))
for _name in ("lt", "le", "gt", "ge", "eq", "ne"):
    _operation = getattr(operator, _name)
    setattr(Number, f"__{_name}__", lambda a, b, f=_operation: f(float(a), float(b)))


def _objects(values: Any) -> np.ndarray:
    """The same shape, made of numbers that count."""
    a = np.asarray(values)
    out = np.empty(a.size, dtype=object)
    out[:] = [Number(float(v)) for v in a.reshape(-1)]
    return out.reshape(a.shape)


def _vocabulary() -> dict[str, Any]:
    """The kernels' vocabulary on arrays of such numbers."""
    words: dict[str, Any] = dict(vars(plain))
    functions = (
        "acos",
        "asin",
        "atan",
        "atan2",
        "cos",
        "cosh",
        "exp",
        "fabs",
        "log",
        "sin",
        "sinh",
        "sqrt",
        "tan",
        "tanh",
        "pow",
    )
    words |= {name: _counted(getattr(plain, name)) for name in functions}
    words |= {
        "isnan": lambda v: math.isnan(float(v)),
        "vector": lambda *entries: _kept(entries),
        "matrix": lambda *rows: _kept(rows),
        "unit": lambda i, n: _objects(plain.unit(i, n)),
        "identity": lambda n: _objects(np.eye(n)),
        "scratch": lambda n: _objects(plain.scratch(n)),
        "wrap_angle": lambda a: Number(plain.wrap_angle(float(a))),
        "unless_missing": lambda z, nu: math.inf if math.isnan(float(nu)) and not math.isnan(float(z)) else nu,
    }
    return words


def _kept(entries: Any) -> np.ndarray:
    return np.array([list(e) if isinstance(e, np.ndarray) else e for e in entries], dtype=object)


class _Entry:
    """A kernel on counting numbers: arrays of doubles go in as such and come back changed."""

    def __init__(self, function: Callable[..., None]) -> None:
        self._function = function

    def __call__(self, *given: Any) -> None:
        args = [member for a in given for member in (a.members if isinstance(a, Bundle) else (a,))]
        floats = [i for i, a in enumerate(args) if isinstance(a, np.ndarray) and a.dtype == np.float64]
        inside = [_objects(a).reshape(-1) if i in floats else a for i, a in enumerate(args)]
        self._function(*(a.reshape(-1) if isinstance(a, np.ndarray) else a for a in inside))
        for i in floats:
            if args[i].flags.writeable:
                args[i][...] = np.array([float(v) for v in inside[i]]).reshape(args[i].shape)

    def bind(self, *args: Any) -> Callable[[], None]:
        return lambda: self(*args)


def _load(spec: Any) -> SimpleNamespace:
    source = spec.source("plain")
    body = source.replace("from piazzi.kernels.plain import *", "")
    names = _vocabulary()
    exec(compile(body, "<counted>", "exec"), names)
    return SimpleNamespace(**{name: _Entry(names[name]) for name in signatures(source)})


@contextmanager
def _counting() -> Iterator[None]:
    original = kernels.load
    kernels.load = _load
    try:
        yield
    finally:
        kernels.load = original


def operations_per_epoch(estimator: Any, case: tuple[Any, Any], epochs: int = 12) -> float:
    """Operations of `estimate` for each epoch, from the first few epochs of a problem and its tracking."""
    problem, tracking = case
    rows = int(tracking.first_row[epochs])
    stations = None if tracking.row_stations is None else tracking.row_stations[:rows]
    few = pz.Tracking(tracking.row_times[:rows], tracking.values[:rows], stations)
    before = Number.operations
    with _counting():
        estimator.estimate(problem, few)
    return (Number.operations - before) / epochs
