"""The section [earth]: forces about the Earth, which bring states, equations, parameters and data of their own."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from piazzi.model.pruning import redefined, used_definitions
from piazzi.scenarios.table import Table

if TYPE_CHECKING:
    from piazzi.earth import Epoch, ForceChoice
    from piazzi.problem.checks import Array

KINDS = dict.fromkeys(("x", "y", "z"), "length") | dict.fromkeys(("vx", "vy", "vz"), "length/time")
GROUPS = {"position": ("x", "y", "z"), "velocity": ("vx", "vy", "vz")}


def read_earth(table: Table, epoch: Epoch | None, base: Mapping[str, Any] | None = None) -> ForceChoice | None:
    """The forces that the section names; `base` has keys that hold where the section does not have them.

    Numbers are in SI, or texts with a unit; files are beside the scenario.
    """
    from dataclasses import fields

    from piazzi.earth.defaults import DATA, ForceChoice, force_field, read_data
    from piazzi.earth.forces import Forces

    before = len(table.faults)
    found: dict[str, Any] = {}
    data: dict[str, Any] = {}
    given = Table({**(base or {}), **table.data}, table.path, table.faults)
    for name in [f.name for f in fields(Forces)] + list(DATA):
        if name in given:
            with _refusals(given, name):
                read, out = (read_data, data) if name in DATA else (force_field, found)
                out[name] = read(name, given.raw(name), table.faults.folder)
    given.finish([*(f.name for f in fields(Forces)), *DATA])
    table.finish(table.data)
    if epoch is None:
        table.fault("", "needs dates: give the scenario an epoch, such as epoch = '2016-02-13T16:00:00 UTC'")
    if len(table.faults) > before:
        return None
    with _refusals(table, ""):
        return ForceChoice(Forces(**found), "[earth]", **data)
    return None


def with_forces(file: Table, choice: ForceChoice) -> Table:
    """The file with the states, groups and numbers of the forces beside its own; their units are known."""
    data = dict(file.data)
    usual: Mapping[str, Any]
    for key, usual in (("states", KINDS), ("groups", {name: list(of) for name, of in GROUPS.items()})):
        own = data.get(key, {})
        own = dict.fromkeys(own, "") if isinstance(own, list) and all(isinstance(name, str) for name in own) else own
        data[key] = {**usual, **own} if isinstance(own, Mapping) else own
    own = data.get("parameters", {})
    if isinstance(own, Mapping):
        for name in choice.forces.parameters:
            if name not in own and name not in choice.forces.values:
                file.faults.add(f"parameters.{name}", f"is missing: a force of [earth] needs it, in {unit_of(name)}")
        usual = {name: value for name, value in choice.forces.values.items() if name not in own}
        data["parameters"] = {name: _with_unit(name, value, choice) for name, value in {**own, **usual}.items()}
    out = Table(data, file.path, file.faults)
    out.finish(data)
    return out


def _with_unit(name: str, value: Any, choice: ForceChoice) -> Any:
    """A parameter of the forces in SI where it has no unit; any other as it is."""
    if name not in choice.forces.parameters or isinstance(value, str):
        return value
    unit = unit_of(name)
    return {"unit": unit, **value} if isinstance(value, Mapping) else {"value": value, "unit": unit}


def unit_of(name: str) -> str:
    """The unit of a parameter of forces."""
    from piazzi.earth import forces

    return forces.unit_of(name) or "1"


@contextmanager
def _refusals(table: Table, key: str) -> Iterator[None]:
    """Note what is wrong with a key: values and types that are refused, files that cannot be read."""
    try:
        yield
    except OSError as error:
        table.fault(key, f"{error.filename}: {error.strerror}" if error.filename else str(error))
    except (ValueError, TypeError) as error:
        table.fault(key, str(error))


def data_of(choice: ForceChoice, epoch: Epoch) -> dict[str, Any]:
    """The data of the forces; of air about an orbit that is not read yet, a place only, which `with_orbit` fills."""
    from piazzi.earth.force_air import NOWHERE

    return choice.functions(epoch, NOWHERE)


def step_of(states: Sequence[str], mean: Array) -> float:
    """The longest step (s) of order 8 on the orbit of a mean state; raises ValueError for one inside the Earth."""
    from piazzi.earth.geodetic import ELLIPSOIDS
    from piazzi.earth.stepping import longest_step

    r, v = (mean[[states.index(name) for name in GROUPS[group]]] for group in ("position", "velocity"))
    radius, flattening = ELLIPSOIDS["WGS84"]
    distance = float((r @ r) ** 0.5)
    if distance < radius * (1.0 - flattening):
        raise ValueError(f"is {distance / 1e3:,.0f} km from the centre of the Earth, which is below its surface")
    return longest_step(r, v)


def names_of(choice: ForceChoice) -> set[str]:
    """Every name that the forces define."""
    return {name.strip() for left in choice.forces.definitions for name in left.split(",")}


def dynamics_of(choice: ForceChoice, added: Mapping[str, str]) -> dict[str, str]:
    """Equations of motion by state: those of the forces, with what is added to them or is of further states."""
    forces = choice.forces.dynamics
    return {
        state: f"{forces[state]} + ({added[state]})"
        if state in forces and state in added
        else forces.get(state) or added[state]
        for state in (*forces, *(state for state in added if state not in forces))
    }


def definitions_of(choice: ForceChoice, own: Mapping[str, str], texts: Iterable[str]) -> dict[str, str]:
    """Definitions that equations and sensors need, of the forces and one's own, which replace those of the same names."""
    return used_definitions(redefined(choice.forces.definitions, own), texts) | dict(own)
