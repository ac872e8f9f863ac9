"""What a sensor sees, as equations; and a parameter with the part it plays."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal, get_args

from piazzi.expressions import from_sympy, names

Role = Literal["fixed", "estimated", "considered"]


def text_of(equation: Any) -> str:
    """Canonical text of an equation given as text, number or SymPy expression; raises `ExpressionError`."""
    if isinstance(equation, str):
        names(equation)
        return equation.strip()
    return from_sympy(equation)


def name_of(symbol: Any, what: str) -> str:
    """Name of a SymPy symbol, or the text itself; raises ValueError unless it can name a variable in an equation."""
    name = str(symbol)
    if not name.isidentifier() or name.startswith("_") or "__" in name or names(name) != {name}:
        raise ValueError(f"{what} {name!r} cannot be used as a name: write a letter followed by letters, digits and single underscores")
    return name


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
    units : mapping of component name to unit, for tables and pictures; angles default to "rad".

    Raises
    ------
    ValueError
        For an equation outside the restricted language, or an unknown component in `angles` or `units`.
    """

    name: str
    equations: Any
    angles: tuple[str, ...] = ()
    units: Mapping[str, str] = field(default_factory=dict)
    components: tuple[str, ...] = field(init=False)

    def __post_init__(self) -> None:
        name_of(self.name.replace("-", "_"), "sensor")
        labelled = self._labelled()
        if not labelled:
            raise ValueError(f"sensor {self.name!r} has no equations")
        components = tuple(labelled)
        for what, given in (("angles", self.angles), ("units", self.units)):
            for component in given:
                if component not in labelled:
                    raise ValueError(f"sensor {self.name!r}: {what} names {component!r}; its components are {', '.join(components)}")
        units = {c: self.units.get(c, "rad" if c in self.angles else "") for c in components}
        object.__setattr__(self, "equations", tuple(labelled.values()))
        object.__setattr__(self, "angles", tuple(self.angles))
        object.__setattr__(self, "components", components)
        object.__setattr__(self, "units", tuple(units.items()))

    def _labelled(self) -> dict[str, str]:
        """Component names with the text of their equations."""
        if isinstance(self.equations, Mapping):
            return {name_of(k, "component"): text_of(v) for k, v in self.equations.items()}
        given: Sequence[Any] = [self.equations] if isinstance(self.equations, str) else list(self.equations)
        if len(given) == 1:
            return {self.name.replace("-", "_"): text_of(given[0])}
        marked = list(self.angles)
        return {marked[i] if i < len(marked) and len(marked) == len(given) else f"{self.name}_{i}": text_of(e) for i, e in enumerate(given)}

    @property
    def width(self) -> int:
        """Number of components."""
        return len(self.components)

    @property
    def is_angle(self) -> tuple[bool, ...]:
        """For every component, whether it is an angle."""
        return tuple(c in self.angles for c in self.components)

    @property
    def free_names(self) -> frozenset[str]:
        """All names in the equations."""
        return frozenset().union(*(names(e) for e in self.equations))
