"""Quantities in the tables of a scenario: units of names, numbers with and without units, times, schedules."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from piazzi.model.definitions import name_of
from piazzi.problem.epochs import epoch_given
from piazzi.problem.parts import Schedule
from piazzi.scenarios.table import Table
from piazzi.text import shown
from piazzi.units import ONE, Unit, Units, is_quantity

if TYPE_CHECKING:
    from piazzi.earth import Epoch


def named_units(table: Table, key: str, units: Units, what: str) -> dict[str, Unit]:
    """Names with their units: a table of name to unit, or, where the file is in SI, a list of names."""
    value = table.raw(key)
    if value is None:
        return {}
    if isinstance(value, list) and units.declared:
        table.fault(
            key, f"is a list, but the file is not in SI: write name = unit for every {what}, such as {example_of(units)}"
        )
        return {}
    if isinstance(value, list) and all(isinstance(v, str) for v in value):
        if len(set(value)) < len(value):
            table.fault(key, f"names {next(v for v in value if value.count(v) > 1)!r} twice")
        pairs: Mapping[str, Any] = dict.fromkeys(value, "")
    elif isinstance(value, Mapping):
        pairs = value
    else:
        table.fault(key, f"must be a table of name = unit, not {shown(value)}")
        return {}
    out: dict[str, Unit] = {}
    inner = Table(pairs, table.at(key), table.faults)
    for name in pairs:
        with table.faults.at(inner.at(name)):
            out[name_of(name, what)] = unit_of(inner, name, units) if isinstance(value, Mapping) else ONE
    return out


def unit_of(table: Table, key: str, units: Units) -> Unit:
    """The unit that a key gives; dimensionless, after a fault, where it gives none that is known."""
    text = table.text(key)
    if text is None:
        if table.raw(key) is None and units.declared:
            table.fault(key, f"is missing: the file is not in SI, so give a unit, such as {example_of(units)}")
        return ONE
    with table.faults.at(table.at(key)):
        return units.unit(text)
    return ONE


def example_of(units: Units) -> str:
    """How a unit may be written, for messages."""
    return f"'length/time' (here {units.base[0]}/{units.base[2]}), or '1' for none"


def quantity(table: Table, key: str, units: Units, kind: str) -> float | None:
    """A number in the file's unit of that kind, or with its own, in SI."""
    value, unit = table.raw(key), units.unit(kind)
    if not isinstance(value, str):
        return table.number(key, unit.factor)
    with table.faults.at(table.at(key)):
        size, own = units.quantity(value)
        if own.powers != unit.powers:
            raise ValueError(f"is {shown(value)}, which is no {kind}")
        return size * own.factor
    return None


def read_schedule(table: Table, units: Units, epoch: Epoch | None, usual: Schedule | None = None) -> Schedule | None:
    """The keys every, from and until of a sensor or a station, in SI; `usual` has what is not said."""
    every = quantity(table, "every", units, "time")
    start, until = (_time(table, key, units, epoch) for key in ("from", "until"))
    if (every, start, until) == (None, None, None):
        return usual
    usual = usual or Schedule()
    with table.faults.at(table.path):
        return Schedule(
            usual.every if every is None else every,
            usual.start if start is None else start,
            usual.until if until is None else until,
        )
    return None


def _time(table: Table, key: str, units: Units, epoch: Epoch | None) -> float | None:
    """A time, or a date where the file has an epoch, in seconds."""
    value = table.raw(key)
    if not isinstance(value, str) or is_quantity(value):
        return quantity(table, key, units, "time")
    with table.faults.at(table.at(key)):
        if epoch is None:
            raise ValueError(f"is {shown(value)}, but the file has no epoch that a date could be counted from")
        date = epoch_given(value)
        return None if date is None else float(date - epoch)
    return None
