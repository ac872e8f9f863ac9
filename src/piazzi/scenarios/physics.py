"""The half of a scenario file that is physics: states, equations of motion, parameters and sensors, read into a `Model`."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from typing import TYPE_CHECKING, Any, get_args

from piazzi.model import STEP, Model, Parameter, Role, Sensor
from piazzi.model.definitions import name_of
from piazzi.scenarios.earth import GROUPS, data_of, definitions_of, dynamics_of
from piazzi.scenarios.equations import Physics, equation, provided_names, read_definitions, read_roots
from piazzi.scenarios.functions import read_functions
from piazzi.scenarios.quantities import example_of, named_units, unit_of
from piazzi.scenarios.sensors import read_sensor
from piazzi.scenarios.table import Table
from piazzi.text import nearest, shown
from piazzi.units import ONE, Units, is_quantity

if TYPE_CHECKING:
    from piazzi.earth import Epoch, ForceChoice
    from piazzi.problem.checks import Array

MAX_STATES = 100


@lru_cache(maxsize=64)
def shared(model: Model) -> Model:
    """One object for all equal models, so that what is derived from it is derived once."""
    return model


def read_physics(file: Table, units: Units, epoch: Epoch | None = None, forces: ForceChoice | None = None) -> Physics:
    """Read [states], [memory], [groups], [dynamics] or [step], [parameters] and [sensors]; `forces` are those of [earth]."""
    before = len(file.faults)
    out = Physics(forces=forces)
    out.units |= named_units(file, "states", units, "state")
    out.states = list(out.units)
    if not out.states and len(file.faults) == before:
        file.fault("states", "is missing: name the states with their units")
    if len(out.states) > MAX_STATES:
        file.fault("states", f"has {len(out.states)} states; at most {MAX_STATES} are allowed")
    if not 0 < len(out.states) <= MAX_STATES:
        return out
    _memory(file.table("memory"), out)
    parameters = _parameters(file.table("parameters"), units, out)
    given = {} if forces is None or epoch is None else data_of(forces, epoch)
    out.functions = {**given, **read_functions(file.table("functions"), epoch)}
    known, solved = {*out.known, *([STEP] if "step" in file else [])}, file.table("roots")
    out.definitions = read_definitions(file.table("definitions"), {*known, *provided_names(solved.data)}, out)
    out.roots = read_roots(solved, {*known, *out.known, *provided_names(solved.data)}, out, out.functions)
    events = file.table("events")  # names, each with the definition whose zero it is
    out.events = {name: text for name in events.data if (text := events.text(name)) is not None}
    out.dynamics = _dynamics(file, out)
    sensors = [read_sensor(name, table, units, out, epoch) for name, table in file.table("sensors").tables()]
    out.groups = _groups(file, out)
    if len(file.faults) == before:
        labels = {s: out.units[s].label for s in out.states if out.units[s].label}
        with file.faults.at(""):
            out.model = shared(_model(out, parameters, [s for s in sensors if s is not None], labels, "step" in file))
    return out


def with_orbit(physics: Physics, epoch: Epoch | None, mean: Array, time: float) -> None:
    """Note where the prior has the satellite, and make the air about its orbit, if a force needs that."""
    if physics.forces is None or epoch is None:
        return
    order = [name for group in GROUPS.values() for name in group]
    physics.orbit = mean[[physics.states.index(name) for name in order]], time
    air = physics.forces.air(epoch, *physics.orbit)
    physics.functions |= {} if air is None else {"air": air}


def _model(out: Physics, parameters: list[Parameter], sensors: list[Sensor], labels: dict[str, str], discrete: bool) -> Model:
    dynamics, definitions, functions = out.dynamics, out.definitions, dict(out.functions)
    if out.forces is not None:
        dynamics = dynamics_of(out.forces, dynamics)
        out.events = {**out.forces.forces.events, **out.events}
        seen = [*(name for sensor in sensors for name in sensor.free_names), *out.events.values()]
        texts = [*dynamics.values(), *definitions.values(), *_texts(out.roots), *seen]
        definitions = definitions_of(out.forces, definitions, texts)
    equations = [dynamics[s] for s in out.states]
    own = out.memory, definitions, functions, out.roots, out.events
    return Model(
        out.states, equations, sensors, parameters, out.groups, labels, discrete, *own
    )  # fmt: skip


def _texts(roots: Mapping[str, Any]) -> list[str]:
    """Every equation of roots."""
    out: list[str] = []
    for root in roots.values():
        out += [root["root"], root["start"], *root["definitions"].values(), *_texts(root["roots"])]
    return out


def _memory(table: Table, out: Physics) -> None:
    """Names for what a state was at the epoch before."""
    for name in table.data:
        state = table.text(name)
        if state not in out.states:
            table.fault(name, f"must be the name of a state{nearest(str(state)[:60], out.states)}")
            continue
        with table.faults.at(table.at(name)):
            out.memory[name_of(name, "memory")] = state
            out.units[name] = out.units[state]


def _parameters(table: Table, units: Units, out: Physics) -> list[Parameter]:
    found = [_parameter(name, table, units, out) for name in table.data]
    parameters = [p for p in found if p is not None]
    out.constants = [p.name for p in parameters if p.role == "estimated"]
    return parameters


def _parameter(name: str, table: Table, units: Units, out: Physics) -> Parameter | None:
    """A parameter: a number, or a table with role and unit.  Its values are read with the other numbers."""
    given = table.raw(name)
    role, unit = "fixed", ONE
    if isinstance(given, Mapping):
        inner = table.table(name)
        role = inner.text("role", "fixed", get_args(Role)) or "fixed"
        unit = unit_of(inner, "unit", units)
    elif is_quantity(given):
        with table.faults.at(table.at(name)):
            unit = units.quantity(given)[1]
    elif units.declared:
        table.fault(name, f"is only a number, but the file is not in SI: write {{ value = ..., unit = {example_of(units)} }}")
    with table.faults.at(table.at(name)):
        if name in out.units:
            raise ValueError("is also a state: every name has one meaning")
        parameter = Parameter(name, role, unit.label)  # type: ignore[arg-type]
        out.units[name] = unit
        return parameter
    return None


def _dynamics(file: Table, out: Physics) -> dict[str, str]:
    """Text of every state's equation."""
    key = "step" if "step" in file else "dynamics"
    other = "dynamics" if "dynamics" in file else "earth" if out.forces is not None else ""
    if "step" in file and other:
        file.fault(other, "stands beside [step]: rates or a step x[k+1], not both")
        file.raw(other)
    if key not in file and out.forces is None:
        file.fault("dynamics", "is missing: give the rate of every state")
        return {}
    table = file.table(key)
    allowed = {*out.known, *([STEP] if key == "step" else [])}
    moved = () if out.forces is None else out.forces.forces.dynamics
    wanted = [state for state in out.states if state in table or state not in moved]
    equations = {state: equation(table, state, allowed, outside=out.functions) for state in wanted}
    for state in wanted:
        if state not in table:
            table.fault("", f"has no equation for state {state!r}")
    if out.states:
        table.finish()
    return equations


def _groups(file: Table, out: Physics) -> dict[str, tuple[str, ...]]:
    groups = {}
    table = file.table("groups")
    for name in table.data:
        members = table.raw(name)
        if not isinstance(members, list) or not all(isinstance(m, str) for m in members) or not members:
            table.fault(name, f"must be a list of states, not {shown(members)}")
            continue
        for member in members:
            if member not in out.estimated:
                table.fault(name, f"names {shown(member)}, which is not a state{nearest(member[:60], out.estimated)}")
        groups[name] = tuple(members)
    return groups
