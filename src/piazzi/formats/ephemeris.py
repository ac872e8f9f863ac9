"""`Ephemeris`: states and covariances of objects over time, as files of ephemerides hold them."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from piazzi.arrays import Array
from piazzi.earth import Epoch
from piazzi.formats.copying import reduced
from piazzi.text import brief, one_line


class Burn(NamedTuple):
    """A manoeuvre: ignition, seconds, change of mass in kg (NaN where not said), axes, and m/s along them."""

    epoch: Epoch
    duration: float
    mass: float
    frame: str
    delta_v: tuple[float, float, float]


@dataclass(frozen=True, eq=False, kw_only=True)
class Arc:
    """States of one object without a break of conventions: between manoeuvres, from one reference.

    Attributes
    ----------
    name, identifier : of the object
    centre, frame, scale : what positions are about, their axes by the CCSDS name, time scale of the file's dates; None where
        the file does not say
    frame_epoch : of axes that are held at an instant
    epoch, t : time zero, and (K,) seconds of TT past it
    position, velocity, acceleration : (K, 3), m and m/s and m/s^2; NaN where there are none
    clock, clock_rate : (K,) s and s/s of the object's own clock, NaN where there are none
    sigma : (K, 3) m, NaN where there are none
    covariance_t, covariance, covariance_frames : (C,) s, (C, 6, 6) in m and m/s, and the axes of each
    flags : (K,) text of each state (manoeuvre, prediction), or of no length
    lines : (K,) where each state stands in the file
    interpolation, degree : as the file recommends
    useable : first and last instant to interpolate between
    spacecraft : ``mass`` (kg), ``drag_area``, ``radiation_area`` (m^2), ``drag_coefficient``, ``radiation_coefficient``
    elements : osculating elements and ``gm`` beside the state, in SI, as a file may repeat it
    burns : manoeuvres
    said : every other keyword with its text
    """

    epoch: Epoch
    t: Array
    position: Array
    name: str = ""
    identifier: str = ""
    centre: str | None = None
    frame: str | None = None
    scale: str | None = None
    frame_epoch: Epoch | None = None
    velocity: Array = np.nan  # type: ignore[assignment]  # one number becomes all of them
    acceleration: Array = np.nan  # type: ignore[assignment]
    clock: Array = np.nan  # type: ignore[assignment]
    clock_rate: Array = np.nan  # type: ignore[assignment]
    sigma: Array = np.nan  # type: ignore[assignment]
    covariance_t: Array = field(default_factory=lambda: np.zeros(0))
    covariance: Array = field(default_factory=lambda: np.zeros((0, 6, 6)))
    covariance_frames: tuple[str, ...] = ()
    flags: tuple[str, ...] = ()
    lines: Array = 0  # type: ignore[assignment]
    interpolation: str | None = None
    degree: int | None = None
    useable: tuple[Epoch | None, Epoch | None] = (None, None)
    spacecraft: tuple[tuple[str, float], ...] = ()
    elements: tuple[tuple[str, float], ...] = ()
    burns: tuple[Burn, ...] = ()
    said: tuple[tuple[str, str], ...] = ()

    __repr__ = brief

    @property
    def called(self) -> str:
        """What messages call it: its name, on one printable line, or the object."""
        return one_line(self.name) or "the object"

    def __post_init__(self) -> None:
        put, count = object.__setattr__, len(np.atleast_1d(self.t))
        shapes: dict[str, tuple[int, ...]] = dict.fromkeys(("t", "clock", "clock_rate", "lines"), (count,))
        shapes |= dict.fromkeys(("position", "velocity", "acceleration", "sigma"), (count, 3))
        blocks = len(self.covariance_frames)
        shapes |= {"covariance_t": (blocks,), "covariance": (blocks, 6, 6)}
        for name, shape in shapes.items():
            values: Array = np.asarray(getattr(self, name), dtype=np.int64 if name == "lines" else np.float64)
            values = np.broadcast_to(values, shape) if values.ndim == 0 else values.view()
            if values.shape != shape:
                raise ValueError(f"arc of {self.name!r}: {name} has shape {values.shape}; it must be {shape}")
            values.setflags(write=False)
            put(self, name, values)
        if not np.isfinite(self.t).all():
            raise ValueError(f"arc of {self.name!r}: the time of state {int(np.argmin(np.isfinite(self.t)))} is not finite")

    def __len__(self) -> int:
        return len(self.t)

    def __reduce__(self) -> tuple[Any, ...]:
        return reduced(self)

    def instant(self, k: int) -> Epoch:
        """When a state is."""
        return self.epoch + float(self.t[k])


@dataclass(frozen=True, kw_only=True)
class MeanElements:
    """Elements of an orbit theory, which only that theory makes positions of.

    Attributes
    ----------
    epoch, theory : instant, and the theory (``SGP4``)
    elements : ``mean_motion`` (rad/s) or ``semi_major_axis`` (m), ``eccentricity``, ``inclination``, ``ascending_node``,
        ``argument_of_pericentre``, ``mean_anomaly`` (rad), ``gm``
    name, identifier, centre, frame, scale : as of `Arc`
    covariance, covariance_frame : (36,) of the 6 by 6 matrix of position and velocity in SI, row by row; empty where there
        is none
    spacecraft : as of `Arc`
    said : every keyword with its text, the parameters of two-line elements among them
    """

    epoch: Epoch
    theory: str
    elements: tuple[tuple[str, float], ...]
    name: str = ""
    identifier: str = ""
    centre: str | None = None
    frame: str | None = None
    scale: str | None = None
    covariance: tuple[float, ...] = ()
    covariance_frame: str | None = None
    spacecraft: tuple[tuple[str, float], ...] = ()
    said: tuple[tuple[str, str], ...] = ()

    __repr__ = brief

    @property
    def called(self) -> str:
        """What messages call it: its name, on one printable line, or the object."""
        return one_line(self.name) or "the object"


@dataclass(frozen=True, eq=False, kw_only=True)
class Ephemeris:
    """Arcs of one object or many, in the order of their file.

    Attributes
    ----------
    arcs : of one object, or of many
    mean : mean elements, of files that hold those
    file, format : where it came from
    said : every keyword of the header with its text
    assumed, open : what was assumed; what is not said, each with the option that would say it
    left_out : reasons and counts of lines that were not taken
    """

    arcs: tuple[Arc, ...]
    mean: tuple[MeanElements, ...] = ()
    file: str = ""
    format: str = ""
    said: tuple[tuple[str, str], ...] = ()
    assumed: tuple[str, ...] = ()
    open: tuple[str, ...] = ()
    left_out: tuple[tuple[str, int], ...] = ()

    __repr__ = brief

    @property
    def objects(self) -> tuple[str, ...]:
        """Names, each once."""
        return tuple(dict.fromkeys([arc.name for arc in self.arcs] + [elements.name for elements in self.mean]))

    def of(self, name: str) -> tuple[Arc, ...]:
        """Arcs of an object, by its name or identifier."""
        return tuple(arc for arc in self.arcs if name in (arc.name, arc.identifier))
