"""What a search for initial orbits found: modes with probabilities, where they part next, or a ridge."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from piazzi.determination.centres import centre_of
from piazzi.determination.ridge import Ridge
from piazzi.earth import Epoch
from piazzi.problem import Gaussian
from piazzi.problem.checks import Array
from piazzi.text import brief

SCHEMA = "piazzi.orbits/1"
STATES = ("x", "y", "z", "vx", "vy", "vz")


@dataclass(frozen=True, eq=False)
class OrbitMode:
    """One orbit that fits.

    Attributes
    ----------
    epoch : the first row that was used
    mean : (6,) m, m/s, on the axes of the problem
    covariance : (6, 6)
    probability : among all that fit, by Laplace's approximation of the evidence, before the full model if none of it ended
    weighted_rms : of the residuals in their sigmas
    rows : how many it was fitted to
    why_not : why it is no orbit that a body can be on for a whole turn, such as one through the Earth; empty for others
    """

    epoch: Epoch
    mean: Array
    covariance: Array
    probability: float
    weighted_rms: float
    rows: int
    why_not: str = ""

    @property
    def prior(self) -> Gaussian:
        """What it believes at its epoch, as a problem takes it."""
        return Gaussian(self.mean, self.covariance)

    def to_dict(self, scale: str | None = None) -> dict[str, Any]:
        """As JSON has it, the epoch in a scale."""
        return {
            "probability": self.probability, "epoch": str(self.epoch) if scale is None else self.epoch.to(scale),
            "mean": self.mean.tolist(), "covariance": self.covariance.tolist(), "weighted_rms": self.weighted_rms,
            "rows": self.rows, "why_not": self.why_not,
        }  # fmt: skip


@dataclass(frozen=True)
class Parting:
    """Where two orbits are farthest apart soon after the last row: an instant, the station that sees it, m, and rad there."""

    epoch: Epoch
    station: str
    distance: float
    angle: float

    def to_dict(self) -> dict[str, Any]:
        """As JSON has it."""
        return {"epoch": str(self.epoch), "station": self.station, "distance": self.distance, "angle": self.angle}

    def __str__(self) -> str:
        degrees = np.degrees(self.angle)
        return f"{self.distance / 1e3:,.1f} km, {degrees:.3g} deg on the sky of {self.station}, on {self.epoch}"


@dataclass(frozen=True)
class Beyond:
    """Rows that an orbit does not reach.

    Attributes
    ----------
    rows : how many
    epoch, gap : of the nearest, and how far it is from those that the orbit is fitted to, s
    turns : sigma of the number of revolutions until there; 0 where it is known and no orbit fits these rows too
    """

    rows: int
    epoch: Epoch
    gap: float
    turns: float

    def to_dict(self) -> dict[str, Any]:
        """As JSON has it."""
        return {"rows": self.rows, "epoch": str(self.epoch), "gap": self.gap, "turns": self.turns}

    def __str__(self) -> str:
        days = self.gap / 86400.0
        why = f"revolutions until there are known to +- {self.turns:.2g} only" if self.turns else "no orbit fits them too"
        return f"{self.rows} rows do not belong to that arc: the nearest is {days:,.3g} days away, on {self.epoch}, and {why}"


@dataclass(frozen=True, eq=False)
class InitialOrbits:
    """Orbits that fit, the most probable first.

    Attributes
    ----------
    modes : the orbits
    starts, fits : of two-body motion, from how many starts, and how many ended
    apart : where the first two part next; None where there is one
    about : what they go about, "earth" or "sun"
    ridge : what is known where the measurements are too few for an orbit; there are no modes then
    beyond : rows that the orbits were not fitted to; None where they were fitted to all
    """

    modes: tuple[OrbitMode, ...]
    starts: int
    fits: int
    apart: Parting | None = None
    about: str = "earth"
    ridge: Ridge | None = None
    beyond: Beyond | None = None

    __repr__ = brief

    def to_dict(self) -> dict[str, Any]:
        """The object of schema piazzi.orbits/1: m, m/s, rad."""
        centre = centre_of(self.about)
        scale = centre.scale if centre.name == "sun" else None
        return {
            "schema": SCHEMA, "about": self.about, "frame": centre.frame, "starts": self.starts, "fits": self.fits,
            "names": list(STATES), "modes": [mode.to_dict(scale) for mode in self.modes],
            "apart": None if self.apart is None else self.apart.to_dict(),
            "ridge": None if self.ridge is None else self.ridge.to_dict(),
            "beyond": None if self.beyond is None else self.beyond.to_dict(),
        }  # fmt: skip

    def __str__(self) -> str:
        rest = [] if self.beyond is None else [str(self.beyond)]
        if self.ridge is not None:
            return "\n".join([str(self.ridge), *rest])
        many = "1 orbit fits" if len(self.modes) == 1 else f"{len(self.modes)} orbits fit"
        lines = [f"{many} about the {self.about.title()} ({self.fits} fits from {self.starts} starts)"]
        for mode in self.modes:
            r, v = np.linalg.norm(mode.mean[:3]) / 1e3, np.linalg.norm(mode.mean[3:])
            where = f"{r:,.1f} km from the centre at {v:,.1f} m/s on {mode.epoch}"
            lines.append(f"  probability {mode.probability:.3f}: {where}, weighted RMS {mode.weighted_rms:.2f} of {mode.rows}")
            lines += [f"    {mode.why_not}"] if mode.why_not else []
        if self.apart is not None:
            lines.append(f"The first two part by {self.apart}")
        return "\n".join([*lines, *rest])


class UndeterminedError(ValueError):
    """Measurements leave a ridge of orbits, which `orbits` says; no orbit can be determined from them."""

    def __init__(self, orbits: InitialOrbits) -> None:
        super().__init__(f"the measurements leave {orbits}")
        self.orbits = orbits

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self.orbits,)
