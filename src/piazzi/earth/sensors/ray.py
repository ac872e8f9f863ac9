"""A signal between station and satellite, from which sensors are made."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from piazzi.earth.sensors.air import Air
from piazzi.earth.sensors.instrument import Instrument, one_of, picked, with_parameters
from piazzi.earth.sensors.light import PATHS, TAGS, Light, light, shapiro
from piazzi.earth.sensors.visibility import rule
from piazzi.earth.stations import Station
from piazzi.earth.tabulated import Place
from piazzi.model.pruning import used_definitions


@dataclass
class Ray:
    """A signal between station and satellite: its light time, media, and the numbers that stations give.

    `received` is the instant when it is received, `prefix` that of all its names.
    """

    light: Light
    received: str
    prefix: str = ""
    makers: dict[str, Any] = field(default_factory=dict)
    delays: list[str] = field(default_factory=list)
    definitions: dict[str, str] = field(default_factory=dict)
    numbers: dict[str, float] = field(default_factory=dict)
    roles: dict[str, str] = field(default_factory=dict)

    @property
    def length(self) -> str:
        """Mean length of the legs with all delays, m."""
        return " + ".join([self.light.mean, *self.delays])

    def media(self, troposphere: str | None, ionosphere: str | None, advanced: bool = False) -> None:
        """What lies between them, at the elevation from the receiving station, for the mean of the legs.

        `advanced` is whether the ionosphere advances what is measured, as phases and Doppler.
        """
        if not (troposphere or ionosphere):
            return
        air, leg = Air(self.prefix), self.light.legs[0]
        air.look(self.received, leg.satellite, leg.station)
        if troposphere:
            self.delays.append(air.troposphere(troposphere))
        if ionosphere:
            delay = air.ionosphere(ionosphere, len(self.light.legs))
            self.delays.append(f"(-{delay})" if advanced else delay)
        self.definitions |= air.definitions
        self.numbers |= air.numbers

    def add(self, other: Ray) -> None:
        """What another signal needs, beside the own."""
        self.definitions |= {**other.light.definitions, **other.definitions}
        self.light = Light(self.light.definitions, {**self.light.roots, **other.light.roots}, self.light.legs)
        self.numbers |= other.numbers
        self.makers |= other.makers

    def instrument(
        self,
        name: str,
        equations: Mapping[str, str],
        parameters: Mapping[str, str] | Sequence[str],
        visible: Sequence[str] = (),
        **others: Any,
    ) -> Instrument:
        """The sensor of these components; `visible` are rules, `others` what else a sensor takes."""
        rules = [rule(given) for given in visible]
        for _, text, numbers in rules:
            self.definitions |= text
            self.numbers |= numbers
        visible = [text for text, _, _ in rules]
        within = [text for root in self.light.roots.values() for text in root["definitions"].values()]
        definitions = used_definitions({**self.light.definitions, **self.definitions}, [*equations.values(), *visible, *within])
        left, roles = with_parameters(self.numbers, self.roles, parameters)
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
        """A value with its bias: a number of the station, and parameters of stations or passes."""
        self.numbers[f"{component}_bias"] = 0.0
        return f"{value} + {component}_bias{self.picked(f'{component}_bias', biases)}"

    def picked(self, name: str, owners: Mapping[str, str] | Sequence[str]) -> str:
        """What is added for parameters of stations or passes."""
        text, numbers, roles = picked(name, owners)
        self.numbers |= numbers
        self.roles |= roles
        return text


def ray_of(
    path: str,
    tag: str,
    *,
    steps: bool = False,
    relativity: bool | str = False,
    time_bias: bool = False,
    transmitter: Station | None = None,
    shift: str = "",
    prefix: str = "",
    aboard: bool = False,
) -> Ray:
    """A signal, with its delay by gravity; `shift` is the text of what is added to times of rows."""
    one_of(path, PATHS, "path")
    one_of(tag, TAGS, "tag")
    if aboard and (path == "three-way" or tag != "reception"):
        raise ValueError(
            f"aboard receives {PATHS[0]} or {PATHS[1]} signals, and times are those of reception: not {path}, {tag}"
        )
    if (path == "three-way") != (transmitter is not None):
        raise ValueError("a three-way signal has a transmitter, and no other has one: give transmitter=earth.Station(...)")
    moved = " ".join([shift, *(["- time_bias"] if time_bias else [])]).strip()
    signal = light(path, tag, shift=moved, steps=steps, prefix=prefix, transmitter="transmitter", aboard=aboard)
    down, up = f" + {prefix}down", f" + {prefix}up"
    after = {"reception": "", "bounce": down, "transmission": down if path == "one-way" else up + down}
    ray = Ray(signal, f"t {moved}".strip() + after[tag], prefix)
    if transmitter is not None:
        ray.makers["transmitter"] = Transmitter(transmitter)
    if time_bias:
        ray.numbers["time_bias"] = 0.0
    if relativity:
        found = [shapiro(leg, "earth" if relativity is True else relativity) for leg in signal.legs]
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
