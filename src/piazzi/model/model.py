"""The physics, said once: states, their equations of motion, what the sensors see.  Text only, nothing numeric."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from functools import cached_property
from typing import TYPE_CHECKING, Any

from piazzi.drawn import Shown
from piazzi.expressions import FUNCTIONS, names
from piazzi.model.definitions import STEP, TIME, Definition, Hoist, definitions_of, in_order, name_of, needed, unused
from piazzi.model.events import check_events, events_of
from piazzi.model.functions import AT, ROOT, STATION, Signature, signature_of
from piazzi.model.sensor import Parameter, Sensor, as_tuple
from piazzi.text import listed, nearest, suggest


@dataclass(frozen=True)
class Model(Shown):
    """Dynamics and sensors as equations, from which everything else is derived.

    Parameters
    ----------
    states : sequence of names or SymPy symbols
    dynamics : sequence of equations in the order of the states, or mapping of state to equation
        dx/dt = f(x, parameters, t), as text or SymPy.  With ``discrete=True`` the next state x[k+1], where the name ``dt``
        is the length of the step in seconds.
    sensors : sequence of Sensor
    parameters : sequence of names or `Parameter`, or mapping of name to role
    groups : mapping of a group's name to its states, such as ``{"position": ["x", "y"]}``
        Errors are summed over groups; "position" is what pictures draw.
    units : mapping of state to unit, such as ``{"x": "m"}``
    discrete : bool
    memory : mapping of name to state, such as ``{"x_before": "x"}``
        Further values that hold what a state was at the epoch before, for measurements of two neighbouring states.
    definitions : mapping of name to equation, such as ``{"r2": "x**2 + y**2"}``
        Values that dynamics, sensors and other definitions use by name, in any order.  Each is worked out once, and derived by
        the chain rule; nothing is substituted.  Several names take the values of one function: ``{"gx, gy, gz": "field(x, y,
        z)"}``, or a tuple of names; they may be fewer than the function has.
    events : mapping of name to definition, such as ``{"shadow": "edge"}``, or names of definitions
        Where one of these passes through zero, a step of the integrator ends.  Where the dynamics jump with it (`sign(edge)`),
        the transition matrix has the term of the jump.
    functions : mapping of name to function, or to its signature
        Functions from outside that the equations may call, such as ``earth.Gravity(...)``; their data belong to the `Problem`.
    roots : mapping of name to a table of ``root``, ``start``, ``iterations`` and ``definitions``
        Values given by an equation they solve, for dynamics, sensors and rules; see `Sensor`.

    Raises
    ------
    ValueError
        For an equation outside the restricted language or with an unknown name, repeated names, or wrong counts.
    """

    states: tuple[str, ...]
    dynamics: tuple[str, ...]
    sensors: tuple[Sensor, ...] = ()
    parameters: tuple[Parameter, ...] = ()
    groups: Any = field(default_factory=dict)
    units: Any = field(default_factory=dict)
    discrete: bool = False
    memory: Any = field(default_factory=dict)
    definitions: Any = field(default_factory=dict)
    functions: Any = ()
    roots: Any = ()
    events: Any = ()

    if TYPE_CHECKING:  # what is taken; the fields above say what is kept of it

        def __init__(
            self,
            states: Sequence[Any],
            dynamics: Sequence[Any] | Mapping[str, Any],
            sensors: Sensor | Sequence[Sensor] = (),
            parameters: Sequence[Any] | Mapping[str, str] = (),
            groups: Mapping[str, Sequence[str]] | Sequence[tuple[str, Sequence[str]]] = (),
            units: Mapping[str, str] | Sequence[tuple[str, str]] = (),
            discrete: bool = False,
            memory: Mapping[str, str] | Sequence[tuple[str, str]] = (),
            definitions: Mapping[Any, Any] | Sequence[Any] = (),
            functions: Mapping[str, Any] | Sequence[tuple[str, Any]] = (),
            roots: Mapping[str, Mapping[str, Any]] | Sequence[Any] = (),
            events: Mapping[str, str] | Sequence[Any] = (),
        ) -> None: ...

    def __repr__(self) -> str:
        """In short; `show` prints the equations."""
        seen = f", seen by {listed(sensor.name for sensor in self.sensors)}" if self.sensors else ""
        given = f", with {listed(self.parameter_names)}" if self.parameters else ""
        return f"<Model: {listed(self.states, 8)}{seen}{given}>"

    def __post_init__(self) -> None:
        put = object.__setattr__
        put(self, "states", tuple(name_of(s, "state") for s in as_tuple(self.states, "states")))
        put(self, "parameters", tuple(_parameter(p) for p in _items(self.parameters)))
        put(self, "sensors", self._sensors())
        remembered = tuple((name_of(k, "memory"), str(v)) for k, v in dict(self.memory).items())
        put(self, "memory", remembered)
        functions = dict(self.functions).items()
        put(self, "functions", tuple((name_of(k, "function"), signature_of(v, str(k))) for k, v in functions))
        put(self, "events", events_of(self.events))
        hoist = Hoist([name for name, _ in self.functions])
        given = definitions_of(self.definitions, "definitions", hoist, self.roots)
        put(self, "dynamics", self._equations(hoist))
        put(self, "definitions", in_order((*given, *hoist.found), "definitions"))
        put(self, "roots", ())
        put(self, "groups", tuple((str(g), tuple(str(s) for s in members)) for g, members in dict(self.groups).items()))
        put(self, "units", tuple((str(s), str(u)) for s, u in dict(self.units).items()))
        self._check_names()
        check_events(self)
        self._check_equations()

    def _sensors(self) -> tuple[Sensor, ...]:
        given = (self.sensors,) if isinstance(self.sensors, Sensor) else tuple(self.sensors)
        for sensor in given:
            if not isinstance(sensor, Sensor):
                raise ValueError(f"sensors has {sensor!r}; it must be a Sensor(name, equations)")
        return given

    def _equations(self, hoist: Hoist) -> tuple[str, ...]:
        given = self.dynamics
        if isinstance(given, Mapping):
            by_name = {str(k): v for k, v in given.items()}
            for k in by_name:
                if k not in self.states:
                    raise ValueError(f"dynamics has an equation for {k!r}, which is not a state{nearest(k, self.states)}")
            missing = [s for s in self.states if s not in by_name]
            if missing:
                raise ValueError(f"dynamics has no equation for state {missing[0]!r}")
            given = tuple(by_name[s] for s in self.states)
        equations = tuple(hoist.text(e) for e in as_tuple(given, "dynamics"))
        if len(equations) != len(self.states):
            raise ValueError(
                f"dynamics has {len(equations)} equations for {len(self.states)} states ({', '.join(self.states)})"
            )
        return equations

    def _check_names(self) -> None:
        if not self.states:
            raise ValueError("a model needs at least one state")
        taken: dict[str, str] = {TIME: "the time", STEP: "the length of a step"}
        everything = [("state", s) for s in self.states] + [("parameter", p.name) for p in self.parameters]
        everything += [("memory", name) for name, _ in self.memory]
        everything += [("definition", name) for d in self.definitions for name in d.provides]
        everything += [("function", name) for name, _ in self.functions]
        for what, name in everything:
            if name in taken:
                raise ValueError(f"{what} {name!r} is also {taken[name]}: every name has one meaning")
            taken[name] = f"a {what}"
        seen: set[str] = set()
        for sensor in self.sensors:
            if sensor.name in seen:
                raise ValueError(f"two sensors are called {sensor.name!r}")
            seen.add(sensor.name)
            for name in (name for d in sensor.definitions for name in d.provides):
                if name in taken:
                    raise ValueError(f"sensor {sensor.name!r} defines {name!r}, which is also {taken[name]}")
        for group, members in self.groups:
            for member in members:
                if member not in self.names:
                    raise ValueError(f"group {group!r} names {member!r}, which is not a state{nearest(member, self.names)}")
        for name, source in self.memory:
            if source not in self.states:
                raise ValueError(f"memory {name!r} is of {source!r}, which is not a state{nearest(source, self.states)}")
        for name, _ in self.units:
            if name not in self.names:
                raise ValueError(f"units names {name!r}, which is not a state{nearest(name, self.names)}")

    def _check_equations(self) -> None:
        defined = {name for d in self.definitions for name in d.provides}
        allowed = {*self.moving, *self.parameter_names, TIME, *defined} | ({STEP} if self.discrete else set())
        equations = [(f"dynamics of {state!r}", text) for state, text in zip(self.states, self.dynamics, strict=True)]
        needs = [(what, names(text)) for what, text in equations]
        for what, found in [*needs, *((f"definition {', '.join(d.names)!r}", d.needs) for d in self.definitions)]:
            for name in sorted(found - allowed):
                hint = nearest(name, sorted(allowed))
                raise ValueError(f"{what} uses {name!r}, which is neither a state nor a parameter{hint}")
        for sensor in self.sensors:
            if STEP in needed(sensor.free_names, self.definitions):
                raise ValueError(f"sensor {sensor.name!r} uses {STEP!r}, the length of a step, which no measurement has")
        users = (*self.dynamics, *(name for sensor in self.sensors for name in sorted(sensor.free_names)))
        users = (*users, *(name for _, name in self.events))
        for name in unused(self.definitions, users):
            raise ValueError(f"definition {name!r} is used by no equation")
        self._check_calls()

    def _check_calls(self) -> None:
        """Every call is of a function that is there, with its number of arguments, and wants no more values than it has."""
        known = dict(self.functions)
        for reserved in (AT, ROOT, STATION):
            if reserved in known:
                raise ValueError(f"function {reserved!r} has a meaning already: give it another name")
        owners = [("", self.definitions), *((f"sensor {s.name!r}: ", s.definitions) for s in self.sensors)]
        for owner, call in ((owner, call) for owner, definitions in owners for d in definitions for call in d.calls):
            outside = {**known, STATION: Signature.of_station()} if owner else known
            if call.function == AT and owner:
                self._check_at(owner, call)
                continue
            if call.function not in outside:
                hint = suggest(call.function, [*FUNCTIONS, *outside])
                raise ValueError(f"{owner}{call.function!r} is not a function{hint or '; write * to multiply'}")
            signature, got = outside[call.function], len(call.texts)
            if got != signature.arguments:
                plural = "" if signature.arguments == 1 else "s"
                raise ValueError(f"{owner}{call.text}: {call.function} takes {signature.arguments} argument{plural}, got {got}")
            if len(call.names) > signature.outputs:
                raise ValueError(f"{owner}{call.text} gives {signature.outputs} values, not {len(call.names)}")
            if len(call.names) < signature.outputs and call.names[0].startswith(f"{call.function}_") and len(call.names) == 1:
                raise ValueError(
                    f"{owner}{call.text} gives {signature.outputs} values: name them in a definition, such as "
                    f"'a, b' = {call.text!r}"
                )

    def _check_at(self, owner: str, call: Definition) -> None:
        if self.discrete:
            raise ValueError(f"{owner}{call.text}: a model that is a step has no state between its epochs")
        if len(call.texts) not in (1, 2) or call.texts[1:] not in ((), ("2",)):
            raise ValueError(f"{owner}{call.text}: write at(offset), or at(offset, order=2)")
        if len(call.names) > len(self.states):
            raise ValueError(f"{owner}{call.text} gives the {len(self.states)} states, not {len(call.names)} values")

    @cached_property
    def signatures(self) -> tuple[Signature, ...]:
        """Of all functions from outside that its equations call."""
        called = {call.function for d in self.definitions for call in d.calls}
        called |= {function for sensor in self.sensors for function in sensor.calls}
        found = [signature for name, signature in self.functions if name in called]
        return (*found, *([Signature.of_station()] if STATION in called else []))

    @cached_property
    def slots(self) -> dict[str, int]:
        """For every function from outside, the number of its data: functions that share a table have one."""
        keys = list(dict.fromkeys(signature.shared or name for name, signature in self.functions))
        return {name: keys.index(signature.shared or name) for name, signature in self.functions}

    @cached_property
    def looks_elsewhen(self) -> bool:
        """Whether a sensor asks for the state at another instant, by a step of the dynamics."""
        calls = (call for sensor in self.sensors for d in sensor.definitions for call in d.calls)
        return any(call.function == AT and len(call.texts) == 1 for call in calls)

    @cached_property
    def reads_data(self) -> bool:
        """Whether its functions in the source of kernels take what the model is told as a whole."""
        return bool(self.signatures) or self.looks_elsewhen

    def __hash__(self) -> int:
        return self._hash

    @cached_property
    def _hash(self) -> int:
        return hash(tuple(getattr(self, f.name) for f in fields(self)))

    def __getstate__(self) -> dict[str, Any]:
        """The fields alone: what is remembered beside them, such as the hash, holds for one process."""
        return {f.name: getattr(self, f.name) for f in fields(self)}

    @cached_property
    def parameter_names(self) -> tuple[str, ...]:
        return tuple(p.name for p in self.parameters)

    @cached_property
    def constants(self) -> tuple[str, ...]:
        """Parameters that are estimated: they follow the states, with zero dynamics."""
        return tuple(p.name for p in self.parameters if p.role == "estimated")

    @cached_property
    def given(self) -> tuple[str, ...]:
        """Parameters that kernels take as numbers: the fixed and the considered ones."""
        return tuple(p.name for p in self.parameters if p.role != "estimated")

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Everything that is estimated, in order: the states, memories of them, then the estimated constants."""
        return self.moving + self.constants

    @cached_property
    def moving(self) -> tuple[str, ...]:
        """The states, then the memories of them."""
        return self.states + tuple(name for name, _ in self.memory)

    @cached_property
    def sources(self) -> tuple[int, ...]:
        """For each value of `moving`, the position that it has at the start of a step: a memory takes its state's."""
        return tuple(range(len(self.states))) + tuple(self.states.index(source) for _, source in self.memory)

    @property
    def n(self) -> int:
        """Number of estimated values."""
        return len(self.names)

    @cached_property
    def width(self) -> int:
        """Components of the widest sensor."""
        return max((s.width for s in self.sensors), default=1)

    @cached_property
    def group_indices(self) -> dict[str, tuple[int, ...]]:
        """For every group, where its states stand in `names`."""
        return {g: tuple(self.names.index(m) for m in members) for g, members in self.groups}

    def sensor(self, name: str) -> Sensor:
        """The sensor of that name; raises ValueError with the nearest one."""
        for sensor in self.sensors:
            if sensor.name == name:
                return sensor
        raise ValueError(f"unknown sensor {name!r}{nearest(name, [s.name for s in self.sensors])}")

    def numbers(self, sensor: Sensor) -> tuple[str, ...]:
        """Names of the numbers that a station with this sensor must give, in alphabetical order."""
        return self._numbers[sensor.name]

    @cached_property
    def most_numbers(self) -> int:
        """Numbers of the station that must give the most, at least 1."""
        return max([len(names) for names in self._numbers.values()] + [1])

    @cached_property
    def _numbers(self) -> dict[str, tuple[str, ...]]:
        taken = {*self.moving, *self.parameter_names, TIME, *(n for d in self.definitions for n in d.provides)}
        return {sensor.name: tuple(sorted(sensor.free_names - taken)) for sensor in self.sensors}

    def unit(self, name: str) -> str:
        """Unit of a state or an estimated constant, "" where none was given."""
        units = {p.name: p.unit for p in self.parameters} | dict(self.units)
        return units.get(name, "")

    def show(self) -> None:
        """Display states, parameters, dynamics, F, h and H: LaTeX in a notebook, rich text in a terminal."""
        from piazzi.model.display import show

        show(self)


def _items(parameters: Any) -> list[Any]:
    if isinstance(parameters, Mapping):
        return [Parameter(name_of(k, "parameter"), v) for k, v in parameters.items()]
    return list(as_tuple(parameters, "parameters"))


def _parameter(given: Any) -> Parameter:
    return given if isinstance(given, Parameter) else Parameter(name_of(given, "parameter"))
