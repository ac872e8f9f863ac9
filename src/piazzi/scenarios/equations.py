"""The half of a scenario file that is physics: states, equations of motion, parameters and sensors, read into a `Model`."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from typing import TYPE_CHECKING, Any, get_args

from piazzi.expressions import check
from piazzi.expressions.outside import check_calls
from piazzi.model import STEP, TIME, Model, Parameter, Role, Sensor
from piazzi.model.definitions import name_of
from piazzi.model.functions import AT, STATION
from piazzi.problem.epochs import epoch_given
from piazzi.problem.parts import Schedule
from piazzi.scenarios.earth import definitions_of, dynamics_of, names_of
from piazzi.scenarios.functions import read_functions
from piazzi.scenarios.table import Table, joined, shown
from piazzi.text import nearest
from piazzi.units import ONE, Unit, Units, is_quantity

if TYPE_CHECKING:
    from piazzi.earth import Epoch, ForceChoice

MAX_STATES = 100
OWN = "; numbers of each station's own are named in the sensor's numbers"


@dataclass
class Physics:
    """What the equations' half says: the model, None where it is faulty, and the unit of every name.

    `forces` are those of [earth]; `dynamics`, `definitions` and `functions` what the file has beside them.
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
    schedules: dict[str, Schedule | None] = field(default_factory=dict)

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
        return [*_names(self.definitions), *_provided(self.roots)]

    def factors(self, names: Collection[str]) -> list[float]:
        """SI factor of each of these states and parameters."""
        return [self.units.get(name, ONE).factor for name in names]


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
    given = {} if forces is None or epoch is None else forces.functions(epoch)
    out.functions = {**given, **read_functions(file.table("functions"), epoch)}
    known, solved = {*out.known, *([STEP] if "step" in file else [])}, file.table("roots")
    out.definitions = read_definitions(file.table("definitions"), {*known, *_provided(solved.data)}, out)
    out.roots = _roots(solved, {*known, *out.known, *_provided(solved.data)}, out, out.functions)
    out.events = _events(file.table("events"))
    out.dynamics = _dynamics(file, out)
    sensors = [_sensor(name, table, units, out, epoch) for name, table in file.table("sensors").tables()]
    out.groups = _groups(file, out)
    if len(file.faults) == before:
        labels = {s: out.units[s].label for s in out.states if out.units[s].label}
        with file.faults.at(""):
            out.model = shared(_model(out, parameters, [s for s in sensors if s is not None], labels, "step" in file))
    return out


def _model(out: Physics, parameters: list[Parameter], sensors: list[Sensor], labels: dict[str, str], discrete: bool) -> Model:
    dynamics, definitions, functions = out.dynamics, out.definitions, dict(out.functions)
    if out.forces is not None:
        dynamics = dynamics_of(out.forces, dynamics)
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


def named_units(table: Table, key: str, units: Units, what: str) -> dict[str, Unit]:
    """Names with their units: a table of name to unit, or, where the file is in SI, a list of names."""
    value = table.raw(key)
    if value is None:
        return {}
    if isinstance(value, list) and units.declared:
        table.fault(key, f"is a list, but the file is not in SI: write name = unit for every {what}, such as {_example(units)}")
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
            table.fault(key, f"is missing: the file is not in SI, so give a unit, such as {_example(units)}")
        return ONE
    with table.faults.at(table.at(key)):
        return units.unit(text)
    return ONE


def _example(units: Units) -> str:
    return f"'length/time' (here {units.base[0]}/{units.base[2]}), or '1' for none"


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
        table.fault(name, f"is only a number, but the file is not in SI: write {{ value = ..., unit = {_example(units)} }}")
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


def _names(definitions: Collection[str]) -> list[str]:
    """Every name that definitions give: a key may have several, with commas."""
    return [name.strip() for key in definitions for name in key.split(",")]


def read_definitions(
    table: Table, known: Collection[str], out: Physics, hint: str = "", outside: Collection[str] | None = None
) -> dict[str, str]:
    """Named values of equations, which may use one another; one key names all values of a function."""
    for key in table.data:
        for name in _names([key]):
            if name in out.units:
                table.fault(key, "is also a state or a parameter: every name has one meaning")
    allowed = {*known, *_names(table.data)}
    return {key: equation(table, key, allowed, hint, out.functions if outside is None else outside) for key in table.data}


def _events(table: Table) -> dict[str, str]:
    """Names of events, each with the definition whose zero it is."""
    return {name: text for name in table.data if (text := table.text(name)) is not None}


def _roots(table: Table, known: Collection[str], out: Physics, outside: Collection[str]) -> dict[str, Any]:
    """Values given by equations that they solve, as `Sensor` takes them."""
    found: dict[str, Any] = {}
    for name, inner in table.tables():
        allowed = {*known, *_provided({name: inner.data})}
        read = {"root": equation(inner, "root", allowed, OWN, outside), "start": inner.raw("start")}
        if "root" not in inner:
            inner.fault("root", "is missing: an expression that is zero at the solution")
        read["start"] = equation(inner, "start", known, OWN, outside) if "start" in inner else "0"
        if "iterations" in inner:
            read["iterations"] = inner.raw("iterations")
        read["definitions"] = read_definitions(inner.table("definitions"), allowed, out, OWN, outside)
        read["roots"] = _roots(inner.table("roots"), allowed, out, outside)
        inner.finish()
        found[name] = read
    return found


def _provided(roots: Mapping[str, Any]) -> list[str]:
    """Names that roots give: their own, and those of their definitions."""
    names = list(roots)
    for root in roots.values():
        for key, give in (("definitions", _names), ("roots", _provided)):
            inner = root.get(key) if isinstance(root, Mapping) else None
            names += give(inner) if isinstance(inner, Mapping) else []
    return names


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


def _sensor(name: str, table: Table, units: Units, out: Physics, epoch: Epoch | None) -> Sensor | None:
    """A sensor from its components, the names of its stations' own numbers, and what it sees when."""
    numbers, out.defaults[name] = _own_numbers(table, units)
    out.schedules[name] = read_schedule(table, units, epoch)
    for clash in numbers.keys() & out.units.keys():
        table.fault("numbers", f"names {clash!r}, which is also a state or a parameter")
    outside = {*out.functions, AT, STATION}
    known = {*out.known, *numbers}
    solved = table.table("roots")
    known |= {*_provided(solved.data)}
    definitions = read_definitions(table.table("definitions"), known, out, OWN, outside)
    roots = _roots(solved, {*known, *_names(definitions)}, out, outside)
    for clash in {*_names(definitions)} & (numbers.keys() | {*out.defined}):
        table.fault("definitions", f"names {clash!r}, which has a meaning already")
    components = table.table("components")
    if not components.data:
        table.fault("components", "is missing: a sensor needs at least one equation")
    equations, angles, kinds = {}, [], {}
    for key in components.data:
        equations[key], kinds[key], angle = _component(components, key, {*known, *_names(definitions)}, units, outside)
        angles += [key] if angle else []
    visible = _rules(table, {*known, *_names(definitions)})
    table.finish()
    out.components[name], out.numbers[name] = kinds, numbers
    with table.faults.at(table.path):
        labels = {k: u.label for k, u in kinds.items() if u.label}
        used = Sensor(name, equations, tuple(angles), labels, {}, definitions, visible, roots).free_names
        own = {k: u.label for k, u in numbers.items() if u.label and k in used}
        sensor = Sensor(name, equations, tuple(angles), labels, own, definitions, visible, roots)
        for unused in sorted(numbers.keys() - sensor.free_names):
            table.fault("numbers", f"names {unused!r}, which no equation uses{nearest(unused, sorted(sensor.free_names))}")
        return sensor
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


def _component(
    table: Table, key: str, allowed: Collection[str], units: Units, outside: Collection[str]
) -> tuple[str, Unit, bool]:
    """Equation and unit of a component, and whether it is an angle, which wraps."""
    if not isinstance(table.raw(key), Mapping):
        text = equation(table, key, allowed, OWN, outside)
        if units.declared:
            table.fault(key, f"has no unit, but the file is not in SI: write {{ equation = ..., unit = {_example(units)} }}")
        if "atan2" in text:
            table.fault(key, 'uses atan2: say { equation = ..., unit = "rad" } for an angle, which wraps, or angle = false')
        return text, ONE, False
    inner = table.table(key)
    if "equation" not in inner:
        inner.fault("equation", "is missing")
    text = equation(inner, "equation", allowed, OWN, outside)
    unit = unit_of(inner, "unit", units)
    angle = inner.flag("angle", unit.is_angle)
    if "atan2" in text and "unit" not in inner and "angle" not in inner:
        inner.fault("unit", 'is missing: say unit = "rad" for an angle, which wraps, or angle = false')
    inner.finish()
    return text, unit, bool(angle)


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
