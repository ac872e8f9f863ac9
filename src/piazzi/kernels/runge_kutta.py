"""Explicit Runge-Kutta methods of fixed step, on the state and its transition matrix together."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from piazzi.kernels import tableaus
from piazzi.kernels.integrators import Integrator
from piazzi.kernels.quadrature import noise_order

FINEST, USUAL = 1e-14, 1e-10  # tolerances


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
    """Dormand and Prince's method of order 8, twelve stages: `DormandPrince` with the steps given.

    Parameters
    ----------
    substeps, max_step : int, float, optional
    tolerance : float, optional
        Instead of these: the steps are as long as keeps the motion of the prior mean over a run, and its transition matrix,
        within this error relative to the length of the vectors (of the groups) of the state.  One length is chosen for each
        span of times, by comparing runs with steps of it and of half of it at all of their nodes; `Problem.max_step` tells it.
    """

    tolerance: float | None = field(default=None, kw_only=True)

    def __post_init__(self) -> None:
        if self.tolerance is None:
            super().__post_init__()
            return
        if self.substeps is not None or self.max_step is not None:
            raise ValueError("give a tolerance, or the steps (substeps, max_step), not both")
        if not FINEST <= self.tolerance < 1:
            raise ValueError(
                f"tolerance is {self.tolerance}; it must be at least {FINEST:g}, which rounding leaves, and below 1"
            )

    @property
    def tableau(self) -> tableaus.Tableau:
        return tableaus.DORMAND_PRINCE_8

    @property
    def chooses_steps(self) -> bool:
        return self.needs_times

    @property
    def needs_times(self) -> bool:
        return self.tolerance is not None


@dataclass(frozen=True)
class GaussJackson(RungeKutta8):
    """The multi-step method of Gauss and Jackson in summed form: one evaluation a step, over arcs that nothing interrupts.

    Where noise or measurements change the state at every epoch (filters, smoothers, windows, graphs), steps are those of
    `RungeKutta8` with the same tolerance or longest step.

    Parameters
    ----------
    max_step, tolerance : float, optional
        The step of the grid in seconds, or the error to choose it by, as of `RungeKutta8`; default a tolerance of 1e-10.
    order : int
        So many rates make a step: 4 to 14.

    Notes
    -----
    For models whose states come in pairs, the rate of one being the other, with constants beside them; arcs of other models,
    arcs of less than 30 steps, and those for which order 8 needs fewer evaluations go by order 8.  The first steps are of
    order 8; a manoeuvre or an event begins anew.  Epochs within a step are found with the order of the method.
    """

    order: int = field(default=10, kw_only=True)

    def __post_init__(self) -> None:
        if self.substeps is not None:
            raise ValueError("GaussJackson has one step for a whole arc: give max_step or a tolerance, not substeps")
        if self.tolerance is None and self.max_step is None:
            object.__setattr__(self, "tolerance", USUAL)
        super().__post_init__()
        if self.order != int(self.order) or not 4 <= self.order <= 14:
            raise ValueError(f"order is {self.order}; it must be a whole number from 4 to 14")

    @property
    def arc_scheme(self) -> tuple[Any, ...]:
        return ("gauss-jackson", int(self.order))
