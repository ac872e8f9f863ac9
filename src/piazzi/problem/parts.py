"""The numbers that a problem is made of."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from piazzi.kernels import Integrator
from piazzi.problem.checks import Array, Locked, numeric
from piazzi.text import brief


@dataclass(frozen=True, eq=False)
class Gaussian(Locked):
    """A belief: mean (n,) and covariance (n, n), in the order and the units of the states.

    A vector of n numbers as covariance is its diagonal; one number each describes a single value.
    """

    mean: Any
    covariance: Any

    __repr__ = brief

    @classmethod
    def from_sigma(cls, mean: Any, sigma: Any) -> Gaussian:
        """Independent values with these standard deviations."""
        return cls(mean, np.diag(np.atleast_1d(numeric(sigma, "sigma")) ** 2))


@dataclass(frozen=True, eq=False)
class ProcessNoise(Locked):
    """White noise that drives the states.

    Parameters
    ----------
    covariance : (n, n), or its diagonal (n,); semidefinite, zero allowed
    per : "second" (a spectral density, unit^2/s) or "step" (added once per interval, whatever its length)
    method : "integral" or "scaled"
        How a density becomes the covariance Q of one interval: the integral of Phi Q Phi^T over it, or Q dt.
    axes : "states" or "orbit"
        With "orbit", the entries of the groups position and velocity are along the radius, transverse (towards the motion)
        and, in three dimensions, along the orbit's normal, wherever the state is: along the way for an integral, at the end
        of the interval otherwise.
    """

    covariance: Any
    per: Literal["second", "step"] = "second"
    method: Literal["integral", "scaled"] = "integral"
    axes: Literal["states", "orbit"] = "states"

    __repr__ = brief

    def __post_init__(self) -> None:
        for what, valid in (("per", ("second", "step")), ("method", ("integral", "scaled")), ("axes", ("states", "orbit"))):
            if getattr(self, what) not in valid:
                raise ValueError(f"process noise: {what} is {getattr(self, what)!r}; it must be one of {', '.join(valid)}")

    @property
    def is_integral(self) -> bool:
        return self.per == "second" and self.method == "integral"

    def scale(self, intervals: Array) -> Array:
        """Factor of the matrix in each interval."""
        return np.ones(len(intervals)) if self.per == "step" else intervals


@dataclass(frozen=True)
class Schedule:
    """At which of the times of a simulation a station measures: from `start` to `until`, both included, once `every` seconds.

    Times are the same that differ by a nanosecond, or by what rounding leaves.  Times of `every` count from `start`, or else
    from zero.
    """

    every: float | None = None
    start: float | None = None
    until: float | None = None

    __repr__ = brief

    def __post_init__(self) -> None:
        for what in ("every", "start", "until"):
            value = getattr(self, what)
            if value is not None and not np.isfinite(value):
                raise ValueError(f"schedule: {what} is {value}; it must be finite")
        if self.every is not None and self.every <= 0:
            raise ValueError(f"schedule: every is {self.every:g} s; it must be positive")
        if self.start is not None and self.until is not None and self.until < self.start:
            raise ValueError(f"schedule: until is {self.until:g} s, before the start at {self.start:g} s")

    def __str__(self) -> str:
        said = (("every", self.every), ("from", self.start), ("until", self.until))
        return " ".join(f"{word} {value:g} s" for word, value in said if value is not None)

    def has(self, times: Array) -> Array:
        """Which of these times are in it."""
        near = 1e-9 + 1e-15 * np.abs(times)
        out = np.ones(np.shape(times), dtype=bool)
        if self.start is not None:
            out &= times >= self.start - near
        if self.until is not None:
            out &= times <= self.until + near
        if self.every is not None:
            since = times - (self.start or 0.0)
            out &= np.abs(since - self.every * np.round(since / self.every)) <= near
        return out


@dataclass(frozen=True, eq=False)
class Station(Locked):
    """A place that measures: a sensor of the model, its noise R (m, m) and the sensor's own numbers.

    `noise` is a full covariance matrix, a diagonal, or one variance; SI units and radians.  A number that is not known for
    certain is a ``Gaussian(mean, variance)``: it is estimated with the states, under its own name and the station's
    (``bias`` of station ``north`` is ``bias_north``), or, where `considered` names it, inflates the covariance only.
    `schedule` says when it measures in simulation, beside the sensor's rules of what is visible.
    `place` is where a station stands whose sensor calls ``station(t)``: a table of position and velocity over time.
    """

    name: str
    sensor: str
    noise: Any
    numbers: Mapping[str, Any] = field(default_factory=dict)
    considered: Sequence[str] = ()
    schedule: Schedule | None = None
    place: Any = None

    __repr__ = brief


@dataclass(frozen=True, eq=False)
class Manoeuvre:
    """A sudden change of the state: what was commanded, and how far the engine may have been off.

    Parameters
    ----------
    time : float
        Seconds, after the prior.  A manoeuvre at the time of a measurement happened just before it; times are the same that
        differ by no more than 1e-12 of themselves, or a picosecond.
    delta_v : (d,)
        Added to the velocity.
    covariance : (d, d), or its diagonal (d,); semidefinite; default zero
        Of the error of `delta_v`.
    states : name of a group of the model, or names of states
        What jumps; default the group "velocity".
    """

    time: float
    delta_v: Any
    covariance: Any = None
    states: str | Sequence[str] = "velocity"

    __repr__ = brief


@dataclass(frozen=True, eq=False)
class Truth:
    """What really happens where that differs from what the estimators assume; used by simulation only.

    Parameters
    ----------
    state : (n,) or None
        The true first state; None draws it from the prior.
    parameters : mapping of name to number
        True values of parameters that differ.
    process_noise : ProcessNoise or None
        None: the same as the estimators assume.
    integrator : Integrator or None
        None: the same.
    measurement_noise : bool
        False gives noiseless measurements.
    manoeuvres : sequence of Manoeuvre, or None
        None: the same, each with an error drawn from its covariance.
    accept : sequence of equations
        Which drawn first states count: those where each of these, of states and parameters, is above zero.
    dynamics : mapping of state to equation
        True rates of change that differ.
    definitions : mapping of name to equation
        Definitions that differ, or that those rates need.  Parameters that only the truth has are among `parameters`.
    functions : mapping of name to function from outside
        True data of functions that differ, or further functions.
    stations : mapping of a station's name to numbers by name
        True numbers of stations that differ.
    places : mapping of a station's name to its place
        True places of stations that differ, as `Station.place` is.
    """

    state: Any = None
    parameters: Mapping[str, float] = field(default_factory=dict)
    process_noise: ProcessNoise | None = None
    integrator: Integrator | None = None
    measurement_noise: bool = True
    manoeuvres: Sequence[Manoeuvre] | None = None
    accept: Sequence[str] = ()
    dynamics: Mapping[str, Any] = field(default_factory=dict)
    definitions: Mapping[str, Any] = field(default_factory=dict)
    functions: Mapping[str, Any] = field(default_factory=dict)
    stations: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    places: Mapping[str, Any] = field(default_factory=dict)

    __repr__ = brief
