"""True forces, equations, data and numbers, where they differ from what estimators believe."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from piazzi.model.pruning import redefined
from piazzi.scenarios.earth import definitions_of, dynamics_of, names_of, read_earth, unit_of
from piazzi.scenarios.earth_sensors import read_true_place
from piazzi.scenarios.equations import Physics, equation
from piazzi.scenarios.functions import read_functions
from piazzi.scenarios.table import Table
from piazzi.text import nearest
from piazzi.units import Units, is_quantity

if TYPE_CHECKING:
    from piazzi.earth import Epoch, ForceChoice


@dataclass
class TruePhysics:
    """The parts of a `Truth` that are physics."""

    parameters: dict[str, float] = field(default_factory=dict)
    dynamics: dict[str, str] = field(default_factory=dict)
    definitions: dict[str, str] = field(default_factory=dict)
    functions: dict[str, Any] = field(default_factory=dict)
    stations: dict[str, dict[str, float]] = field(default_factory=dict)
    places: dict[str, Any] = field(default_factory=dict)


def read_true_physics(file: Table, table: Table, physics: Physics, units: Units, epoch: Epoch | None) -> TruePhysics:
    """The sections [truth.earth], [truth.dynamics], [truth.definitions], [truth.functions], ... of a file."""
    out = TruePhysics()
    forces = physics.forces
    if "earth" in table:
        base = file.raw("earth")
        if forces is None:
            table.fault("earth", "stands without [earth], whose states it moves")
            table.raw("earth")
            return out
        forces = read_earth(table.table("earth"), epoch, base)
        if forces is None:
            return out
        if not physics.orbit:
            return out  # the prior has faults
        meant = forces.functions(epoch, forces.air(epoch, *physics.orbit))  # type: ignore[arg-type]
        same = {name: f.checksum for name, f in physics.functions.items()}
        out.functions = {name: f for name, f in meant.items() if same.get(name) != f.checksum}
    out.functions |= read_functions(table.table("functions"), epoch)
    own = table.table("parameters")
    equations = table.table("dynamics"), table.table("definitions")
    further = _further(own, physics, forces, [str(text) for part in equations for text in part.data.values()])
    known = {*physics.known, *further, *({} if forces is None else names_of(forces))}
    known |= {name.strip() for left in equations[1].data for name in left.split(",")}
    outside = {*physics.functions, *out.functions}
    rates, definitions = ({key: equation(part, key, known, outside=outside) for key in part.data} for part in equations)
    for state in rates:
        if state not in physics.states:
            equations[0].fault(state, f"is no state{nearest(state[:60], physics.states)}")
    _collect(out, physics, forces, rates, definitions)
    out.parameters |= _numbers(own, physics, forces, further, units)
    out.stations, out.places = _stations(table.table("stations"), file, physics, epoch)
    return out


def _collect(
    out: TruePhysics, physics: Physics, forces: ForceChoice | None, rates: Mapping[str, str], definitions: Mapping[str, str]
) -> None:
    """Rates and definitions that are not those of the model."""
    if forces is None or physics.forces is None:
        out.dynamics, out.definitions = dict(rates), dict(definitions)
        return
    before, now = dynamics_of(physics.forces, physics.dynamics), dynamics_of(forces, {**physics.dynamics, **rates})
    own = redefined(physics.definitions, definitions)
    named = definitions_of(physics.forces, physics.definitions, [*before.values(), *physics.definitions.values()])
    meant = definitions_of(forces, own, [*now.values(), *own.values()])
    out.dynamics = {state: text for state, text in now.items() if text != before[state]}
    out.definitions = {left: text for left, text in meant.items() if text != named.get(left)}
    usual = physics.forces.forces.values
    out.parameters = {name: value for name, value in forces.forces.values.items() if usual.get(name) != value}


def _further(table: Table, physics: Physics, forces: ForceChoice | None, texts: Collection[str]) -> set[str]:
    """Parameters that only the truth has: those of its forces, and numbers that its equations name."""
    own = set() if forces is None else {*forces.forces.parameters}
    named = {name for name in table.data if any(name in text for text in texts)}
    return (own | named) - physics.units.keys()


def _numbers(
    table: Table, physics: Physics, forces: ForceChoice | None, further: Collection[str], units: Units
) -> dict[str, float]:
    """True values of parameters."""
    known = [name for name in physics.units if name not in (*physics.states, *physics.memory)] + sorted(further)
    out: dict[str, float] = {}
    for name in table.data:
        if name not in known:
            table.fault(name, f"is no parameter{nearest(name[:60], known)}")
            continue
        factor = physics.units[name].factor if name in physics.units else 1.0
        if is_quantity(table.raw(name)):
            with table.faults.at(table.at(name)):
                size, unit = units.quantity(table.raw(name))
                out[name] = size * unit.factor
            continue
        value = table.number(name, factor)
        out |= {} if value is None else {name: value}
    needed = () if forces is None else [n for n in forces.forces.parameters if n not in forces.forces.values]
    for name in needed:
        if name in further and name not in table:
            table.fault(name, f"is missing: a force of [truth.earth] needs it, in {unit_of(name)}")
    return out


def _stations(
    table: Table, file: Table, physics: Physics, epoch: Epoch | None
) -> tuple[dict[str, dict[str, float]], dict[str, Any]]:
    """True numbers of stations, and where they really are, by their names."""
    entries = {str(e.data.get("name")): e for e in file.array("stations")}
    sensors = list(physics.numbers)
    numbers: dict[str, dict[str, float]] = {}
    places: dict[str, Any] = {}
    for name, inner in table.tables():
        if name not in entries:
            table.fault(name, f"is no station{nearest(name[:60], entries)}")
            continue
        sensor = str(entries[name].data.get("sensor", sensors[0] if sensors else None))
        own = physics.numbers.get(sensor, {})
        place = read_true_place(inner, entries[name], physics.instruments.get(sensor), epoch)
        found = {key: inner.number(key, own[key].factor) for key in inner.data if key in own}
        inner.finish((*own, "moved", "place"))
        numbers[name] = {key: value for key, value in found.items() if value is not None}
        places |= {} if place is None else {name: place}
    return numbers, places
