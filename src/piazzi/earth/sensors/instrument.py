"""A sensor that knows the numbers of its own, and what a station gives for them."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from piazzi.earth import troposphere
from piazzi.earth.epoch import Epoch
from piazzi.earth.scales import Orientation
from piazzi.earth.stations import Station
from piazzi.earth.tabulated import Place
from piazzi.earth.weather import Weather
from piazzi.model import Sensor
from piazzi.model.functions import STATION_TABLE
from piazzi.text import brief, nearest

MAPPINGS = ("ah", "bh", "ch", "aw", "bw", "cw")


@dataclass(frozen=True)
class Instrument(Sensor):
    """A `Sensor` as `piazzi.earth.sensors` makes them; models and estimators take it as any other.

    Attributes
    ----------
    defaults : the numbers that stations give, with the values that they have where nothing is said
    roles : roles of the parameters that its equations use, for a model
    makers : functions from outside that it calls, beside those of the forces: `functions` makes their data
    mapping : "niell" or "gmf", by which the troposphere is mapped
    priors : mean and standard deviation that parameters may have, where the sensor knows any
    """

    defaults: Any = field(default=(), repr=False, compare=False)
    roles: Any = field(default=(), repr=False, compare=False)
    makers: Any = field(default=(), repr=False, compare=False)
    mapping: str = field(default="niell", repr=False, compare=False)
    priors: Any = field(default=(), repr=False, compare=False)

    if TYPE_CHECKING:

        def __init__(self, *given: Any, **named: Any) -> None: ...

    __repr__ = brief

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("defaults", "roles", "makers"):
            object.__setattr__(self, name, tuple(dict(getattr(self, name)).items()))

    @property
    def parameters(self) -> dict[str, str]:
        """Roles of the parameters that its equations use, by name, for a model."""
        return dict(self.roles)

    @property
    def signatures(self) -> dict[str, Any]:
        """Functions from outside that a model needs for it, beside those of the forces."""
        return self.functions(Epoch.at(0.0))

    @property
    def needs_place(self) -> bool:
        """Whether it has to know where the station is."""
        return STATION_TABLE in self.free_names or "latitude" in dict(self.defaults)

    def functions(self, epoch: Any, eop: Orientation | None = None) -> dict[str, Any]:
        """The data of `signatures` for a problem whose time zero is `epoch`; `eop` orients the Earth."""
        return {name: make(Epoch(epoch), eop) for name, make in self.makers}

    def at(
        self,
        station: Station | None = None,
        epoch: Any = None,
        sigma: Any = None,
        *,
        name: str | None = None,
        covariance: Any = None,
        weather: Weather | None = None,
        place: Any = None,
        tides: bool = True,
        eop: Orientation | None = None,
        **numbers: Any,
    ) -> dict[str, Any]:
        """What ``pz.Station(**...)`` takes for this sensor at a station.

        Parameters
        ----------
        station : on the ground; None for a sensor that has none
        epoch : the instant of the problem's time zero
        sigma : standard deviations of the components, SI; one for all of them, or one each; default those of the station
        name : default that of the station
        covariance : of the components, in place of `sigma`
        weather : at the station, of the pass; default standard for its height
        place : position and velocity over time (GCRF), a table of six columns, in place of a station on the ground
        tides : whether they move the station
        eop : orientation of the Earth; default the tables of the IERS
        numbers : values of `defaults` that differ, such as ``range_bias=0.1``; a Gaussian is estimated or considered

        Raises
        ------
        ValueError
            Where a number is not one of the sensor's, or standard deviations are neither given nor known.
        """
        known = dict(self.defaults)
        for given in numbers:
            if given not in known:
                raise ValueError(f"sensor {self.name!r} has no number {given!r}{nearest(given, known)}")
        called = name or (station.name if station else self.name)
        local: dict[str, float] = {}
        if self.needs_place and place is None:
            if station is None or epoch is None:
                raise ValueError(f"sensor {self.name!r} needs a station and the epoch of the problem")
            place = Place(station, Epoch(epoch), eop, tides)
            local = local_numbers(station, Epoch(epoch), weather, self.mapping)
        if station is not None:
            local |= {f"{kind}_bias": value for kind, value in station.bias.items()} | {"mask": station.mask}
        mine = {plain(called), plain(station.name) if station else ""}
        chosen = {key: float(key[3:] in mine) for key in known if key.startswith("is_")}
        noise = self._noise(called, sigma, covariance, station)
        values = known | {key: value for key, value in local.items() if key in known} | chosen | numbers
        return {"name": called, "sensor": self.name, "noise": noise, "numbers": values, "place": place}

    def _noise(self, name: str, sigma: Any, covariance: Any, station: Station | None) -> Any:
        if covariance is not None:
            return covariance
        if sigma is None and station is not None:
            sigma = [station.sigma.get(component) for component in self.components]
            sigma = None if None in sigma else sigma
        if sigma is None:
            raise ValueError(f"station {name!r} has no standard deviations of {', '.join(self.components)}: give sigma=")
        return np.broadcast_to(np.asarray(sigma, dtype=float), self.width) ** 2


def local_numbers(station: Station, epoch: Epoch, weather: Weather | None = None, mapping: str = "niell") -> dict[str, float]:
    """Numbers that follow from where a station is, and from the weather there, of whatever sensor."""
    latitude, longitude, height = station.place(epoch)
    air = weather or Weather.standard(height)
    found = {"latitude": latitude, "longitude": longitude, "height": height}
    found |= {"pressure": air.pressure, "temperature": air.temperature, "vapour": air.vapour}
    if mapping == "gmf":
        return found | troposphere.gmf_coefficients(latitude, longitude, epoch)
    return found | troposphere.niell_coefficients(latitude, epoch)


def plain(name: str) -> str:
    """A name of a station as part of a name in an equation."""
    return re.sub(r"[^A-Za-z0-9]+", "_", name).strip("_")


def picked(name: str, owners: Mapping[str, str] | Sequence[str]) -> tuple[str, dict[str, float], dict[str, str]]:
    """Parameters ``NAME_OWNER`` of stations or passes: text that is added, numbers of the station, roles.

    A number of each station picks its own parameter out of them, so that one sensor serves all.
    """
    roles = dict(owners) if isinstance(owners, Mapping) else dict.fromkeys(owners, "estimated")
    own = {plain(owner): role for owner, role in roles.items()}
    text = "".join(f" + is_{owner}*{name}_{owner}" for owner in own)
    return text, dict.fromkeys([f"is_{owner}" for owner in own], 0.0), {f"{name}_{owner}": role for owner, role in own.items()}


def with_parameters(
    numbers: Mapping[str, float], roles: Mapping[str, str], parameters: Mapping[str, str] | Sequence[str]
) -> tuple[dict[str, float], dict[str, str]]:
    """Numbers that stations give and roles of parameters, where some of the numbers are parameters of the model.

    Raises
    ------
    ValueError
        For a parameter that is not one of the numbers.
    """
    asked = dict(parameters) if isinstance(parameters, Mapping) else dict.fromkeys(parameters, "estimated")
    for name in asked:
        if name not in numbers:
            raise ValueError(f"parameters has {name!r}, which the sensor does not use{nearest(name, numbers)}")
    return {name: value for name, value in numbers.items() if name not in asked}, {**roles, **asked}


def one_of(value: Any, known: Sequence[str], what: str) -> None:
    """Raise ValueError for a choice that there is not."""
    if value not in known:
        raise ValueError(f"{what} is {value!r}; there are {', '.join(known)}{nearest(str(value), known)}")
