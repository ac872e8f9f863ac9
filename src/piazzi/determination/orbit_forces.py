"""Which forces an orbit is determined with: by its height, as text, as an object, or none."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

from piazzi.determination.motion import Extra
from piazzi.earth import ForceChoice, Forces, LaserSphere, laser_sphere, read_forces
from piazzi.earth.defaults import AIR_BELOW, lowest_height
from piazzi.earth.force_air import air
from piazzi.earth.force_options import EMPIRICAL, SUNLIGHT, grouped
from piazzi.earth.scales import Orientation
from piazzi.earth.stepping import longest_step
from piazzi.earth.subdaily import WITHIN_THE_DAY
from piazzi.problem import Gaussian
from piazzi.problem.checks import Array

ACCELERATION = 1e-7  # m/s2: sigma of a constant acceleration
DEPARTS = 0.05  # sigma of each share of sunlight: those of GPS satellites go to 0.04
STEPS = 200  # of order 8 in a turn at the pericentre's rate
CR, CD = 1.13, 2.2  # coefficients of bodies whose mass and area are known
AIR = "(variations as Emmert 2015, Adv. Space Res. 56, 773, reviews them)"
COEFFICIENTS = {"cr": "cr_a_m", "cd": "cd_a_m"}


class AirVaries(NamedTuple):
    """Sigma of the logarithm of the density over that of its model, and over how many seconds it stays so."""

    sigma: float
    time: float


@dataclass(frozen=True, eq=False)
class Chosen:
    """Forces with the roles and values of their parameters.

    `facts` is what a result tells of them, `left_out` what is not modelled, `assumed` where numbers came from, `extra` what
    is added to them, `air_varies` what density does when nothing is measured any more.
    """

    choice: ForceChoice
    roles: Mapping[str, str]
    values: Mapping[str, Any]
    facts: Mapping[str, Any]
    max_step: float
    left_out: Mapping[str, str] = field(default_factory=dict)
    assumed: tuple[str, ...] = ()
    extra: Extra = field(default_factory=Extra)
    air_varies: AirVaries | None = None

    @property
    def forces(self) -> Forces:
        """The forces themselves."""
        return self.choice.forces


def chosen_forces(
    given: Any,
    state: Array,
    *,
    name: str = "",
    mass: float | None = None,
    area: float | None = None,
) -> Chosen:
    """The forces for an orbit.

    Parameters
    ----------
    given : "default", "none", text such as ``"gravity=EGM2008 degree=40 drag=exponential"``, or `earth.Forces`
    state : (6,) of the GCRF, whose height the defaults are by
    name : of the object, by which laser spheres are known
    mass, area : kg, m2

    Raises
    ------
    ValueError
        For forces that there are not.
    """
    choice = _choice(given, state)
    forces = choice.forces
    roles, values, assumed = _coefficients(choice, name, mass, area)
    choice = replace(choice, sphere=choice.sphere or _ratio(name, mass, area)[1] is not None)
    facts = {
        "source": choice.source, "gravity": forces.field.name, "degree": forces.degree, "bodies": list(forces.bodies),
        "tides": list(forces.tides), "relativity": bool(forces.relativity), "radiation": forces.radiation or None,
        "drag": forces.drag or None, "empirical": grouped(forces.empirical),
    }  # fmt: skip
    left_out = {}
    varies, height = None, lowest_height(state[:3], state[3:])
    if forces.drag:
        varies = air_varies(height, forces.drag == "msis")
        share, hours = f"{varies.sigma:.0%}", f"{varies.time / 3600:g} h"
        assumed = (
            *assumed,
            f"the density departs from its model by {share}, correlated over {hours} {AIR}",
        )
    if varies is not None and forces.drag != "msis":
        told = "as if F10.7 were 150" if forces.drag == "harris-priester" else "the same always"
        cost = varies.sigma * _after_a_day(height, state, values.get("cd_a_m"))
        left_out["density"] = f"air is {told}; what it varies by, {share}, moves the orbit up to {cost:.2g} m along in a day"
    elif height < AIR_BELOW and not forces.drag:
        left_out["drag"] = "there is air at this height, and no drag among the forces"
    step = longest_step(state[:3], state[3:6], STEPS)
    return Chosen(choice, roles, values, facts, step, left_out, assumed, air_varies=varies)


def usual_sigma(name: str) -> float:
    """That of an empirical acceleration where none is given (m/s2), or of a share of sunlight."""
    return DEPARTS if name in SUNLIGHT else ACCELERATION


def orientation_of(given: Any) -> Orientation | None:
    """The orientation of the Earth that forces say, which is that of the stations too; None where they say none."""
    if isinstance(given, ForceChoice):
        return given.eop
    if isinstance(given, Forces):
        return WITHIN_THE_DAY
    with suppress(ValueError, OSError):  # who makes the forces tells of it
        return read_forces("default" if given is None else str(given), AIR_BELOW).eop
    return None


def check_forces(given: Any) -> None:
    """Raise ValueError or OSError for forces about the Earth that there are not, at whatever height."""
    _choice(given, np.array([7.5e6, 0.0, 0.0, 0.0, 7.3e3, 0.0]))


def air_varies(height: float, weather: bool) -> AirVaries:
    """Grows with height, as the Sun's activity matters more there; less where space weather is followed."""
    share = float(np.interp(height, (300e3, 800e3), (0.2, 0.5)))
    return AirVaries(0.5 * share, 6 * 3600.0) if weather else AirVaries(share, 86400.0)


def _after_a_day(height: float, state: Array, coefficient: Any) -> float:
    """How far drag as at the lowest point moves a satellite along its orbit in a day (m): 3/2 a t^2."""
    density = air(min(max(height, 100e3), 1500e3))[0]
    size = float(np.ravel(coefficient.mean)[0]) if isinstance(coefficient, Gaussian) else float(coefficient or 0.0)
    return 1.5 * 0.5 * size * density * float(state[3:6] @ state[3:6]) * 86400.0**2


def _choice(given: Any, state: Array) -> ForceChoice:
    if isinstance(given, ForceChoice):
        return given
    if isinstance(given, Forces):
        return ForceChoice(given, "given", eop=WITHIN_THE_DAY)
    try:
        return read_forces("default" if given is None else str(given), lowest_height(state[:3], state[3:]))
    except ValueError as error:
        option = "--guess" if "comes down to" in str(error) else "--forces"
        raise ValueError(f"{option}: {str(error).removeprefix('forces: ')}") from None


def _coefficients(
    choice: ForceChoice, name: str, mass: float | None, area: float | None
) -> tuple[dict[str, str], dict[str, Any], tuple[str, ...]]:
    """Roles and values of coefficients: fixed of laser spheres and where text says them, else estimated."""
    roles: dict[str, str] = {}
    values: dict[str, Any] = dict(choice.values)
    open_ = {text.partition(" = ")[0] for text in choice.assumed}
    accelerations = [name for name in choice.forces.parameters if name in open_ and name in EMPIRICAL]
    own = {*COEFFICIENTS.values(), *accelerations}
    assumed = [text for text in choice.assumed if text.partition(" = ")[0] not in own]
    ratio, sphere = _ratio(name, mass, area)
    if open_ & {*COEFFICIENTS.values()} and (mass is None) != (area is None):
        told, lost = ("mass", "area") if area is None else ("area", "mass")
        assumed.append(f"--{told} alone says nothing of drag and sunlight, as --{lost} is not given")
    for parameter, coefficient in (("cr_a_m", CR), ("cd_a_m", CD)):
        if parameter not in open_:
            continue
        if sphere is not None and parameter == "cr_a_m":
            values[parameter], told = _sunlight(sphere)
            assumed.append(told)
            continue
        roles[parameter] = "estimated"
        mean = values[parameter] if ratio is None else coefficient * ratio
        spread = mean if ratio is None else 0.5 * mean
        values[parameter] = Gaussian(mean, spread**2)
        assumed.append(f"{parameter} is estimated, before the measurements {mean:.3g} +- {spread:.3g} m2/kg")
    for constant in accelerations:
        sigma = usual_sigma(constant)
        roles[constant], values[constant] = "estimated", Gaussian(0.0, sigma**2)
        unit = "" if constant in SUNLIGHT else " m/s2"
        assumed.append(f"{constant} is estimated, before the measurements 0 +- {sigma:g}{unit}")
    return roles, values, tuple(assumed)


def with_sphere(choice: ForceChoice, name: str) -> tuple[ForceChoice, tuple[str, ...]]:
    """The forces with the sunlight on a laser sphere of that name, where nobody says its coefficient; and what is assumed."""
    _, sphere = _ratio(name, None, None)
    lost = [text for text in choice.assumed if text.startswith("cr_a_m = ")]
    if sphere is None or not lost:
        return choice, choice.assumed
    value, told = _sunlight(sphere)
    left = (text for text in choice.assumed if text not in lost)
    return replace(choice, values={**choice.values, "cr_a_m": value}), (*left, told)


def _sunlight(sphere: LaserSphere) -> tuple[float, str]:
    """The coefficient of sunlight on a laser sphere (m2/kg), and where it is from."""
    said = f"cr = {CR:g} and {sphere.area_to_mass:.3g} m2/kg of {sphere.name} ({sphere.source})"
    return CR * sphere.area_to_mass, said


def _ratio(name: str, mass: float | None, area: float | None) -> tuple[float | None, LaserSphere | None]:
    """Area over mass, and the laser sphere that it is of, where it is one."""
    if mass is not None and area is not None:
        return area / mass, None
    try:
        sphere = laser_sphere(name) if name else None
    except KeyError:
        sphere = None
    return (None, None) if sphere is None else (sphere.area_to_mass, sphere)
