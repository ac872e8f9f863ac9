"""The forces on a satellite of the Earth: a choice of them, as a model's equations and a problem's data."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Literal

from piazzi.earth import force_text
from piazzi.earth.epoch import Epoch
from piazzi.earth.fields import GravityField, gravity_field
from piazzi.earth.force_text import Force
from piazzi.earth.gravity import Gravity
from piazzi.earth.scales import Orientation
from piazzi.earth.tabulated import Body, Rotation
from piazzi.model import Model, Parameter, Sensor
from piazzi.model.pruning import used_definitions
from piazzi.text import nearest

STATES = ("x", "y", "z", "vx", "vy", "vz")
EMPIRICAL = ("radial", "along", "cross")
_GROUPS = {"position": STATES[:3], "velocity": STATES[3:]}
_UNITS = dict.fromkeys(STATES[:3], "m") | dict.fromkeys(STATES[3:], "m/s")
_UNIT = {"cr_a_m": "m^2/kg", "cd_a_m": "m^2/kg", "air_density": "kg/m^3", "air_height": "m", "air_scale": "m"}
_ANY = Epoch.at(0.0)  # signatures are the same whatever the date


@dataclass(frozen=True)
class Forces:
    """The forces on a satellite of the Earth, whose states are x, y, z (m) and vx, vy, vz (m/s) on the axes of the GCRF.

    Each but gravity has a parameter, ``NAME_on`` of `values`, that is 1, and 0 without it; nothing is compiled for that.

    Parameters
    ----------
    gravity : name of a field, a file, or a `GravityField`
    degree, gradient_degree : as `Gravity` takes them
    bodies : sun, moon and planets that draw the satellite
    relativity : Schwarzschild's term
    radiation : "cannonball", sunlight with the shadow of the Earth on a sphere of `cr_a_m` (m2/kg), or False
    drag : "exponential", air that turns with the Earth on a sphere of `cd_a_m` (m2/kg), or False
    air_height : m, about which the density is right
    tides : ("solid",), the tide of degree 2 that Sun and Moon raise in the Earth, or ()
    empirical : any of "radial", "along" and "cross", constants (m/s2) that are parameters; "constant" is all of them

    Raises
    ------
    ValueError
        For a force, a body or a field that there is not.
    """

    gravity: str | Path | GravityField = "EGM2008"
    degree: int | None = 20
    gradient_degree: int | None = None
    bodies: Sequence[str] = ("sun", "moon")
    relativity: bool = True
    radiation: Literal["cannonball", False] = False
    drag: Literal["exponential", False] = False
    air_height: float = 400e3
    tides: Sequence[str] = ("solid",)
    empirical: Sequence[str] = ()

    def __post_init__(self) -> None:
        for name, known in (("bodies", force_text.BODIES), ("tides", ("solid",)), ("empirical", (*EMPIRICAL, "constant"))):
            given = getattr(self, name)
            if isinstance(given, str):
                raise ValueError(f"{name} is {given!r}; it must be a list, such as [{given!r}]")
            for one in given:
                if one not in known:
                    raise ValueError(f"{name} has {one!r}; there are {', '.join(known)}{nearest(one, known)}")
            object.__setattr__(self, name, tuple(dict.fromkeys(given)))
        if "constant" in self.empirical:
            object.__setattr__(self, "empirical", EMPIRICAL)
        for name, only in (("radiation", "cannonball"), ("drag", "exponential")):
            if getattr(self, name) not in (False, None, "", only):
                raise ValueError(f"{name} is {getattr(self, name)!r}; it must be {only!r} or False")
        Gravity(self.field, self.degree, self.gradient_degree)  # what is wrong with it is said here
        self.parts  # noqa: B018

    @cached_property
    def field(self) -> GravityField:
        """The field; with the tides of the solid Earth, without the permanent one, which is among them."""
        found = self.gravity if isinstance(self.gravity, GravityField) else gravity_field(self.gravity)
        return found.in_tide_system("tide_free") if self.tides else found

    @cached_property
    def parts(self) -> tuple[Force, ...]:
        """The forces as text, without numbers of the field: another one compiles nothing."""
        empirical = tuple(name for name in EMPIRICAL if name in self.empirical)
        return (
            force_text.gravity(),
            *(force_text.third_body(name) for name in self.bodies),
            *(force_text.solid_tide(name) for name in ("sun", "moon") if self.tides),
            *([force_text.relativity()] if self.relativity else []),
            *([force_text.radiation()] if self.radiation else []),
            *([force_text.drag(self.air_height)] if self.drag else []),
            *([force_text.empirical(empirical)] if empirical else []),
        )

    @property
    def places(self) -> tuple[str, ...]:
        """The bodies whose places are needed."""
        also = (("sun", "moon") if self.tides else ()) + (("sun",) if self.radiation else ())
        return tuple(dict.fromkeys((*self.bodies, *also)))

    @cached_property
    def definitions(self) -> dict[str, str]:
        """Named values of all forces, and their sums."""
        text: dict[str, str] = {}
        for name in self.places:
            text |= force_text.body_place(name)
        for part in self.parts:
            text |= part.definitions
        return text

    @cached_property
    def dynamics(self) -> dict[str, str]:
        """The equations of motion by state."""
        sums = {}
        for i, axis in enumerate("xyz"):
            terms: dict[str, list[str]] = {}
            for part in self.parts:
                terms.setdefault(part.switch, []).append(part.acceleration[i])
            sums[f"v{axis}"] = " + ".join(
                " + ".join(of) if not switch else f"{switch}*({' + '.join(of)})" for switch, of in terms.items()
            )
        return {axis: f"v{axis}" for axis in "xyz"} | sums

    @cached_property
    def parameters(self) -> tuple[str, ...]:
        """Names of all parameters: the user's to give, then those of `values`."""
        return (*(name for part in self.parts for name in part.parameters), *self.values)

    @cached_property
    def values(self) -> dict[str, float]:
        """Numbers of those parameters that have one: switches and the density of the air."""
        switches = {part.switch: 1.0 for part in self.parts if part.switch}
        return switches | {name: value for part in self.parts for name, value in part.values.items()}

    def model(
        self,
        sensors: Sensor | Sequence[Sensor] = (),
        parameters: Mapping[str, str] | Iterable[str] = (),
        added: Mapping[str, str] | None = None,
        definitions: Mapping[Any, Any] | None = None,
        functions: Mapping[str, Any] | None = None,
    ) -> Model:
        """The model of these forces.

        Parameters
        ----------
        sensors : what the satellite is seen by
        parameters : mapping of name to role, for those of the forces that are estimated or considered, and for further ones;
            further names alone are fixed; those of `earth.sensors` are there already
        added : forces of one's own, mapping of state to text, such as ``{"vx": "thrust*cos(phi)"}``
        definitions, functions : that those and the sensors use

        Raises
        ------
        ValueError
            As `Model` does; also for an addition to what is no state.
        """
        seen = [sensors] if isinstance(sensors, Sensor) else list(sensors)
        called = {name: signature for s in seen for name, signature in getattr(s, "signatures", {}).items()}
        roles = dict(parameters) if isinstance(parameters, Mapping) else dict.fromkeys(parameters, "fixed")
        every: dict[str, Any] = dict.fromkeys(self.parameters, "fixed")
        for given in (*(getattr(s, "parameters", {}) for s in seen), roles):
            every |= given
        dynamics = dict(self.dynamics)
        for state, text in (added or {}).items():
            if state not in dynamics:
                raise ValueError(f"added has {state!r}, which is not a state{nearest(state, dynamics)}")
            dynamics[state] += f" + ({text})"
        texts = [*dynamics.values(), *map(str, (definitions or {}).values()), *(n for s in seen for n in s.free_names)]
        return Model(
            STATES,
            dynamics,
            sensors,
            [Parameter(name, role, unit_of(name)) for name, role in every.items()],
            _GROUPS,
            _UNITS,
            definitions={**used_definitions(self.definitions, texts), **(definitions or {})},
            functions={**self.functions(_ANY), **called, **(functions or {})},
        )

    def functions(self, epoch: Epoch, eop: Orientation | None = None, kernel: str | Path | None = None) -> dict[str, Any]:
        """The data of a problem whose time zero is `epoch`.

        Parameters
        ----------
        epoch : or what one is made of; a field that changes is that of this date
        eop : orientation of the Earth; default the tables of the IERS
        kernel : of JPL, for the bodies; default the series
        """
        epoch = Epoch(epoch)
        return {
            "field": Gravity(self.field.at(epoch), self.degree, self.gradient_degree),
            "fixed": Rotation("GCRF", "ITRF", epoch, eop),
            "free": Rotation("ITRF", "GCRF", epoch, eop),
            **{name: Body(name, epoch, kernel) for name in self.places},
        }


def unit_of(name: str) -> str:
    """The unit of a parameter of forces, "" for none."""
    return "m/s^2" if name in EMPIRICAL else _UNIT.get(name, "")
