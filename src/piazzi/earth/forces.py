"""The forces on a satellite of the Earth: a choice of them, as a model's equations and a problem's data."""

from __future__ import annotations

import re
import warnings
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Literal, cast

from piazzi.earth import force_air, force_harmonics, force_sun, force_text
from piazzi.earth.atmosphere import HarrisPriester
from piazzi.earth.bodies import SERIES_ERROR, EphemerisWarning
from piazzi.earth.celestial import Asteroid, GeodesicPrecession
from piazzi.earth.constants import GM
from piazzi.earth.epoch import Epoch
from piazzi.earth.fields import GravityField, gravity_field
from piazzi.earth.force_options import SUNLIGHT, UNITS, USUAL, options, several
from piazzi.earth.force_text import Force
from piazzi.earth.gravity import Gravity
from piazzi.earth.scales import Orientation
from piazzi.earth.tabulated import Body, Rotation
from piazzi.earth.tidal_harmonics import TidalHarmonics
from piazzi.model import Model, Parameter, Sensor
from piazzi.model.pruning import used_definitions
from piazzi.text import nearest

STATES = ("x", "y", "z", "vx", "vy", "vz")
_GROUPS = {"position": STATES[:3], "velocity": STATES[3:]}
_UNITS = dict.fromkeys(STATES[:3], "m") | dict.fromkeys(STATES[3:], "m/s")
_ANY = Epoch.at(0.0)  # signatures are the same whatever the date


@dataclass(frozen=True)
class Forces:
    """The forces on a satellite of the Earth, whose states are x, y, z (m) and vx, vy, vz (m/s) on the axes of the GCRF.

    Each but gravity has a parameter, ``NAME_on`` of `values`, that is 1, and 0 without it; nothing is compiled for that.
    About the Sun axes are those of the ICRF, and times of the problem are seconds of TDB.

    Parameters
    ----------
    gravity : name of a field, a file, or a `GravityField`
    degree, gradient_degree : as `Gravity` takes them
    bodies : sun, moon and planets that draw the satellite; default Sun and Moon, about the Sun all planets and the Moon
    relativity : any of "schwarzschild", "lense-thirring" and "de-sitter"; True is the first of them, False none
    radiation : "cannonball", sunlight on a sphere of `cr_a_m` (m2/kg), or False
    shadows : "earth" and "moon", those that it has
    drag : "exponential", "harris-priester" or "msis", air that turns with the Earth on a sphere of `cd_a_m` (m2/kg), or False
    air_height : m, about which the density is right where it is exponential
    tides : any of "solid", what Sun and Moon raise in the Earth with one Love number; "k1", what those by order and frequency
        add to it; "pole", what the pole's motion does
    empirical : "constant", accelerations (m/s2) along R, T and N that are parameters, "once-per-rev", those that go with sine
        and cosine of the argument of latitude, "sunlight", shares of what sunlight does to a sphere that other bodies add to it
        (see `docs/how-to/forces.md`), or names of single ones
    about : "earth" or "sun"
    nongravitational : any of "A1", "A2", "A3" (m/s2 at one astronomical unit), about the Sun
    asteroids : those that draw the body, about the Sun; they need a kernel of their own
    harmonics : normalised coefficients such as "C20" or "S22", to degree 9: parameters `delta_C20` are added to the field's
    shadow_edges : whether steps end where the Earth's half-shadow begins and ends, as events of the model

    Raises
    ------
    ValueError
        For a force, a body or a field that there is not.
    """

    gravity: str | Path | GravityField = "EGM2008"
    degree: int | None = 20
    gradient_degree: int | None = None
    bodies: Sequence[str] = USUAL
    relativity: bool | Sequence[str] = True
    radiation: Literal["cannonball", False] = False
    drag: Literal["exponential", "harris-priester", "msis", False] = False
    air_height: float = 400e3
    tides: Sequence[str] = USUAL
    empirical: Sequence[str] = ()
    shadows: Sequence[str] = USUAL
    about: Literal["earth", "sun"] = "earth"
    nongravitational: Sequence[str] = ()
    asteroids: Sequence[str] = ()
    shadow_edges: bool = False
    harmonics: Sequence[str] = ()

    def __post_init__(self) -> None:
        for name in options(self.about):
            object.__setattr__(self, name, several(self.about, name, getattr(self, name)))
        object.__setattr__(self, "relativity", self.relativity or False)
        for name, only in (("radiation", ("cannonball",)), ("drag", force_air.DENSITIES)):
            given = getattr(self, name) or False
            if given and (given not in only or self.about == "sun"):
                choice = " or ".join([*(map(repr, only) if self.about == "earth" else ()), "False"])
                raise ValueError(f"{name} is {given!r}; it must be {choice}{' about the Sun' * (self.about == 'sun')}")
        if not self.radiation and (lost := [name for name in self.empirical if name in SUNLIGHT]):
            raise ValueError(f"empirical has {lost[0]!r}, a share of sunlight: it needs radiation 'cannonball'")
        if self.about == "earth":
            Gravity(self.field, self.degree, self.gradient_degree)  # what is wrong with it is said here
        self.parts  # noqa: B018

    @cached_property
    def field(self) -> GravityField:
        """The field; with the tides of the solid Earth, without the permanent one, which is among them."""
        found = self.gravity if isinstance(self.gravity, GravityField) else gravity_field(self.gravity)
        return found.in_tide_system("tide_free") if "solid" in self.tides else found

    @cached_property
    def parts(self) -> tuple[Force, ...]:
        """The forces as text, without numbers of the field: another one compiles nothing."""
        relativity, tides, bodies = cast("tuple[str, ...]", self.relativity or ()), self.tides, self.bodies
        if self.about == "sun":
            asteroids = {name: force_sun.ASTEROIDS[name] for name in self.asteroids}
            return force_sun.parts(bodies, asteroids, bool(relativity), self.nongravitational)
        fixed = [force_text.degree_2(kind) for kind in ("k1", "pole") if kind in tides]
        fixed += [force_harmonics.harmonics(self.harmonics, self.field.gm, self.field.radius)] if self.harmonics else []
        return (
            force_text.gravity(fixed),
            *(force_text.third_body(name, GM[name]) for name in bodies),
            *(force_text.solid_tide(name) for name in ("sun", "moon") if "solid" in tides),
            *fixed,
            *([force_text.schwarzschild(GM["earth"])] if "schwarzschild" in relativity else []),
            *([force_text.lense_thirring()] if "lense-thirring" in relativity else []),
            *([force_text.de_sitter()] if "de-sitter" in relativity else []),
            *([force_text.radiation(self.shadows)] if self.radiation else []),
            *([force_air.drag(self.drag, self.air_height)] if self.drag else []),
            *([force_text.empirical(own)] if (own := [name for name in self.empirical if name not in SUNLIGHT]) else []),
            *([force_text.sunlight(own)] if (own := [name for name in self.empirical if name in SUNLIGHT]) else []),
        )

    @property
    def places(self) -> tuple[str, ...]:
        """The bodies whose places are needed."""
        light = bool(self.radiation) or self.drag == "harris-priester"
        moon = bool(self.radiation) and "moon" in self.shadows
        also = ("sun", "moon") if "solid" in self.tides else ("sun",) * light + ("moon",) * moon
        return tuple(dict.fromkeys((*self.bodies, *also, *self.asteroids)))

    @cached_property
    def definitions(self) -> dict[str, str]:
        """Named values of all forces, and their sums."""
        text: dict[str, str] = {}
        for name in self.places:
            text |= force_text.body_place(name)
        for part in self.parts:
            text |= part.definitions
        return text | (force_text.SHADOW_EDGES if self.events else {})

    @property
    def events(self) -> dict[str, str]:
        """Names of events, with the definitions whose zeros they are."""
        wanted = self.shadow_edges and self.radiation and "earth" in self.shadows
        return {name: name for name in force_text.SHADOW_EDGES} if wanted else {}

    @cached_property
    def dynamics(self) -> dict[str, str]:
        """The equations of motion by state."""
        sums = {}
        for i, axis in enumerate("xyz"):
            terms: dict[str, list[str]] = {}
            for part in self.parts:
                if not part.fixed:
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
        units = {name: unit for s in seen for name, unit in s.number_units}
        dynamics = dict(self.dynamics)
        for state, text in (added or {}).items():
            if state not in dynamics:
                raise ValueError(f"added has {state!r}, which is not a state{nearest(state, dynamics)}")
            dynamics[state] += f" + ({text})"
        texts = [*dynamics.values(), *map(str, (definitions or {}).values()), *(n for s in seen for n in s.free_names)]
        texts += self.events
        return Model(
            STATES,
            dynamics,
            sensors,
            [Parameter(name, role, units.get(name) or unit_of(name)) for name, role in every.items()],
            _GROUPS,
            _UNITS,
            definitions={**used_definitions(self.definitions, texts), **(definitions or {})},
            functions={**self._functions(_ANY), **called, **(functions or {})},
            events=self.events,
        )

    def functions(
        self,
        epoch: Epoch,
        eop: Orientation | None = None,
        kernel: str | Path | None = None,
        asteroids: str | Path | None = None,
        air: Any = None,
    ) -> dict[str, Any]:
        """The data of a problem whose time zero is `epoch`.

        Parameters
        ----------
        epoch : or what one is made of; a field that changes is that of this date
        eop : orientation of the Earth; default the tables of the IERS
        kernel : of JPL, for the bodies; default the series
        asteroids : kernel of the asteroids
        air : with ``drag="msis"`` an `earth.Thermosphere`

        Raises
        ------
        ValueError
            Where there is no kernel of the asteroids, or no air.
        """
        if self.asteroids and asteroids is None:
            raise ValueError(f"{', '.join(self.asteroids)}: places of asteroids come from a kernel; give asteroids=")
        if self.drag == "msis" and air is None:
            raise ValueError(
                "drag 'msis' needs air=earth.Thermosphere(...): space weather and an orbit about which it is wanted"
            )
        if self.about == "sun" and kernel is None and self.bodies:
            off = ", ".join(f"{name} {SERIES_ERROR[name]} km" for name in self.bodies)
            warnings.warn(
                f"places of planets by series are off by up to {off}: give kernel=, a file of JPL such as de440s.bsp",
                EphemerisWarning,
                stacklevel=2,
            )
        return self._functions(Epoch(epoch), eop, kernel, asteroids, air)

    def _functions(self, epoch: Epoch, *data: Any) -> dict[str, Any]:
        """As `functions`; without data what has the same signatures."""
        eop, kernel, asteroids, air = data or (None, None, "", force_air.NOWHERE)
        names = [name for name in self.places if name not in self.asteroids]
        if self.about == "sun":
            return {
                **{name: Body(name, epoch, kernel, "sun", "TDB") for name in names},
                **{name: Asteroid(force_sun.NUMBERS[name], epoch, asteroids) for name in self.asteroids},
            }
        recipes: dict[str, Any] = {
            "field": Gravity(self.field.at(epoch), self.degree, self.gradient_degree),
            "fixed": Rotation("GCRF", "ITRF", epoch, eop),
            "free": Rotation("ITRF", "GCRF", epoch, eop),
            **{name: Body(name, epoch, kernel) for name in names},
            **{f"{kind}_tide": TidalHarmonics(kind, epoch, eop) for kind in ("k1", "pole") if kind in self.tides},
        }
        if "de-sitter" in cast("tuple[str, ...]", self.relativity or ()):
            recipes["geodesic"] = GeodesicPrecession(epoch)
        if self.drag in ("harris-priester", "msis"):
            recipes["air"] = HarrisPriester() if self.drag == "harris-priester" else air
        return recipes


def unit_of(name: str) -> str:
    """The unit of a parameter of forces, also of one of several that are numbered; "" for none."""
    return UNITS.get(name, UNITS.get(re.sub(r"(_\d+)+$", "", name), ""))
