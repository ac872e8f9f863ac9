"""An orbit with its covariance: at any date, in any frame, as elements."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from piazzi.determination.centres import EARTH, Centre
from piazzi.earth import Epoch
from piazzi.earth.rotation import TURNING, frame_named
from piazzi.earth.scales import Orientation
from piazzi.earth.subdaily import WITHIN_THE_DAY
from piazzi.orbit import Keplerian, state_axes, transform_root
from piazzi.orbit.axes import in_axes
from piazzi.problem.checks import Array
from piazzi.text import brief

FLOOR = 1e-15  # of a correlation's largest eigenvalue: rounding, below which none is written
KEPLERIAN = ("a", "e", "i", "raan", "argp", "nu")
UNITS = ("m", "", "rad", "rad", "rad", "rad")
ECLIPTIC = "ecliptic J2000"  # axes of elements about the Sun
OBLIQUITY = np.radians(84381.448 / 3600.0)  # of J2000, IAU 1976, as ephemerides of minor planets have it
TILT = np.array([
    [1.0, 0.0, 0.0],
    [0.0, np.cos(OBLIQUITY), np.sin(OBLIQUITY)],
    [0.0, -np.sin(OBLIQUITY), np.cos(OBLIQUITY)],
])  # fmt: skip
TO_ECLIPTIC = np.kron(np.eye(2), TILT)  # of states on the axes of EME2000
Beliefs = Callable[[Sequence[Epoch]], tuple[Array, Array]]


@dataclass(frozen=True, eq=False)
class Orbit:
    """States and covariances of one object.

    Parameters
    ----------
    epoch : where the answer stands
    frame : axes of what it gives
    centre : what it goes about
    eop : orientation of the Earth, for axes that turn with it; None for the tables
    beliefs : gives states (K, 6) and covariances (K, 6, 6) on the axes of the GCRF at K dates
    """

    epoch: Epoch
    frame: str
    beliefs: Beliefs
    centre: Centre = EARTH
    eop: Orientation | None = WITHIN_THE_DAY

    __repr__ = brief

    def at(self, epoch: Any = None) -> Array:
        """Position and velocity (6,) at a date, m and m/s; default where the answer stands."""
        return self._moved(self._epoch(epoch))[0]

    def covariance(self, epoch: Any = None, axes: str | None = None) -> Array:
        """Covariance (6, 6) of position and velocity, in `frame`, or in axes of the orbit: RTN, TNW (`state_axes`)."""
        root = self.root(epoch, axes)
        return np.asarray(root @ root.T)

    def root(self, epoch: Any = None, axes: str | None = None) -> Array:
        """Lower triangular root (6, 6) of that covariance, with a positive diagonal."""
        when = self._epoch(epoch)
        if axes is None or axes == self.frame:
            return self._moved(when)[1]
        mean, P = (values[0] for values in self.beliefs([when]))
        if axes.upper().startswith(("RTN", "TNW")):
            return transform_root(definite_root(P), state_axes(mean[:3], mean[3:], axes, self.centre.mu))
        return transform_root(definite_root(P), in_axes("GCRF", frame_named(axes), when, self.eop))

    def to(self, frame: str) -> Orbit:
        """The same orbit in other axes; those of the Earth turn as they did for its measurements."""
        return replace(self, frame=frame_named(frame))

    def elements(self, epoch: Any = None) -> dict[str, Any]:
        """Keplerian elements with their sigmas, SI and radians; None where there is no sigma, as of the pericentre of a circle.

        In axes that turn with the Earth there are no elements: they are those of the GCRF.  About the Sun they are those of the
        ecliptic and equinox of J2000.
        """
        frame = "GCRF" if self.frame in TURNING else self.frame
        frame = "EME2000" if self.centre.name == "sun" else frame
        orbit = self if frame == self.frame else self.to(frame)
        mean, root = orbit._moved(self._epoch(epoch))
        if self.centre.name == "sun":
            frame = ECLIPTIC
            mean, root = TO_ECLIPTIC @ mean, TO_ECLIPTIC @ root
        kind = Keplerian()
        values = kind.from_state(mean[:3], mean[3:], self.centre.mu)
        wrapped = np.where([False, False, False, True, True, True], values % (2.0 * np.pi), values)
        try:
            moved = kind.jacobian_from_state(mean[:3], mean[3:], self.centre.mu) @ root
            sigma: list[float | None] = np.sqrt((moved**2).sum(axis=1)).tolist()
        except ValueError:
            sigma = [None] * 6
        return {
            "names": list(KEPLERIAN), "units": list(UNITS), "mean": wrapped.tolist(), "sigma": sigma, "kind": "keplerian",
            "frame": frame,
        }  # fmt: skip

    def states(self, epochs: Sequence[Epoch]) -> tuple[Array, Array]:
        """States (K, 6) and roots (K, 6, 6) of their covariances at dates, in `frame`."""
        mean, P = self.beliefs(epochs)
        J = in_axes("GCRF", self.frame, epochs, self.eop)
        roots = np.stack([definite_root(one) for one in P]) if len(P) else P
        return np.asarray((J @ mean[..., None])[..., 0]), transform_root(roots, J)

    def _moved(self, when: Epoch) -> tuple[Array, Array]:
        if when == self.epoch:
            return self._here
        mean, roots = self.states([when])
        return mean[0], roots[0]

    @cached_property
    def _here(self) -> tuple[Array, Array]:
        mean, roots = self.states([self.epoch])
        return mean[0], roots[0]

    def _epoch(self, given: Any) -> Epoch:
        return self.epoch if given is None else Epoch(given)


def definite_root(P: Array) -> Array:
    """Lower triangular root of a covariance with a positive diagonal: what rounding has made negative is rounding again."""
    sigma = np.sqrt(np.abs(np.diag(P)))
    scale = np.where(sigma > 0.0, sigma, 1e-300)
    C = P / np.outer(scale, scale)
    values, vectors = np.linalg.eigh(0.5 * (C + C.T))
    root = vectors * np.sqrt(np.maximum(values, FLOOR * max(float(values[-1]), 1e-300)))
    return transform_root(scale[:, None] * root, np.eye(len(P)))


def root_of(covariance: Array) -> Array:
    """Lower triangular root of a covariance, in which what is singular is rounding."""
    return definite_root(0.5 * (covariance + covariance.T))
