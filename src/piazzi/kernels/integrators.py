"""How a continuous model becomes a step, x[k] -> x[k+1]: settings only; the steps themselves are generated."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import isfinite
from typing import Any

import numpy as np


@dataclass(frozen=True)
class Integrator:
    """Settings shared by all methods.

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

    @property
    def fragments(self) -> tuple[str, ...]:
        """The kernel fragments that carry a state over an interval with this method's step."""
        return ("arc_steps",)

    @property
    def noise_fragments(self) -> tuple[str, ...]:
        """The fragments that integrate process noise along this method's steps."""
        return ("noise_integral",)

    @property
    def in_lanes(self) -> bool:
        """Whether several states can take a step together: only where all of them do the same operations."""
        return True

    @property
    def chooses_steps(self) -> bool:
        """Whether the method answers for its own step error, so that the number of substeps does not."""
        return False

    @property
    def needs_times(self) -> bool:
        """Whether the length of its steps is chosen for the times of a run, so that it has none yet."""
        return False

    @property
    def arc_scheme(self) -> tuple[Any, ...]:
        """What the code of a whole arc depends on; () where an arc is one interval after the other."""
        return ()

    def counts(self, intervals: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
        """Substeps in each interval of that many seconds, int64 of the same shape."""
        if self.substeps is not None:
            same = np.empty(len(intervals), dtype=np.int64)
            same.fill(self.substeps)
            return same
        if self.max_step is None:
            raise ValueError(
                f"{type(self).__name__} chooses its step for the times of a run: give max_step, or a problem from "
                "problem.with_steps(times)"
            )
        # an interval that is a whole number of steps up to rounding keeps that number
        count = np.ceil(intervals / self.max_step * (1 - 1e-12))
        if count.size and not count.max() < 2**53:
            raise ValueError(f"max_step {self.max_step} s cuts an interval of {intervals.max():g} s into too many substeps")
        return np.asarray(np.maximum(count, 1), dtype=np.int64)


@dataclass(frozen=True)
class ConstantAcceleration(Integrator):
    """Constant acceleration over a substep: x + h v + h^2/2 a, v + h a (Taylor and Gross, NAVIGATION 71(3), 2024).

    States whose rate is itself a state are taken to second order, all others to first.
    """

    @property
    def scheme(self) -> tuple[Any, ...]:
        return ("constant-acceleration",)


Taylor = ConstantAcceleration  # its other name, after the authors of the founding text


@dataclass(frozen=True)
class Discrete(Integrator):
    """The step of a model given as x[k+1]: taken once per interval."""

    @property
    def default_substeps(self) -> int:
        return 1

    @property
    def scheme(self) -> tuple[Any, ...]:
        return ("discrete",)

    @property
    def chooses_steps(self) -> bool:
        return True


@dataclass(frozen=True)
class DormandPrince(Integrator):
    """Adaptive steps of order 8 with the variational equations, for truth and for tight tolerances.

    Parameters
    ----------
    rtol, atol : float
        The error of a step stays below `atol` + `rtol` times the length of the state, and of every column of the transition
        matrix.  The states of one group of the model (position, say) count as one vector, so that a component may pass
        through zero.  Both are compiled into the kernel: another tolerance is compiled anew, once.
    max_steps : int
        Per interval, rejected ones included.
    substeps, max_step : int, float, optional
        Parts of an interval that no step reaches beyond; default the whole interval.

    Notes
    -----
    Dormand and Prince's method with the error estimate of orders 5 and 3 combined (Hairer, Norsett and Wanner, Solving
    Ordinary Differential Equations I, 1993, II.5 and II.10).  Where a transition matrix is asked for, each of its columns is
    held to the tolerance as the state is, so that it is right at an equilibrium too; the matrix is the derivative of the steps
    taken.  A motion alone, as in simulation, is held to the state's error.  Process noise is integrated along the steps by
    a rule of order 10.  The last step ends on the epoch.  Where the steps become too small or too many, the result is NaN.
    """

    substeps: int | None = field(default=None, kw_only=True)
    max_step: float | None = field(default=None, kw_only=True)
    rtol: float = 1e-12
    atol: float = 1e-12
    max_steps: int = 100_000

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 1e-15 <= self.rtol < 1:
            raise ValueError(f"rtol is {self.rtol}; it must be at least 1e-15, the rounding of a double, and less than 1")
        if not (isfinite(self.atol) and self.atol >= 0):
            raise ValueError(f"atol is {self.atol}; it must be zero or more")
        if self.max_steps != int(self.max_steps) or not 1 <= self.max_steps <= 10**9:
            raise ValueError(f"max_steps is {self.max_steps}; it must be a whole number of 1 or more")

    @property
    def default_substeps(self) -> int:
        return 1

    @property
    def scheme(self) -> tuple[Any, ...]:
        return ("adaptive", float(self.rtol), float(self.atol), int(self.max_steps))

    @property
    def fragments(self) -> tuple[str, ...]:
        return ("adaptive_control", "arc_adaptive")

    @property
    def noise_fragments(self) -> tuple[str, ...]:
        return ("noise_lobatto", "noise_adaptive")

    @property
    def in_lanes(self) -> bool:
        return False

    @property
    def chooses_steps(self) -> bool:
        return True


@dataclass(frozen=True)
class Kepler(Integrator):
    """Two-body motion in closed form: exact over any interval, on any conic, with its state transition matrix.

    Parameters
    ----------
    mu : name or number
        The gravitational parameter: a parameter of the model (its partials follow where it is estimated), a state, or a number.
    position, velocity : name of a group of the model, or names of states
        In the order of the axes; any number of dimensions.
    substeps, max_step : int, float, optional
        Parts of an interval that no panel of the process noise reaches beyond; default the whole interval.  The motion needs
        none.

    Notes
    -----
    Process noise is integrated by a rule of order 10 over panels in which the orbit turns by 0.4 rad, to a relative error
    below 1e-8 on any conic; it is NaN where one interval needs more than a million of them.

    `Problem` checks that the dynamics are two-body motion; further states must be constant.  By universal functions, after
    Goodyear (1965) and Shepperd (Celestial Mechanics 35, 1985).
    """

    substeps: int | None = field(default=None, kw_only=True)
    max_step: float | None = field(default=None, kw_only=True)
    mu: str | float = "mu"
    position: str | tuple[str, ...] = "position"
    velocity: str | tuple[str, ...] = "velocity"

    def __post_init__(self) -> None:
        super().__post_init__()
        for what in ("position", "velocity"):
            value = getattr(self, what)
            object.__setattr__(self, what, value if isinstance(value, str) else tuple(str(s) for s in value))
        if not isinstance(self.mu, str) and not (isfinite(self.mu) and self.mu > 0):
            raise ValueError(f"mu is {self.mu}; it must be positive, or the name of a parameter")

    @property
    def default_substeps(self) -> int:
        return 1

    def axes(self, groups: Mapping[str, Sequence[str]]) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """Names of the position and velocity states of a model with these groups; raises ValueError where there are none."""
        found = []
        for what in ("position", "velocity"):
            value = getattr(self, what)
            if isinstance(value, str) and value not in groups:
                raise ValueError(
                    f"Kepler needs to know the {what}: the model has no group {value!r}; give it one, or name the states"
                )
            found.append(tuple(groups[value]) if isinstance(value, str) else value)
        return found[0], found[1]

    @property
    def scheme(self) -> tuple[Any, ...]:
        return ("kepler", self.mu, self.position, self.velocity)

    @property
    def fragments(self) -> tuple[str, ...]:
        return ("kepler", "arc_once")

    @property
    def noise_fragments(self) -> tuple[str, ...]:
        return ("noise_lobatto", "noise_kepler")

    @property
    def in_lanes(self) -> bool:
        return False

    @property
    def chooses_steps(self) -> bool:
        return True
