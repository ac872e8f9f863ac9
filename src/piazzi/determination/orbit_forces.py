"""Which forces an orbit is determined with: by its height, as text, as an object, or none."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import ceil, log, pi
from typing import Any

import numpy as np

from piazzi.determination.words import pairs
from piazzi.earth import Forces, laser_sphere
from piazzi.earth.constants import GM
from piazzi.earth.tides import RADIUS
from piazzi.orbit import Keplerian
from piazzi.problem import Gaussian
from piazzi.problem.checks import Array

DEGREES = (12, 20, 40, 70)
SMALL = 1e-6  # of the central term at the lowest point: what the field is cut off at
AIR_BELOW = 1.0e6  # m of height, below which there is air
STEPS = 100  # of order 8 in a turn at the pericentre's rate
CR, CD = 1.13, 2.2  # coefficients of bodies whose mass and area are known
AREA_TO_MASS = 0.02  # m2/kg, of a satellite that nobody knows; its sigma too
COEFFICIENTS = {"cr": "cr_a_m", "cd": "cd_a_m"}
KEYS = ("gravity", "degree", "bodies", "tides", "relativity", "radiation", "drag", "empirical")


@dataclass(frozen=True, eq=False)
class Chosen:
    """Forces with the roles and values of their parameters.

    `facts` is what a result tells of them, `left_out` what is not modelled, `assumed` where numbers came from.
    """

    forces: Forces
    roles: Mapping[str, str]
    values: Mapping[str, Any]
    facts: Mapping[str, Any]
    max_step: float
    left_out: Mapping[str, str] = field(default_factory=dict)
    assumed: tuple[str, ...] = ()


def chosen_forces(
    given: Any,
    state: Array,
    *,
    name: str = "",
    mass: float | None = None,
    area: float | None = None,
    drag: bool = True,
) -> Chosen:
    """The forces for an orbit.

    Parameters
    ----------
    given : "default", "none", text such as ``"gravity=EGM2008 degree=40 drag=exponential"``, or `earth.Forces`
    state : (6,) of the GCRF, whose height the defaults are by
    name : of the object, by which laser spheres are known
    mass, area : kg, m2
    drag : whether air may be among the defaults

    Raises
    ------
    ValueError
        For forces that there are not.
    """
    pericentre, _, rate = shape(state)
    height = pericentre - RADIUS
    degree = _degree(pericentre)
    if isinstance(given, Forces):
        forces, source = given, "given"
    elif given in (None, "", "default"):
        air = drag and height < AIR_BELOW
        forces = Forces(
            degree=degree,
            radiation="cannonball",
            drag="exponential" if air else False,
            air_height=_air(height) if air else 400e3,
        )
        source = f"default at {height / 1e3:,.0f} km"
    elif given == "none":
        forces, source = Forces(degree=0, bodies=(), tides=(), relativity=False), "none"
    else:
        forces, source = _of_text(str(given), degree, height), "given"
    roles, values, assumed = _coefficients(forces, name, mass, area)
    facts = {
        "source": source, "gravity": str(getattr(forces.field, "name", "") or forces.gravity), "degree": forces.degree,
        "bodies": list(forces.bodies), "tides": list(forces.tides), "relativity": bool(forces.relativity),
        "radiation": forces.radiation or None, "drag": forces.drag or None, "empirical": list(forces.empirical),
    }  # fmt: skip
    left_out = {}
    if forces.drag == "exponential":
        left_out["density"] = (
            "air falls off exponentially and does not follow the Sun's activity, which may be wrong by half of the drag"
        )
    elif height < AIR_BELOW and not forces.drag:
        left_out["drag"] = "there is air at this height, and no drag among the forces"
    max_step = 2.0 * pi / (STEPS * rate)
    return Chosen(forces, roles, values, facts, max_step, left_out, assumed)


def shape(state: Array) -> tuple[float, float, float]:
    """Distances of pericentre and apocentre (m; infinite for a hyperbola) and the rate of turning at the pericentre (rad/s)."""
    p, e = (float(x) for x in Keplerian(size="p").from_state(state[:3], state[3:], GM["earth"])[:2])
    pericentre = p / (1.0 + e)
    apocentre = p / (1.0 - e) if e < 1.0 else np.inf
    return pericentre, apocentre, float(np.sqrt(GM["earth"] * p)) / pericentre**2


def _degree(pericentre: float) -> int:
    ratio = RADIUS / max(pericentre, 1.02 * RADIUS)
    wanted = ceil(log(SMALL) / log(ratio))
    return next((degree for degree in DEGREES if degree >= wanted), DEGREES[-1])


def _air(height: float) -> float:
    """A height (m) that densities are right about, to ten kilometres."""
    return float(np.clip(round(height / 1e4) * 1e4, 100e3, 1000e3))


def _of_text(text: str, degree: int, height: float) -> Forces:
    found = pairs(text, "--forces", KEYS, '"gravity=EGM2008 degree=40 drag=exponential"')
    words: dict[str, Any] = {"degree": degree, "radiation": "cannonball", "air_height": _air(height)}
    for name, value in found.items():
        lists = name in ("bodies", "tides", "empirical")
        if lists:
            words[name] = tuple(part for part in value.split(",") if part and value not in ("none", "false"))
        elif name == "degree":
            if not value.isdecimal():
                raise ValueError(f"--forces: degree is {value[:40]!r}; it must be a whole number")
            words[name] = int(value)
        elif value.lower() in ("none", "false", "no", "off"):
            words[name] = False
        elif name == "relativity":
            if value.lower() not in ("true", "yes", "on", "schwarzschild"):
                raise ValueError(f"--forces: relativity is {value[:40]!r}; it is on or off")
            words[name] = True
        else:
            words[name] = value
    try:
        return Forces(**words)
    except (ValueError, TypeError) as error:
        raise ValueError(f"--forces: {error}") from None


def _coefficients(
    forces: Forces, name: str, mass: float | None, area: float | None
) -> tuple[dict[str, str], dict[str, Any], tuple[str, ...]]:
    """Roles and values of coefficients times area over mass: fixed of laser spheres, else estimated."""
    roles: dict[str, str] = {}
    values: dict[str, Any] = dict(forces.values)
    assumed: list[str] = []
    ratio = None
    if mass is not None and area is not None:
        ratio = area / mass
    else:
        try:
            sphere = laser_sphere(name) if name else None
        except KeyError:
            sphere = None
        if sphere is not None:
            ratio = sphere.area_to_mass
            assumed.append(f"{sphere.name}: {sphere.area_to_mass:.3g} m2/kg ({sphere.source})")
    for parameter, coefficient, wanted in (("cr_a_m", CR, forces.radiation), ("cd_a_m", CD, forces.drag)):
        if not wanted:
            continue
        if ratio is not None and parameter == "cr_a_m" and mass is None:
            values[parameter] = coefficient * ratio
            assumed.append(f"cr = {CR:g} of the sphere")
            continue
        roles[parameter] = "estimated"
        mean = AREA_TO_MASS if ratio is None else coefficient * ratio
        spread = AREA_TO_MASS if ratio is None else 0.5 * mean
        values[parameter] = Gaussian(mean, spread**2)
        assumed.append(f"{parameter} is estimated, before the measurements {mean:.3g} +- {spread:.3g} m2/kg")
    for name_ in forces.parameters:
        if name_ not in values and name_ not in roles:
            roles[name_], values[name_] = "estimated", Gaussian(0.0, 1e-14)  # empirical constants, m/s2
    return roles, values, tuple(assumed)
