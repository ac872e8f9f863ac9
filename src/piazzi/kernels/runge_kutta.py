"""Explicit Runge-Kutta methods of fixed step, on the state and its transition matrix together."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from piazzi.kernels import tableaus
from piazzi.kernels.integrators import Integrator
from piazzi.kernels.quadrature import noise_order


@dataclass(frozen=True)
class ExplicitRungeKutta(Integrator):
    """What the methods below share."""

    @property
    def tableau(self) -> tableaus.Tableau:
        """Rows of `a` below the diagonal, weights `b`, nodes `c`."""
        raise TypeError("choose a method, such as RungeKutta4")

    @property
    def scheme(self) -> tuple[Any, ...]:
        return ("runge-kutta", self.tableau)

    @property
    def noise_fragments(self) -> tuple[str, ...]:
        return ("noise_integral",) if noise_order(len(self.tableau[1])) == 4 else ("noise_lobatto", "noise_steps")


@dataclass(frozen=True)
class RungeKutta(ExplicitRungeKutta):
    """The explicit method with this Butcher tableau.

    Parameters
    ----------
    a : rows of coefficients
        A full square matrix or only what is below its diagonal; an empty first row may be left out.
    b : weights
    c : nodes, optional
        Default the row sums of `a`.
    substeps, max_step : int, float, optional

    Raises
    ------
    ValueError
        Unless `a` is strictly lower triangular, its rows add up to `c` and the weights to 1.
    """

    substeps: int | None = field(default=None, kw_only=True)
    max_step: float | None = field(default=None, kw_only=True)
    a: Any = ()
    b: Any = ()
    c: Any = None

    def __post_init__(self) -> None:
        super().__post_init__()
        for name, value in zip("abc", tableaus.tableau(self.a, self.b, self.c), strict=True):
            object.__setattr__(self, name, value)

    @property
    def tableau(self) -> tableaus.Tableau:
        return self.a, self.b, self.c


@dataclass(frozen=True)
class Euler(ExplicitRungeKutta):
    """x + h f(x): order 1."""

    @property
    def tableau(self) -> tableaus.Tableau:
        return tableaus.EULER


@dataclass(frozen=True)
class Midpoint(ExplicitRungeKutta):
    """The rate at the middle of the step, reached by Euler: order 2."""

    @property
    def tableau(self) -> tableaus.Tableau:
        return tableaus.MIDPOINT


@dataclass(frozen=True)
class Heun(ExplicitRungeKutta):
    """The mean of the rates at both ends of the step: order 2."""

    @property
    def tableau(self) -> tableaus.Tableau:
        return tableaus.HEUN


@dataclass(frozen=True)
class Ralston(ExplicitRungeKutta):
    """The method of two stages with the smallest error bound: order 2."""

    @property
    def tableau(self) -> tableaus.Tableau:
        return tableaus.RALSTON


@dataclass(frozen=True)
class RungeKutta4(ExplicitRungeKutta):
    """The classical method of order 4."""

    @property
    def tableau(self) -> tableaus.Tableau:
        return tableaus.CLASSICAL


@dataclass(frozen=True)
class DormandPrince5(ExplicitRungeKutta):
    """Dormand and Prince's method of order 5, six stages."""

    @property
    def tableau(self) -> tableaus.Tableau:
        return tableaus.DORMAND_PRINCE_5


@dataclass(frozen=True)
class RungeKutta8(ExplicitRungeKutta):
    """Dormand and Prince's method of order 8, twelve stages: `DormandPrince` with the steps given."""

    @property
    def tableau(self) -> tableaus.Tableau:
        return tableaus.DORMAND_PRINCE_8
