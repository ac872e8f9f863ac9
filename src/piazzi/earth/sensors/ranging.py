"""Ranges: the length of a signal's way, with the light time of each leg."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from piazzi.earth.sensors.air import Air
from piazzi.earth.sensors.instrument import Instrument, biased, one_of, with_parameters
from piazzi.earth.sensors.light import PATHS, TAGS, Light, light, shapiro
from piazzi.earth.sensors.text import used
from piazzi.earth.stations import Station
from piazzi.earth.tabulated import Place


def range(  # noqa: A001
    path: str = "two-way",
    *,
    name: str = "range",
    tag: str = "reception",
    steps: bool = False,
    relativity: bool = False,
    troposphere: str | None = None,
    mapping: str = "niell",
    ionosphere: str | None = None,
    time_bias: bool = False,
    biases: Mapping[str, str] | Sequence[str] = (),
    parameters: Mapping[str, str] | Sequence[str] = (),
    transmitter: Station | None = None,
    visible: Sequence[str] = (),
) -> Instrument:
    """A sensor of range (m): the mean length of the legs, each station and the satellite at its own event.

    A station gives the numbers ``range_bias`` (m), ``range_scale`` and ``centre_of_mass`` (m, what the reflector is nearer
    by): ``(1 + range_scale)*(legs + media - centre_of_mass) + range_bias``.

    Parameters
    ----------
    path : "one-way" from the satellite to the station, "two-way", or "three-way" from a `transmitter`
    name : of the sensor
    tag : "reception", "bounce" (of one way: when the satellite sends) or "transmission": what times of rows are
    steps : whether the satellite is carried to its event by a step of the dynamics, as beyond the orbit of the Moon, instead of
        by position, velocity and acceleration
    relativity : whether the gravity of the Earth delays the legs (Shapiro)
    troposphere : "saastamoinen" for radio, "mendes-pavlis" or "marini-murray" for lasers; the weather is the station's
    mapping : "niell" or "gmf", with "saastamoinen"
    ionosphere : "single-layer" or "klobuchar", whose numbers stations give, with ``frequency`` and ``uplink_frequency`` (Hz)
    time_bias : whether clocks are off: the number ``time_bias`` (s) is what times of the rows are late by
    biases : stations, or passes, whose biases are parameters ``range_bias_NAME``, estimated; or a mapping to other roles
    parameters : numbers such as ``range_bias`` that are parameters of the model, estimated, common to its stations; or a
        mapping to other roles
    transmitter : the other station of "three-way"
    visible : rules for simulation, see `Sensor`; ``elevation`` and ``mask`` are among its names where they are used

    Raises
    ------
    ValueError
        For a path, tag or medium that there is not.
    """
    one_of(path, PATHS, "path")
    one_of(tag, TAGS, "tag")
    ray = ray_of(path, tag, steps, relativity, time_bias, transmitter)
    ray.media(troposphere, ionosphere, "elevation" in " ".join(visible))
    total = " + ".join([ray.light.mean, *ray.delays])
    ray.numbers |= {"range_scale": 0.0, "centre_of_mass": 0.0}
    value, own, roles = biased(f"(1 + range_scale)*({total} - centre_of_mass)", "range", biases)
    return ray.instrument(name, {"range": value}, {"range": "m"}, own, roles, parameters, visible, mapping)


@dataclass
class Ray:
    """A signal between station and satellite: its light time, media, and the numbers that stations give."""

    light: Light
    instant: str
    makers: dict[str, Any] = field(default_factory=dict)
    delays: list[str] = field(default_factory=list)
    definitions: dict[str, str] = field(default_factory=dict)
    numbers: dict[str, float] = field(default_factory=dict)

    def media(self, troposphere: str | None, ionosphere: str | None, look: bool) -> None:
        """What lies between them, at the elevation from the receiving station, for the mean of the legs."""
        if not (troposphere or ionosphere or look):
            return
        air, leg = Air(), self.light.legs[0]
        air.look(self.instant, leg.satellite, leg.station)
        if troposphere:
            self.delays.append(air.troposphere(troposphere))
        if ionosphere:
            self.delays.append(air.ionosphere(ionosphere, len(self.light.legs)))
        self.definitions |= air.definitions
        self.numbers |= air.numbers

    def instrument(
        self,
        name: str,
        equations: Mapping[str, str],
        units: Mapping[str, str],
        own: Mapping[str, float],
        roles: Mapping[str, str],
        parameters: Mapping[str, str] | Sequence[str],
        visible: Sequence[str] = (),
        mapping: str = "niell",
        angles: Sequence[str] = (),
    ) -> Instrument:
        """The sensor of these components."""
        numbers = self.numbers | dict(own) | ({"mask": 0.0} if "mask" in " ".join(visible) else {})
        within = [text for root in self.light.roots.values() for text in root["definitions"].values()]
        definitions = used({**self.light.definitions, **self.definitions}, [*equations.values(), *visible, *within])
        given: tuple[Any, ...] = (name, equations, angles, units, {}, definitions, visible, self.light.roots)
        return Instrument(*given, *with_parameters(numbers, roles, parameters), self.makers, mapping)


def ray_of(path: str, tag: str, steps: bool, relativity: bool, time_bias: bool, transmitter: Station | None) -> Ray:
    """A signal, with its delay by gravity."""
    if (path == "three-way") != (transmitter is not None):
        raise ValueError("a three-way signal has a transmitter, and no other has one: give transmitter=earth.Station(...)")
    function = "transmitter"
    signal = light(path, tag, shift="- time_bias" if time_bias else "", steps=steps, transmitter=function)
    ray = Ray(signal, "t - time_bias" if time_bias else "t")
    if transmitter is not None:
        ray.makers[function] = Transmitter(transmitter)
    if time_bias:
        ray.numbers["time_bias"] = 0.0
    if relativity:
        found = [shapiro(leg) for leg in signal.legs]
        ray.definitions |= {key: text for _, more in found for key, text in more.items()}
        total = " + ".join(name for name, _ in found)
        ray.delays.append(total if len(found) == 1 else f"({total})/{len(found)}")
    return ray


@dataclass(frozen=True)
class Transmitter:
    """Makes the place of a transmitter."""

    station: Station

    def __call__(self, epoch: Any, eop: Any) -> Place:
        """For a problem's epoch."""
        return Place(self.station, epoch, eop)
