"""Errors that instruments make alike over a pass, or always: biases, scales and clocks as constants of the model.

A constant is added to a number that the sensor has (`range_bias`, `time_bias`, ...), in the rows of its stations alone: each
station picks its own by numbers that are one or zero, so that one sensor serves all, and other names and dates compile nothing.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from piazzi.arrays import median
from piazzi.determination.passes import pass_of_rows
from piazzi.determination.sensing import Measured
from piazzi.determination.unknowns import BIAS, CLOCK, PASS, Asked, Label
from piazzi.earth.sensors import Instrument
from piazzi.model import Sensor
from piazzi.model.renaming import renamed, with_names
from piazzi.problem import Gaussian
from piazzi.text import nearest, one_line

TIMES = 10.0  # times the noise of its rows is the sigma of a bias that nobody gives one
USUAL = {"time_bias": 1e-3, "range_scale": 1e-5}  # s, -: likewise


class Constant(NamedTuple):
    """A constant: the number that it is added to, stations of the problem that have it, its prior."""

    name: str
    number: str
    stations: tuple[int, ...]
    role: str
    sigma: float
    unit: str
    label: Label


def with_instruments(seen: Measured, given: Sequence[Asked]) -> Measured:
    """The measurements with these biases, scales and clocks.

    Raises
    ------
    ValueError
        For a kind or a station that there is not, and a share of the time that an instrument has not.
    """
    constants: list[Constant] = []
    for one in given:
        constants += _constants(seen, one, {c.number: sum(d.number == c.number for d in constants) for c in constants})
    if not constants:
        return seen
    sensors = {s.name: s for s in seen.sensors}
    own = {name: [c for c in constants if any(seen.stations[i].sensor == name for i in c.stations)] for name in sensors}
    stations = [
        replace(s, numbers={**s.numbers, **{f"is_{c.name}": float(i in c.stations) for c in own[s.sensor]}})
        for i, s in enumerate(seen.stations)
    ]
    return replace(
        seen,
        sensors=tuple(_extended(sensor, own[name]) if own[name] else sensor for name, sensor in sensors.items()),
        stations=tuple(stations),
        parameters={**seen.parameters, **{c.name: (c.role, Gaussian(0.0, c.sigma**2)) for c in constants}},
        labels_of_constants={**seen.labels_of_constants, **{c.name: c.label for c in constants}},
    )


def passes(seen: Measured) -> tuple[list[int], dict[tuple[str, int], tuple[str, str]]]:
    """The pass of each station of the problem, counted from 1 for each place; when each begins, and from when to when it is."""
    number, every = np.zeros(len(seen.tracking.row_times), dtype=np.int64), pass_of_rows(seen, seen.tracking, seen.rows)
    said: dict[tuple[str, int], tuple[str, str]] = {}
    count: dict[str, int] = {}
    for one in range(1, int(every.max(initial=0)) + 1):
        own = np.flatnonzero(every == one)
        label = seen.labels[seen.tracking.row_stations[own[0]]]
        number[own] = k = count[label] = count.get(label, 0) + 1
        ends = seen.tracking.row_times[own[[0, -1]]].tolist()
        first, last = (str(seen.epoch + x)[:16].replace("T", " ") for x in ends)
        begun = str(seen.epoch + float(seen.tracking.row_times[own[0]]))[:19]
        said[label, k] = begun, f"{first} to {last[11:] if last[:10] == first[:10] else last}"
    of_station = [int(number[seen.tracking.row_stations == s.name].max(initial=0)) for s in seen.stations]
    return of_station, said


def _constants(seen: Measured, one: Asked, before: Mapping[str, int]) -> list[Constant]:
    """The constants of an unknown: one for each station, or for each of its passes."""
    what = one.what
    kind, station = _parts(one)
    if what.per not in (None, PASS):
        raise ValueError(f"{one.option} {what}: what an instrument is off by has one value, or one per pass: /pass")
    number = "time_bias" if what.kind == CLOCK else f"{kind}_{what.kind}"
    _check_kind(seen, one, number, kind)
    labels = [seen.labels[s.name] for s in seen.stations]
    able = [i for i, s in enumerate(seen.stations) if number in _numbers(seen, s.sensor)]
    mine = [i for i in able if not station or labels[i].casefold() == station.casefold()]
    if not mine:
        there = list(dict.fromkeys(labels[i] for i in able))
        raise ValueError(f"{one.option} {what}: no station {one_line(station, 40)!r} measured so{nearest(station[:60], there)}")
    numbers, spans = passes(seen)
    groups: dict[tuple[str, int], list[int]] = {}
    for i in mine:
        groups.setdefault((labels[i], numbers[i] if what.per == PASS else 0), []).append(i)
    found = []
    for k, ((label, which), members) in enumerate(sorted(groups.items(), key=lambda g: g[0]), start=before.get(number, 0) + 1):
        name = f"{what.kind}.{label}" if what.kind == CLOCK else f"{what.kind}.{kind}.{label}"
        words = f"{_WORDS[what.kind].format(kind.replace('_', ' '))} of {label}"
        if which:
            begun, lasted = spans[label, which]
            name, words = f"{name}/{begun}", f"{words} in its pass {lasted}"
        unit = _unit(seen, number, kind)
        sigma = what.size(unit, _usual(seen, number, kind, members))
        found.append(Constant(f"{number}_{k}", number, tuple(members), one.role, sigma, unit, Label(name, words)))
    return found


_WORDS = {"bias": "bias of {}", "scale": "share by which {} is too long,", "clock": "what times are late by"}


def _parts(one: Asked) -> tuple[str, str]:
    """Kind of measurement and station of a name, "" for what it does not say."""
    _, _, rest = one.what.name.partition(".")
    if one.what.kind == CLOCK:
        return "", rest
    kind, _, station = rest.partition(".")
    return ("range_rate" if kind == "range_rate_averaged" else kind), station


def station_of(one: Asked, kind: str) -> str | None:
    """The station whose measurements of a kind have this bias, "" for all of them, None for what is no bias of that kind."""
    own, station = _parts(one)
    return station if one.what.kind == BIAS and own == kind else None


def _numbers(seen: Measured, sensor: str) -> Mapping[str, float]:
    return dict(getattr(next(s for s in seen.sensors if s.name == sensor), "defaults", ()))


def _check_kind(seen: Measured, one: Asked, number: str, kind: str) -> None:
    """Raise ValueError where no sensor has the number."""
    known = {name for s in seen.stations for name in _numbers(seen, s.sensor)}
    if number in known:
        return
    end = f"_{one.what.kind}"
    kinds = sorted(name.removesuffix(end) for name in known if name.endswith(end) and name != "time_bias")
    if one.what.kind == CLOCK or not kinds:
        raise ValueError(f"{one.option} {one.what}: nothing that was measured has such a number; it has no {one.what.kind}")
    raise ValueError(
        f"{one.option} {one.what}: no {one_line(kind, 40) or 'kind'!r} was measured"
        f"{nearest(f'{one.what.kind}.{kind[:60]}', [f'{one.what.kind}.{k}' for k in kinds])}"
    )


def _unit(seen: Measured, number: str, kind: str) -> str:
    if number == "time_bias":
        return "s"
    if not number.endswith(f"_{BIAS}"):
        return ""
    units = {c: dict(s.units).get(c, "") for s in seen.sensors for c in s.components}
    return units.get(kind, "")


def _usual(seen: Measured, number: str, kind: str, members: Sequence[int]) -> float:
    """The sigma where none is given."""
    if number in USUAL:
        return USUAL[number]
    sizes = []
    for i in members:
        components = next(s for s in seen.sensors if s.name == seen.stations[i].sensor).components
        noise = np.asarray(seen.stations[i].noise).reshape(-1)
        width = len(components)
        diagonal = np.diag(noise.reshape(width, width)) if noise.size == width**2 else np.broadcast_to(noise, width)
        sizes.append(float(diagonal[components.index(kind)]) ** 0.5)
    return TIMES * median(np.array(sizes))


def _extended(sensor: Any, constants: Sequence[Constant]) -> Instrument:
    """The sensor with these constants beside its numbers."""
    sums: dict[str, str] = {}
    for c in constants:
        sums[c.number] = f"{sums.get(c.number, c.number)} + is_{c.name}*{c.name}"
    names = {number: f"({text})" for number, text in sums.items()}
    base: Sensor = sensor
    return Instrument(
        base.name,
        {c: renamed(e, names) for c, e in zip(base.components, base.equations, strict=True)},
        base.angles,
        dict(base.units),
        {**dict(base.number_units), **{c.name: c.unit for c in constants}},
        tuple(with_names(d, names) for d in base.definitions),
        tuple(renamed(rule, names) for rule in base.visible),
        (),
        base.on_sky,
        defaults={**dict(sensor.defaults), **{f"is_{c.name}": 0.0 for c in constants}},
        roles={**dict(sensor.roles), **{c.name: c.role for c in constants}},
        makers=sensor.makers,
        mapping=sensor.mapping,
        priors=sensor.priors,
    )
