"""How a continuous model becomes a step, x[k] -> x[k+1]: settings only; the steps themselves are generated."""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite
from typing import Any

import numpy as np

Tableau = tuple[tuple[tuple[float, ...], ...], tuple[float, ...], tuple[float, ...]]


@dataclass(frozen=True)
class Integrator:
    """Settings shared by all fixed-step methods.

    An interval between two epochs is cut into `substeps` equal parts, or, where `max_step` is given, into as many as keep
    every part at or below `max_step` seconds.

    Raises
    ------
    ValueError
        Unless exactly one of the two is given, and positive.
    """

    substeps: int | None = None
    max_step: float | None = None

    def __post_init__(self) -> None:
        if self.substeps is None and self.max_step is None:
            object.__setattr__(self, "substeps", self.default_substeps)
        if self.substeps is not None and self.max_step is not None:
            raise ValueError("give either substeps or max_step, not both")
        if self.substeps is not None and (self.substeps != int(self.substeps) or not 1 <= self.substeps <= 10**9):
            raise ValueError(f"substeps is {self.substeps}; it must be a whole number of 1 or more")
        if self.max_step is not None and not (isfinite(self.max_step) and self.max_step > 0):
            raise ValueError(f"max_step is {self.max_step} s; it must be positive")

    @property
    def default_substeps(self) -> int:
        return 10

    @property
    def scheme(self) -> tuple[Any, ...]:
        """What the generated code depends on: the method, not the number of its steps."""
        raise TypeError("choose a method, such as RungeKutta4")

    def counts(self, intervals: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
        """Substeps in each interval of that many seconds, int64 of the same shape."""
        if self.substeps is not None:
            return np.full(len(intervals), self.substeps, dtype=np.int64)
        # an interval that is a whole number of steps up to rounding keeps that number
        count = np.ceil(intervals / self.max_step * (1 - 1e-12))
        if count.size and not count.max() < 2**53:
            raise ValueError(f"max_step {self.max_step} s cuts an interval of {intervals.max():g} s into too many substeps")
        return np.asarray(np.maximum(count, 1), dtype=np.int64)


@dataclass(frozen=True)
class Taylor(Integrator):
    """Constant acceleration over a substep: x + h v + h^2/2 a, v + h a (Taylor and Gross, NAVIGATION 71(3), 2024).

    States whose rate is itself a state are taken to second order, all others to first.
    """

    @property
    def scheme(self) -> tuple[Any, ...]:
        return ("taylor",)


@dataclass(frozen=True)
class RungeKutta4(Integrator):
    """The classical fourth-order Runge-Kutta method, on the state and its transition matrix together."""

    @property
    def scheme(self) -> tuple[Any, ...]:
        a = ((), (0.5,), (0.0, 0.5), (0.0, 0.0, 1.0))
        return ("runge-kutta", (a, (1 / 6, 1 / 3, 1 / 3, 1 / 6), (0.0, 0.5, 0.5, 1.0)))


@dataclass(frozen=True)
class Discrete(Integrator):
    """The step of a model given as x[k+1]: taken once per interval."""

    @property
    def default_substeps(self) -> int:
        return 1

    @property
    def scheme(self) -> tuple[Any, ...]:
        return ("discrete",)
