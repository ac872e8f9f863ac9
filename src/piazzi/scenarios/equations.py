"""Texts of equations in a scenario, with the names that may occur in them, and what else its physics says."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from piazzi.expressions.outside import check_calls
from piazzi.model import TIME, Model
from piazzi.problem.parts import Schedule
from piazzi.scenarios.earth import names_of
from piazzi.scenarios.table import Table
from piazzi.text import shown
from piazzi.units import ONE, Unit

if TYPE_CHECKING:
    from piazzi.earth import ForceChoice

OWN = "; numbers of each station's own are named in the sensor's numbers"


@dataclass
class Physics:
    """What the equations' half says: the model, None where it is faulty, and the unit of every name.

    `forces` are those of [earth]; `dynamics`, `definitions` and `functions` what the file has beside them.
    `orbit` is (6,) in m and m/s of the prior, and its time in s past the epoch.
    `defaults` are numbers in SI for stations of a sensor that give none, `schedules` those of stations without their own.
    """

    model: Model | None = None
    states: list[str] = field(default_factory=list)
    memory: dict[str, str] = field(default_factory=dict)
    constants: list[str] = field(default_factory=list)
    groups: dict[str, tuple[str, ...]] = field(default_factory=dict)
    units: dict[str, Unit] = field(default_factory=dict)
    components: dict[str, dict[str, Unit]] = field(default_factory=dict)
    numbers: dict[str, dict[str, Unit]] = field(default_factory=dict)
    definitions: dict[str, str] = field(default_factory=dict)
    roots: dict[str, Any] = field(default_factory=dict)
    functions: dict[str, Any] = field(default_factory=dict)
    forces: ForceChoice | None = None
    dynamics: dict[str, str] = field(default_factory=dict)
    events: dict[str, str] = field(default_factory=dict)
    defaults: dict[str, dict[str, float]] = field(default_factory=dict)
    instruments: dict[str, Any] = field(default_factory=dict)
    schedules: dict[str, Schedule | None] = field(default_factory=dict)
    orbit: tuple[Any, float] | None = None

    @property
    def known(self) -> set[str]:
        """Every name that has a value in equations of motion."""
        own = {*self.units, *self.defined, TIME}
        return own if self.forces is None else own | names_of(self.forces)

    @property
    def estimated(self) -> list[str]:
        """Everything that is estimated, in the order of `Model.names`."""
        return [*self.states, *self.memory, *self.constants]

    @property
    def defined(self) -> list[str]:
        """Every name that definitions and roots give."""
        return [*defined_names(self.definitions), *provided_names(self.roots)]

    def factors(self, names: Collection[str]) -> list[float]:
        """SI factor of each of these states and parameters."""
        return [self.units.get(name, ONE).factor for name in names]


def equation(table: Table, key: str, allowed: Collection[str], hint: str = "", outside: Collection[str] = ()) -> str:
    """The text of an equation in which only these names occur; `hint` says what else an unknown one could be."""
    value = table.raw(key)
    if value is None:
        return "0"
    text = repr(value) if isinstance(value, int | float) and not isinstance(value, bool) else value
    if not isinstance(text, str):
        table.fault(key, f"must be an equation in quotes, not {shown(value)}")
        return "0"
    try:
        check_calls(text, allowed, outside)
    except ValueError as error:
        table.fault(key, f"{error}{hint if 'unknown name' in str(error) else ''}")
    return text


def read_definitions(
    table: Table, known: Collection[str], out: Physics, hint: str = "", outside: Collection[str] | None = None
) -> dict[str, str]:
    """Named values of equations, which may use one another; one key names all values of a function."""
    for key in table.data:
        for name in defined_names([key]):
            if name in out.units:
                table.fault(key, "is also a state or a parameter: every name has one meaning")
    allowed = {*known, *defined_names(table.data)}
    return {key: equation(table, key, allowed, hint, out.functions if outside is None else outside) for key in table.data}


def defined_names(definitions: Collection[str]) -> list[str]:
    """Every name that definitions give: a key may have several, with commas."""
    return [name.strip() for key in definitions for name in key.split(",")]


def read_roots(table: Table, known: Collection[str], out: Physics, outside: Collection[str]) -> dict[str, Any]:
    """Values given by equations that they solve, as `Sensor` takes them."""
    found: dict[str, Any] = {}
    for name, inner in table.tables():
        allowed = {*known, *provided_names({name: inner.data})}
        read = {"root": equation(inner, "root", allowed, OWN, outside), "start": inner.raw("start")}
        if "root" not in inner:
            inner.fault("root", "is missing: an expression that is zero at the solution")
        read["start"] = equation(inner, "start", known, OWN, outside) if "start" in inner else "0"
        if "iterations" in inner:
            read["iterations"] = inner.raw("iterations")
        read["definitions"] = read_definitions(inner.table("definitions"), allowed, out, OWN, outside)
        read["roots"] = read_roots(inner.table("roots"), allowed, out, outside)
        inner.finish()
        found[name] = read
    return found


def provided_names(roots: Mapping[str, Any]) -> list[str]:
    """Names that roots give: their own, and those of their definitions."""
    names = list(roots)
    for root in roots.values():
        for key, give in (("definitions", defined_names), ("roots", provided_names)):
            inner = root.get(key) if isinstance(root, Mapping) else None
            names += give(inner) if isinstance(inner, Mapping) else []
    return names
