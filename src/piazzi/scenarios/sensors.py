"""Sensors of a scenario: components, the numbers that their stations give, and what they see when."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import TYPE_CHECKING

from piazzi.expressions import check
from piazzi.model import Sensor
from piazzi.model.definitions import name_of
from piazzi.model.functions import AT, STATION, STATION_TABLE
from piazzi.scenarios.earth_sensors import plain_sensor, read_instrument, units_of
from piazzi.scenarios.equations import OWN, Physics, defined_names, equation, provided_names, read_definitions, read_roots
from piazzi.scenarios.quantities import example_of, named_units, read_schedule, unit_of
from piazzi.scenarios.table import Table, joined
from piazzi.text import nearest
from piazzi.units import ONE, Unit, Units, is_quantity

if TYPE_CHECKING:
    from piazzi.earth import Epoch


def read_sensor(name: str, table: Table, units: Units, out: Physics, epoch: Epoch | None) -> Sensor | None:
    """A sensor from its components, the names of its stations' own numbers, and what it sees when; or of a kind."""
    if "kind" in table:
        return _instrument(name, table, units, out, epoch)
    numbers, out.defaults[name] = _own_numbers(table, units)
    out.schedules[name] = read_schedule(table, units, epoch)
    for clash in numbers.keys() & out.units.keys():
        table.fault("numbers", f"names {clash!r}, which is also a state or a parameter")
    outside = {*out.functions, AT, STATION}
    known = {*out.known, *numbers}
    solved = table.table("roots")
    known |= {*provided_names(solved.data)}
    definitions = read_definitions(table.table("definitions"), known, out, OWN, outside)
    roots = read_roots(solved, {*known, *defined_names(definitions)}, out, outside)
    for clash in {*defined_names(definitions)} & (numbers.keys() | {*out.defined}):
        table.fault("definitions", f"names {clash!r}, which has a meaning already")
    components = table.table("components")
    if not components.data:
        table.fault("components", "is missing: a sensor needs at least one equation")
    equations, angles, kinds = {}, [], {}
    on_sky: dict[str, str] = {}
    allowed = {*known, *defined_names(definitions)}
    for key in components.data:
        equations[key], kinds[key], angle, beside = _component(components, key, allowed, units, outside)
        angles += [key] if angle else []
        on_sky |= {key: beside} if beside else {}
    visible = _rules(table, allowed)
    table.finish()
    out.components[name], out.numbers[name] = kinds, numbers
    with table.faults.at(table.path):
        labels = {k: u.label for k, u in kinds.items() if u.label}
        used = Sensor(name, equations, tuple(angles), labels, {}, definitions, visible, roots).free_names
        own = {k: u.label for k, u in numbers.items() if u.label and k in used}
        sensor = Sensor(name, equations, tuple(angles), labels, own, definitions, visible, roots, on_sky)
        for unused in sorted(numbers.keys() - sensor.free_names):
            table.fault("numbers", f"names {unused!r}, which no equation uses{nearest(unused, sorted(sensor.free_names))}")
        return sensor
    return None


def _instrument(name: str, table: Table, units: Units, out: Physics, epoch: Epoch | None) -> Sensor | None:
    """A sensor of `piazzi.earth.sensors`; numbers and schedule as any other."""
    given, usual = _own_numbers(table, units)
    out.schedules[name] = read_schedule(table, units, epoch)
    instrument = read_instrument(name, table)
    if instrument is None:
        return None
    known = dict(instrument.defaults)
    for number in given:
        if number not in known:
            table.fault("numbers", f"names {number!r}, which no equation uses{nearest(number, known)}")
    numbers = {number: given.get(number, ONE) for number in known if number not in out.units}
    out.defaults[name] = {**{number: known[number] for number in numbers}, **usual}
    out.components[name], out.numbers[name], out.instruments[name] = units_of(instrument, units), numbers, instrument
    if epoch is not None:
        eop = None if out.forces is None else out.forces.eop
        out.functions |= {key: make(epoch, eop) for key, make in instrument.makers if key not in out.functions}
    for other in sorted(instrument.free_names - {*known, *out.known, STATION_TABLE}):
        table.fault("", f"uses {other!r}, which nothing defines: [earth] does, or a parameter is to be named so")
    labels = {component: unit.label for component, unit in out.components[name].items() if unit.label}
    with table.faults.at(table.path):
        return plain_sensor(instrument, labels)
    return None


def _own_numbers(table: Table, units: Units) -> tuple[dict[str, Unit], dict[str, float]]:
    """Units of the numbers that a sensor's stations give, and values of those that need not, such as ``mask = "10 deg"``."""
    given = table.raw("numbers")
    if not isinstance(given, Mapping) or not any(map(is_quantity, given.values())):
        return named_units(table, "numbers", units, "number"), {}
    found: dict[str, tuple[float, Unit]] = {}
    for name, value in given.items():
        if is_quantity(value):
            with table.faults.at(joined(table.at("numbers"), name)):
                found[name] = units.quantity(value)
    rest = {name: value for name, value in given.items() if not is_quantity(value)}
    out = named_units(Table({"numbers": rest}, table.path, table.faults), "numbers", units, "number")
    for name in found:
        with table.faults.at(joined(table.at("numbers"), name)):
            name_of(name, "number")
    out |= {name: unit for name, (_, unit) in found.items()}
    out = {name: out[name] for name in given if name in out}
    return out, {name: value * unit.factor for name, (value, unit) in found.items()}


def _rules(table: Table, allowed: Collection[str]) -> tuple[str, ...]:
    """Equations that are above zero where something can be seen."""
    rules = table.texts("visible")
    for i, text in enumerate(rules):
        with table.faults.at(joined(table.at("visible"), i) if isinstance(table.raw("visible"), list) else table.at("visible")):
            check(text, allowed)
    return rules


def _component(
    table: Table, key: str, allowed: Collection[str], units: Units, outside: Collection[str]
) -> tuple[str, Unit, bool, str]:
    """Equation and unit of a component, whether it is an angle, which wraps, and beside which other one on the sky."""
    if not isinstance(table.raw(key), Mapping):
        text = equation(table, key, allowed, OWN, outside)
        if units.declared:
            table.fault(key, f"has no unit, but the file is not in SI: write {{ equation = ..., unit = {example_of(units)} }}")
        if "atan2" in text:
            table.fault(key, 'uses atan2: say { equation = ..., unit = "rad" } for an angle, which wraps, or angle = false')
        return text, ONE, False, ""
    inner = table.table(key)
    if "equation" not in inner:
        inner.fault("equation", "is missing")
    text = equation(inner, "equation", allowed, OWN, outside)
    unit = unit_of(inner, "unit", units)
    angle = inner.flag("angle", unit.is_angle)
    if "atan2" in text and "unit" not in inner and "angle" not in inner:
        inner.fault("unit", 'is missing: say unit = "rad" for an angle, which wraps, or angle = false')
    beside = inner.text("on_sky", "") or ""
    inner.finish()
    return text, unit, bool(angle), beside
