"""What a sensor sees, as equations; and a parameter with the part it plays."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal, get_args

from piazzi.model.definitions import Hoist, definitions_of, in_order, name_of, needed, unused
from piazzi.model.functions import STATION, STATION_TABLE
from piazzi.text import brief

Role = Literal["fixed", "estimated", "considered"]


def as_tuple(given: Any, what: str) -> tuple[Any, ...]:
    """The given names as a tuple; raises ValueError for one text, whose letters would be taken for names."""
    if isinstance(given, str):
        raise ValueError(f"{what} is {given!r}; it must be a list, such as [{given!r}]")
    return tuple(given)


@dataclass(frozen=True)
class Parameter:
    """A constant of the model, by name, with its role.

    "fixed" constants are numbers; "estimated" ones join the state and come out with a covariance; "considered" ones inflate
    the covariance without being estimated.
    """

    name: str
    role: Role = "fixed"
    unit: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "name", name_of(self.name, "parameter"))
        if self.role not in get_args(Role):
            raise ValueError(f"parameter {self.name!r} has role {self.role!r}; roles are {', '.join(get_args(Role))}")


@dataclass(frozen=True)
class Sensor:
    """Measurement equations z = h(x, parameters, the station's own numbers, t), one per component.

    Parameters
    ----------
    name : str
    equations : mapping of component name to equation, or a sequence of equations
        Text or SymPy.  Names that are neither states nor parameters nor `t` are the sensor's own numbers: every
        `Station` that carries the sensor gives them values.
    angles : sequence of component names
        Components that are angles in radians: their innovations wrap into (-pi, pi].
    units : mapping of component name to unit, for tables, pictures and columns of files; angles default to "rad".
    number_units : mapping of the sensor's own numbers to units, for those that are estimated
    definitions : mapping of name to equation
        Values that the sensor's equations use by name; see `Model`.  Beside the functions of the model they may call
        ``station(t)``, position and velocity (m, m/s, GCRF) of the station of the row, and ``at(offset)``, the states `offset`
        seconds later: by a step of order 8 of the dynamics, or, as ``at(offset, order=2)``, to second order in the offset.
    visible : sequence of equations
        Rules of states, parameters, definitions, numbers and `t`: a simulated station measures where all are above zero.
    roots : mapping of name to a table of ``root``, ``start``, ``iterations`` and ``definitions``
        Values given by an equation they solve, such as a light time: ``root`` is zero at the solution, which Newton's method
        finds from ``start``; the root's own definitions may use it, and stay names like any other.  Process noise within
        an offset is left out.
    on_sky : mapping of an angle to the angle that it is counted along a small circle of, such as
        ``{"azimuth": "elevation"}``: its innovations, and so its noise, are on the sky, times the cosine of what is measured
        of the other.

    Raises
    ------
    ValueError
        For an equation outside the restricted language, or an unknown name in `angles`, `units` or `number_units`.
    """

    name: str
    equations: Any
    angles: tuple[str, ...] = ()
    units: Mapping[str, str] = field(default_factory=dict)
    number_units: Any = field(default_factory=dict)
    definitions: Any = field(default_factory=dict)
    visible: Any = field(default=(), repr=False)  # no kernel, and no checkpoint, depends on it
    roots: Any = ()
    on_sky: Any = ()
    components: tuple[str, ...] = field(init=False)

    if TYPE_CHECKING:  # what is taken; the fields above say what is kept of it

        def __init__(
            self,
            name: str,
            equations: Mapping[str, Any] | Sequence[Any],
            angles: Sequence[str] = (),
            units: Mapping[str, str] | Sequence[tuple[str, str]] = (),
            number_units: Mapping[str, str] | Sequence[tuple[str, str]] = (),
            definitions: Mapping[Any, Any] | Sequence[Any] = (),
            visible: Sequence[Any] = (),
            roots: Mapping[str, Mapping[str, Any]] | Sequence[Any] = (),
            on_sky: Mapping[str, str] | Sequence[tuple[str, str]] = (),
        ) -> None: ...

    __repr__ = brief

    def __post_init__(self) -> None:
        put = object.__setattr__
        put(self, "name", str(self.name))
        name_of(self.name.replace("-", "_"), "sensor")
        put(self, "angles", as_tuple(self.angles, f"sensor {self.name!r}: angles"))
        owner, hoist = f"sensor {self.name!r}", Hoist(None, "_" + self.name.replace("-", "_"))
        labelled = self._labelled(hoist)
        if not labelled:
            raise ValueError(f"{owner} has no equations")
        definitions = definitions_of(self.definitions, owner, hoist, self.roots)
        put(self, "visible", tuple(hoist.text(rule) for rule in as_tuple(self.visible, f"{owner}: visible")))
        put(self, "definitions", in_order((*definitions, *hoist.found), owner))
        put(self, "roots", ())
        put(self, "components", tuple(labelled))
        put(self, "equations", tuple(labelled.values()))
        units = dict(self.units)
        known = ", ".join(labelled)
        put(self, "on_sky", tuple((str(a), str(b)) for a, b in dict(self.on_sky).items()))
        on_sky = tuple(name for pair in self.on_sky for name in pair)
        for what, given in (("angles", self.angles), ("units", units), ("on_sky", on_sky)):
            for component in given:
                if component not in labelled:
                    raise ValueError(f"sensor {self.name!r}: {what} names {component!r}; its components are {known}")
        for name in on_sky:
            if name not in self.angles:
                raise ValueError(f"sensor {self.name!r}: on_sky names {name!r}, which is not among its angles")
        for name in dict(self.number_units):
            if name not in self.free_names:
                raise ValueError(f"sensor {self.name!r}: number_units names {name!r}, which no equation uses")
        for name in unused(self.definitions, (*self.equations, *self.visible)):
            raise ValueError(f"sensor {self.name!r}: definition {name!r} is used by no equation")
        put(self, "number_units", tuple((str(n), str(u)) for n, u in dict(self.number_units).items()))
        put(self, "units", tuple((c, units.get(c, "rad" if c in self.angles else "")) for c in labelled))

    def _labelled(self, hoist: Hoist) -> dict[str, str]:
        """Component names with the text of their equations."""
        if isinstance(self.equations, Mapping):
            return {name_of(k, "component"): hoist.text(v) for k, v in self.equations.items()}
        given: Sequence[Any] = [self.equations] if isinstance(self.equations, str) else list(self.equations)
        return dict(zip(self._labels(len(given)), map(hoist.text, given), strict=True))

    def _labels(self, count: int) -> tuple[str, ...]:
        """Names for equations given without: the sensor's own, the angles' where all are angles, else numbered."""
        if count == 1:
            return (self.name.replace("-", "_"),)
        if len(set(self.angles)) == count:
            return self.angles
        return tuple(f"{self.name}_{i}" for i in range(count))

    @property
    def width(self) -> int:
        """Number of components."""
        return len(self.components)

    @cached_property
    def is_angle(self) -> tuple[bool, ...]:
        """For every component, whether it is an angle."""
        return tuple(c in self.angles for c in self.components)

    @cached_property
    def circle(self) -> tuple[int | None, ...]:
        """For every component, the number of the one whose cosine puts it on the sky."""
        partner = dict(self.on_sky)
        return tuple(self.components.index(partner[c]) if c in partner else None for c in self.components)

    @cached_property
    def free_names(self) -> frozenset[str]:
        """All names in the equations and rules that the sensor does not define itself."""
        own = frozenset({STATION_TABLE} if STATION in self.calls else ())
        texts = (*self.equations, *self.visible)
        return own | needed(texts, self.definitions) - {n for d in self.definitions for n in d.provides}

    @cached_property
    def calls(self) -> frozenset[str]:
        """Names of the functions from outside that its equations call."""
        return frozenset(call.function for d in self.definitions for call in d.calls)
