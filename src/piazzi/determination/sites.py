"""Stations on the ground by the names that files call them, with the weather of a pass."""

from __future__ import annotations

import errno
import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from piazzi.arrays import distinct
from piazzi.earth import Epoch, Place, Station, StationList, Weather, ilrs_stations, mpc_stations, read_stations
from piazzi.earth.scales import Orientation
from piazzi.formats import TAGS, Observations
from piazzi.problem.checks import Array
from piazzi.text import nearest, suggest

ABOARD = "aboard"  # column of rows that the object itself received
OWN = {"ilrs": ilrs_stations, "mpc": mpc_stations}  # lists of stations that have a name


@dataclass(frozen=True, eq=False)
class Context:
    """What makers of parts share.

    Attributes
    ----------
    observations : rows of one object, with sigmas of the station files where they had none
    epoch : time zero of the problem
    sites : stations, None where nobody gave any
    object : name of what is seen
    com : centre of mass, m, where the user says it
    corrected : whether the user says that measurements are corrected for media already
    open : whether the user says that they are not
    clocks : whether sensors have a number that times are late by
    about : what the orbit goes about
    antenna : where fixes are taken, m from the centre of mass along R, T and N, where the user says it
    partners : participants in orbit whose ephemerides are given, by name
    eop : orientation of the Earth; None for the tables
    left : reasons and counts of rows that makers leave out
    """

    observations: Observations
    epoch: Epoch
    sites: StationList | None
    object: str
    com: float | None = None
    corrected: bool = False
    open: bool = False
    clocks: bool = False
    about: str = "earth"
    antenna: tuple[float, float, float] | None = None
    partners: Mapping[str, Any] = field(default_factory=dict)
    eop: Orientation | None = None
    left: dict[str, int] = field(default_factory=dict)
    said: dict[str, None] = field(default_factory=dict)

    def site(self, index: int) -> Station:
        """The station of a participant; raises ValueError with how to give it."""
        name = self.observations.participants[index] if index >= 0 else ""
        if not name:
            raise ValueError(f"{self.where}the file does not say which station measured: no station can be found for it")
        return station_named(name, self.sites, self.where)

    def tag(self, row: int) -> str | None:
        """What the time of a row is of, transmit, bounce or receive; None where nobody says it."""
        return TAGS[self.observations.tag[row]] or self.observations.segments[int(self.observations.segment[row])].tag

    def partner(self, index: int) -> Any:
        """The participant in orbit that measured, None where it is a station."""
        return self.partners.get(self.observations.participants[index]) if index >= 0 else None

    def placed(self, sensor: Any, rows: Array, weather: Weather | None = None, **numbers: Any) -> tuple[dict[str, Any], Array]:
        """What a station of the problem is made of, for rows of one participant, and which of these can be used.

        Raises
        ------
        ValueError
            For a station that nobody gave, and a participant whose orbit is not known at any of the rows.
        """
        index = int(self.observations.station[rows[0]])
        known = {name: value for name, value in numbers.items() if name in dict(sensor.defaults)}
        partner = self.partner(index)
        if partner is None:
            site = self.site(index)
            place = None if self.about == "earth" else Place(site, self.epoch, about=self.about)
            given = sensor.at(None if place else site, self.epoch, 1.0, name=site.name, weather=weather, place=place, **known)
            return given, rows
        t = self.observations.t[rows] + (self.observations.epoch - self.epoch)
        table, usable = partner.place(self.epoch, t)
        if not usable.all():
            reason = f"rows when no orbit of {partner.name} is given"
            self.left[reason] = self.left.get(reason, 0) + int((~usable).sum())
        return sensor.at(None, self.epoch, 1.0, name=partner.name, place=table, **known), rows[usable]

    def functions(self, sensor: Any) -> dict[str, Any]:
        """The data of a sensor's functions: a transmitter is seen from what the orbit goes about, as a receiver is."""
        found = sensor.functions(self.epoch).items()
        return {name: replace(own, about=self.about) if isinstance(own, Place) else own for name, own in found}

    @property
    def where(self) -> str:
        """How messages begin."""
        return f"{self.observations.files[0]}: " if self.observations.files else ""


def station_named(name: str, sites: StationList | None, where: str = "") -> Station:
    """The station of a list; raises ValueError with how to give it."""
    if sites is None:
        raise ValueError(f"{where}where is station {name}? Give it with --stations FILE (TOML or SINEX), ilrs or mpc")
    found = matched(name, sites)
    if found is None:
        raise ValueError(f"{where}no station {name} in --stations{nearest(name, list(sites)[:2000])}")
    return found


def matched(name: str, sites: StationList) -> Station | None:
    """A station by its name, or by it without leading zeros or the letter of its point."""
    for known in (name, name.lstrip("0"), f"{name}A"):
        if known in sites:
            return sites[known]
    plain = {site.lstrip("0").casefold(): site for site in sites}
    key = plain.get(name.lstrip("0").casefold())
    return None if key is None else sites[key]


def sites_of(given: Any) -> StationList | None:
    """The stations that a user gives: files, ``ilrs``, ``mpc``, stations, lists of them; None for none."""
    if given is None or (isinstance(given, (list, tuple)) and not given):
        return None
    if isinstance(given, StationList):
        return given
    items: Iterable[Any] = [given] if isinstance(given, (str, os.PathLike, Station)) else given
    files: list[Any] = []
    found: list[Station] = []
    for item in items:
        if isinstance(item, Station):
            found.append(item)
        elif isinstance(item, StationList):
            found += item.stations
        elif isinstance(item, str) and item in OWN:
            found += OWN[item]().stations
        else:
            if isinstance(item, str) and not os.path.exists(item) and (hint := suggest(item, OWN)):
                raise FileNotFoundError(errno.ENOENT, f"{os.strerror(errno.ENOENT)}{hint}", item)
            files.append(item)
    if files:
        found += read_stations(*files).stations
    unique = {station.name: station for station in reversed(found)}  # the first of a name counts
    return StationList(tuple(reversed(unique.values())))


def oriented(data: Any, eop: Orientation | None) -> Any:
    """Data of a function, such as the place of a station, with this orientation of the Earth where they have one."""
    return replace(data, eop=eop) if eop is not None and hasattr(data, "eop") else data


def weather_of(observations: Observations, rows: Array, station: Station, epoch: Epoch) -> tuple[Weather, bool]:
    """The mean weather of rows, and whether it was measured; what is missing is standard for the height."""
    standard = Weather.standard(station.place(epoch)[2])
    values, measured = {}, True
    for name in ("pressure", "temperature", "humidity"):
        column = getattr(observations, name)[rows]
        known = column[np.isfinite(column)]
        measured &= bool(known.size)
        values[name] = float(known.mean()) if known.size else getattr(standard, name)
    return Weather(**values), measured


def with_station_sigmas(observations: Observations, sites: StationList | None) -> Array:
    """Sigmas (J,), those of the station files where rows have none."""
    sigma: Array = observations.sigma
    if sites is None or not np.isnan(sigma).any():
        return sigma
    sigma = sigma.copy()
    for i in distinct(observations.station):
        site = None if i < 0 else matched(observations.participants[i], sites)
        for kind, value in (site.sigma if site else {}).items():
            own = np.isnan(sigma) & (observations.station == i) & observations.of_kind(kind)
            sigma[own] = value
    return sigma


def aboard(rows: Observations) -> Array:
    """(J,) mask of rows that the object itself received."""
    column = rows.extra.get(ABOARD)
    return np.zeros(len(rows), dtype=bool) if column is None else np.asarray(column, dtype=bool)
