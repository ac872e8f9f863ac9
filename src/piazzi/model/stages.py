"""What definitions become: symbols that are worked out together, in an order in which each is known when it is needed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeAlias

if TYPE_CHECKING:
    import sympy as sp


@dataclass(frozen=True)
class Stage:
    """Values that are worked out together: symbols and what they are, in terms of symbols that came before."""

    symbols: tuple[sp.Symbol, ...]
    values: tuple[sp.Expr, ...]


@dataclass(frozen=True)
class Call:
    """Values of a function from outside: `symbols` are its outputs, then its known derivatives where it is asked for them.

    `place` is the number of its data: of the function, or a symbol that holds it.
    """

    symbols: tuple[sp.Symbol, ...]
    function: str
    arguments: tuple[sp.Expr, ...]
    place: Any


@dataclass(frozen=True)
class Elsewhen:
    """The state at t + offset by a step of the dynamics; its transition matrix, row by row, and its rates, where wanted."""

    symbols: tuple[sp.Symbol, ...]
    offset: sp.Expr
    transition: tuple[sp.Symbol, ...] = ()
    rates: tuple[sp.Symbol, ...] = ()


@dataclass(frozen=True)
class Solve:
    """A root by Newton's method: what is worked out in each iteration at `unknown`, and what is zero there, with its slope."""

    symbols: tuple[sp.Symbol, ...]  # the root, and the slope of the last iteration
    unknown: sp.Symbol
    start: sp.Expr
    iterations: int
    inner: tuple[AnyStage, ...]
    residual: sp.Expr
    slope: sp.Expr


@dataclass(frozen=True)
class Verdict:
    """Values that hold where a root is one: `symbols` are not numbers unless what is zero there, the sum of `terms`, is small.

    `values` are those without the condition; `scale` is what the terms are compared with besides themselves.
    """

    symbols: tuple[sp.Symbol, ...]
    values: tuple[sp.Symbol, ...]
    terms: tuple[sp.Expr, ...]
    scale: sp.Expr


AnyStage: TypeAlias = "Stage | Call | Elsewhen | Solve | Verdict"
