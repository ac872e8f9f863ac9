"""A signal between station and satellite, from which sensors are made."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from piazzi.earth.sensors.air import Air
from piazzi.earth.sensors.instrument import Instrument, biased, with_parameters
from piazzi.earth.sensors.light import Light, light, shapiro
from piazzi.earth.sensors.text import used
from piazzi.earth.stations import Station
from piazzi.earth.tabulated import Place


@dataclass
class Ray:
    """A signal between station and satellite: its light time, media, and the numbers that stations give.

    `instant` is when it is received.
    """

    light: Light
    instant: str
    makers: dict[str, Any] = field(default_factory=dict)
    delays: list[str] = field(default_factory=list)
    definitions: dict[str, str] = field(default_factory=dict)
    numbers: dict[str, float] = field(default_factory=dict)
    roles: dict[str, str] = field(default_factory=dict)

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
        parameters: Mapping[str, str] | Sequence[str],
        visible: Sequence[str] = (),
        **others: Any,
    ) -> Instrument:
        """The sensor of these components; `others` are what else a sensor takes."""
        numbers = self.numbers | ({"mask": 0.0} if "mask" in " ".join(visible) else {})
        within = [text for root in self.light.roots.values() for text in root["definitions"].values()]
        definitions = used({**self.light.definitions, **self.definitions}, [*equations.values(), *visible, *within])
        left, roles = with_parameters(numbers, self.roles, parameters)
        return Instrument(
            name,
            equations,
            definitions=definitions,
            visible=visible,
            roots=self.light.roots,
            defaults=left,
            roles=roles,
            makers=self.makers,
            **others,
        )

    def biased(self, value: str, component: str, biases: Mapping[str, str] | Sequence[str]) -> str:
        """A value with its bias."""
        text, numbers, roles = biased(value, component, biases)
        self.numbers |= numbers
        self.roles |= roles
        return text


def ray_of(path: str, tag: str, steps: bool, relativity: bool, time_bias: bool, transmitter: Station | None) -> Ray:
    """A signal, with its delay by gravity."""
    if (path == "three-way") != (transmitter is not None):
        raise ValueError("a three-way signal has a transmitter, and no other has one: give transmitter=earth.Station(...)")
    function = "transmitter"
    signal = light(path, tag, shift="- time_bias" if time_bias else "", steps=steps, transmitter=function)
    tagged = "t - time_bias" if time_bias else "t"
    received = {"reception": "", "bounce": " + down", "transmission": " + down" if path == "one-way" else " + up + down"}
    ray = Ray(signal, tagged + received[tag])
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
