"""What ``--add`` says: a further station -> what `piazzi.observability` takes."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from piazzi.model import Sensor
from piazzi.problem import Station
from piazzi.text import nearest

if TYPE_CHECKING:
    from piazzi.evaluate.observing import Addition
    from piazzi.problem import Problem

SYNTAX = "STATION, SENSOR:NUMBERS,sigma=S or NAME=EQUATION:NUMBERS,sigma=S[,angle]"
SITE = "site", "latitude", "longitude", "height"


def additions(problem: Problem, texts: tuple[str, ...]) -> list[Addition]:
    """The stations that these texts mean, in order; raises ValueError for one that cannot be read.

    ``radar`` is the station of that name once more; ``range:mx=-10,my=0,sigma=0.1`` a station with a sensor of the model;
    ``bearing=atan2(y, x):sigma=0.01,angle`` one with a sensor of its own.  Components are apart by semicolons, in SI units.
    ``range:site=7090,sigma=0.1`` and ``range:latitude=48deg,longitude=11deg,height=500m,sigma=0.1`` stand on the Earth, and are
    otherwise as the first station with that sensor.
    """
    taken = {station.name for station in problem.stations}
    known = {sensor.name for sensor in problem.model.sensors}
    out: list[Addition] = []
    for text in texts:
        try:
            found = _addition(problem, text, taken, known)
        except ValueError as error:
            raise ValueError(f"--add {text}: {error}") from None
        station = found[1] if isinstance(found, tuple) else found
        if isinstance(found, tuple):
            known.add(found[0].name)
        taken.add(station.name)
        out.append(found)
    return out


def _addition(problem: Problem, text: str, taken: set[str], known: set[str]) -> Addition:
    head, colon, tail = text.strip().rpartition(":")
    if not colon:
        return _once_more(problem, tail, taken)
    name, equals, equations = head.partition("=")
    name = name.strip()
    like = next((s for s in problem.stations if not equals and s.sensor == name and hasattr(s.place, "station")), None)
    numbers, sigmas, angle, where = _numbers(tail, SITE if like is not None else ())
    place = None
    if like is not None:
        numbers, place = _on_the_earth(like, numbers, where)
    if not equals:
        sensor = problem.model.sensor(name)
        if angle:
            raise ValueError(f"whether {name!r} is an angle is known: leave out angle")
    else:
        if name in known:
            raise ValueError(f"the model has a sensor {name!r} already: give the new one another name")
        parts = equations.split(";")
        components = [name] if len(parts) == 1 else [f"{name}{i + 1}" for i in range(len(parts))]
        sensor = Sensor(name, dict(zip(components, parts, strict=True)), angles=tuple(components) if angle else ())
    if len(sigmas) != sensor.width:
        need = "sigma=S" if sensor.width == 1 else "sigma=" + ";".join(f"S{i + 1}" for i in range(sensor.width))
        raise ValueError(f"sensor {name!r} needs {need}, {len(sigmas)} given")
    station = Station(_free(name, taken), sensor.name, np.array(sigmas) ** 2, numbers, place=place)
    return (sensor, station) if equals else station


def _once_more(problem: Problem, name: str, taken: set[str]) -> Station:
    names = [station.name for station in problem.stations]
    if name not in names:
        raise ValueError(f"no station has this name{nearest(name, names)}; a new one is written {SYNTAX}")
    found = problem.stations[names.index(name)]
    return replace(found, name=_free(name, taken), considered=())


def _on_the_earth(like: Station, numbers: dict[str, float], where: dict[str, str]) -> tuple[dict[str, float], Any]:
    """Numbers and place of a station at a site, all else as of `like`."""
    from piazzi.earth import ilrs_stations
    from piazzi.earth.sensors.instrument import local_numbers
    from piazzi.earth.station_files import station_of

    if {"site"} != where.keys() != {*SITE[1:]}:
        raise ValueError("give site=NAME of the ILRS, or latitude=, longitude= and height=, such as 48deg and 500m")
    if "site" in where:
        known = ilrs_stations()
        if where["site"] not in known:
            raise ValueError(f"no site of the ILRS is called {where['site']!r}{nearest(where['site'], list(known))}")
        station = known[where["site"]]
    else:
        plain = {key: text if re.search(r"[a-z]", text) else _number(key, text) for key, text in where.items()}
        station = station_of({"name": "added", **plain}, "site")
    place = replace(like.place, station=station)
    mapping = "gmf" if (like.numbers.get("bh"), like.numbers.get("bw")) == (0.0029, 0.00146) else "niell"  # constants of GMF
    local = {key: v for key, v in local_numbers(station, place.epoch, None, mapping).items() if key in like.numbers}
    return {**like.numbers, **local, **numbers}, place


def _numbers(text: str, places: tuple[str, ...]) -> tuple[dict[str, float], list[float], bool, dict[str, str]]:
    """Numbers of the station, standard deviations, whether it measures angles, and what is said of its place."""
    numbers: dict[str, float] = {}
    where: dict[str, str] = {}
    sigmas: list[float] = []
    angle = False
    for word in filter(None, (w.strip() for w in text.split(","))):
        name, equals, value = (part.strip() for part in word.partition("="))
        if word == "angle":
            angle = True
        elif name == "sigma" and equals:
            sigmas = [_number(name, part) for part in value.split(";")]
            for sigma in sigmas:
                if not 0 < sigma < float("inf"):
                    raise ValueError(f"sigma is {sigma:g}; it must be positive")
        elif equals and name in places:
            where[name] = value
        elif equals and re.fullmatch(r"[A-Za-z_]\w*", name):
            numbers[name] = _number(name, value)
        else:
            raise ValueError(f"{word!r} is not NAME=NUMBER; write {SYNTAX}")
    return numbers, sigmas, angle, where


def _number(name: str, text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise ValueError(f"{name} is {text!r}; it must be a number") from None


def _free(name: str, taken: set[str]) -> str:
    """The name, with a number behind it where it is taken."""
    candidate, i = f"added {name}", 1
    while candidate in taken:
        i += 1
        candidate = f"added {name} {i}"
    return candidate
