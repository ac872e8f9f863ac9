"""Losses: how much a row of measurements may still say when it is far from what all the others say.

A loss replaces the square s = |r|^2 of a row's whitened residual in the cost by rho(s) <= s.  The minimum is found by
weighted least squares, again and again, with the weight rho'(s) of each row at the last residual (Huber and Ronchetti, Robust
Statistics, 2nd ed. 2009, ch. 7; Barfoot, State Estimation for Robotics, 2017, sec. 5.3).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from piazzi.estimate.chi_square import cdf, quantile
from piazzi.problem.checks import Array


@dataclass(frozen=True)
class Loss(ABC):
    """A loss with its tuning constant `k`, in standard deviations of a row with one component.

    The defaults keep 95 % efficiency on Gaussian noise (Holland and Welsch, Communications in Statistics A6, 1977).  The
    residual of a row with m components is longer for no fault of its own: it gets the constant that as many good rows exceed.
    """

    k: float
    name: ClassVar[str] = ""
    kind: ClassVar[int] = 0  # what the kernels call it

    def __post_init__(self) -> None:
        if not (np.isfinite(self.k) and self.k > 0):
            raise ValueError(f"k of {type(self).__name__} is {self.k}; it must be positive and finite")

    def __str__(self) -> str:
        return f"{self.name}={self.k:g}"

    def squares(self, width: int) -> Array:
        """Square of the constant for rows of 0, 1, ..., `width` components, (width + 1,)."""
        one = self.k**2
        passed = cdf(one, 1)
        # beyond ten sigma the probability has no digits left; the constants then differ by a few per cent
        more = [quantile(passed, m) if passed < 1.0 - 1e-15 else one + m - 1 for m in range(2, width + 1)]
        return np.array([one, one, *more][: width + 1])

    @abstractmethod
    def cost(self, s: Array, square: Array) -> Array:
        """rho(s) for squared residuals `s` where the constant has this `square`, same shape."""

    @abstractmethod
    def weight(self, s: Array, square: Array) -> Array:
        """rho'(s), in [0, 1], same shape."""


@dataclass(frozen=True)
class Huber(Loss):
    """Quadratic up to `k`, then linear: an outlier pulls as much as a measurement at `k`.  Convex: it adds no minima.

    Huber, Annals of Mathematical Statistics 35 (1964).
    """

    k: float = 1.345
    name: ClassVar[str] = "huber"
    kind: ClassVar[int] = 1

    def cost(self, s: Array, square: Array) -> Array:
        return np.where(s <= square, s, 2.0 * np.sqrt(square * s) - square)

    def weight(self, s: Array, square: Array) -> Array:
        return np.sqrt(square / np.maximum(s, square))


@dataclass(frozen=True)
class Cauchy(Loss):
    """Logarithmic: the farther an outlier, the less it pulls, but never not at all."""

    k: float = 2.385
    name: ClassVar[str] = "cauchy"
    kind: ClassVar[int] = 2

    def cost(self, s: Array, square: Array) -> Array:
        return square * np.log1p(s / square)

    def weight(self, s: Array, square: Array) -> Array:
        return 1.0 / (1.0 + s / square)


@dataclass(frozen=True)
class Tukey(Loss):
    """Constant beyond `k`: an outlier does not pull at all.  It adds minima, so it is never begun with.

    Beaton and Tukey, Technometrics 16 (1974).
    """

    k: float = 4.685
    name: ClassVar[str] = "tukey"
    kind: ClassVar[int] = 3

    def cost(self, s: Array, square: Array) -> Array:
        u = np.minimum(s / square, 1.0)
        return square * u * (1.0 - u + u * u / 3.0)

    def weight(self, s: Array, square: Array) -> Array:
        return np.maximum(1.0 - s / square, 0.0) ** 2


LOSSES: Mapping[str, Callable[..., Loss]] = {loss.name: loss for loss in (Huber, Cauchy, Tukey)}


def loss_of(given: Any) -> Loss | None:
    """The loss that this means: a loss, or "huber", "cauchy" or "tukey", with its constant as in "huber=2"; None for none.

    Raises
    ------
    ValueError
        For anything else.
    """
    if given is None or isinstance(given, Loss):
        return given
    name, equals, constant = given.partition("=") if isinstance(given, str) else ("", "", "")
    if name not in LOSSES:
        raise ValueError(f"loss is {given!r}; it must be one of {', '.join(LOSSES)}, or a loss such as Huber(1.345)")
    try:
        return LOSSES[name](float(constant)) if equals else LOSSES[name]()
    except ValueError:
        raise ValueError(f"loss is {given!r}; its constant must be a positive number, as in {name}=2") from None
