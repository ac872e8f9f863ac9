"""Numbers of stations that are not known for certain become parameters of the model, each with a name of its own."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from piazzi.model import Model, Parameter, Sensor
from piazzi.model.renaming import renamed, with_names
from piazzi.problem.parts import Gaussian, Station
from piazzi.text import nearest


def with_station_constants(
    model: Model, stations: Sequence[Station], parameters: Mapping[str, Any]
) -> tuple[Model, list[Station], dict[str, Any]]:
    """The same problem without Gaussians among the numbers of its stations.

    A number ``xs`` of station ``337`` that is given as a Gaussian becomes the parameter ``xs_337``, estimated (or considered,
    where the station says so), in a copy of the sensor for that station.  A problem without any comes back as it is.
    """
    out, values = [], dict(parameters)
    for station in stations:
        if isinstance(station.considered, str):
            raise ValueError(f"station {station.name!r}: considered is {station.considered!r}; it must be a list of names")
        uncertain = [name for name, value in station.numbers.items() if isinstance(value, Gaussian)]
        for name in station.considered:
            if name not in uncertain:
                raise ValueError(
                    f"station {station.name!r} considers {name!r}, which must be a number given as Gaussian(mean, variance)"
                    f"{nearest(name, uncertain) if uncertain else ''}"
                )
        if not uncertain:
            out.append(station)
            continue
        sensor = model.sensor(station.sensor)
        for name in uncertain:
            if name not in model.numbers(sensor):
                raise ValueError(
                    f"station {station.name!r} gives {name!r}, which sensor {sensor.name!r} does not use"
                    f"{nearest(name, model.numbers(sensor))}"
                )
        names = {name: _free(constant_name(name, station.name), model) for name in uncertain}
        model = _extended(model, sensor, station, names)
        values |= {names[name]: station.numbers[name] for name in uncertain}
        rest = {k: v for k, v in station.numbers.items() if k not in names}
        out.append(replace(station, sensor=model.sensors[-1].name, numbers=rest, considered=()))
    return model, out, values


def constant_name(number: str, station: str) -> str:
    """The name in the model of a station's number that is estimated or considered."""
    return f"{number}_{_plain(station)}"


def _plain(name: str) -> str:
    """A station's name as part of a name in an equation."""
    return re.sub(r"[^A-Za-z0-9]+", "_", name).strip("_") or "station"


def _free(name: str, model: Model) -> str:
    """The name, with a number behind it where it is taken."""
    taken = {*model.moving, *model.parameter_names, *(n for d in model.definitions for n in d.provides)}
    for sensor in model.sensors:
        taken |= {*sensor.free_names, *(n for d in sensor.definitions for n in d.provides)}
    return next(n for n in (name, *(f"{name}_{i}" for i in range(2, len(taken) + 3))) if n not in taken)


def _extended(model: Model, sensor: Sensor, station: Station, names: Mapping[str, str]) -> Model:
    """The model with these numbers as parameters, and with a copy of the sensor that uses them, last."""
    units = dict(sensor.number_units)
    roles = {name: "considered" if name in station.considered else "estimated" for name in names}
    constants = tuple(Parameter(new, roles[old], units.get(old, "")) for old, new in names.items())  # type: ignore[arg-type]
    base, taken = f"{sensor.name}-{_plain(station.name)}", {s.name for s in model.sensors}
    label = next(n for n in (base, *(f"{base}-{i}" for i in range(2, len(taken) + 3))) if n not in taken)
    equations = {c: renamed(e, names) for c, e in zip(sensor.components, sensor.equations, strict=True)}
    left = {name: unit for name, unit in units.items() if name not in names}
    definitions = tuple(with_names(d, names) for d in sensor.definitions)
    visible = [renamed(rule, names) for rule in sensor.visible]
    copy = Sensor(label, equations, sensor.angles, dict(sensor.units), left, definitions, visible, (), sensor.on_sky)
    return replace(model, parameters=(*model.parameters, *constants), sensors=(*model.sensors, copy))
