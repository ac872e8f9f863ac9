"""The forces on a satellite of the Earth, as text of the language: each a few definitions and three components.

Axes are those of the GCRF, units SI.  The state is x, y, z, vx, vy, vz.

Sources: Montenbruck and Gill, Satellite Orbits (2000), 3.3, 3.4, 3.5, 3.7; IERS Conventions 2010, 6.2.1 and 10.3.  Drag has a
module of its own.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import pi, sqrt

from piazzi.earth.constants import (
    ASTRONOMICAL_UNIT,
    EARTH_MOMENTUM,
    EARTH_SPIN,
    GM,
    LOVE_K2,
    MOON_RADIUS,
    SOLAR_PRESSURE,
    SPEED_OF_LIGHT,
    SUN_RADIUS,
)
from piazzi.earth.geodetic import ELLIPSOIDS
from piazzi.earth.tides import RADIUS

BODIES = tuple(name for name in GM if name not in ("earth", "pluto"))  # Pluto has no series
EARTH_RADIUS, FLATTENING = ELLIPSOIDS["WGS84"]
TURN = ("turn_x", "turn_y", "turn_z")
SPIN = {", ".join(TURN): f"free(t, 0, 0, {EARTH_SPIN!r})"}
EDGE = 1.0 - 1e-9  # as near to the edges of the penumbra as the arcsine is asked for


@dataclass(frozen=True)
class Force:
    """A force: named values, acceleration along x, y, z, and the parameters that it has; `switch` is one of them.

    With `fixed` the acceleration is along the axes fixed to the Earth, from bx, by, bz.
    """

    switch: str
    definitions: Mapping[str, str]
    acceleration: tuple[str, str, str]
    parameters: tuple[str, ...] = ()  # the user's to give
    values: Mapping[str, float] = field(default_factory=dict)  # those that have a value
    fixed: bool = False


def gravity(fixed: Sequence[Force] = ()) -> Force:
    """The field, whole, by way of the axes fixed to the Earth, in which other forces may be added."""
    text = {
        "bx, by, bz": "fixed(t, x, y, z)",
        "field_x, field_y, field_z": "field(bx, by, bz)",
        "ax, ay, az": f"free(t, {', '.join(_with(f'field_{a}', i, fixed) for i, a in enumerate('xyz'))})",
        "r": "sqrt(x**2 + y**2 + z**2)",
    }
    return Force("", text, ("ax", "ay", "az"))


def _with(value: str, axis: int, forces: Sequence[Force]) -> str:
    return " + ".join([value, *(f"{force.switch}*{force.acceleration[axis]}" for force in forces)])


def degree_2(kind: str) -> Force:
    """What a tide that is given as coefficients over time does: the gradient of its potential of degree 2."""
    c20, c21, s21, c22, s22 = (f"{kind}_{name}" for name in ("c20", "c21", "s21", "c22", "s22"))
    a, b, size = sqrt(5.0), sqrt(15.0), GM["earth"] * RADIUS**2
    text = {
        f"{c20}, {c21}, {s21}, {c22}, {s22}": f"{kind}_tide(t)",
        f"{kind}_gx": f"{b!r}*({c21}*bz + {c22}*bx + {s22}*by) - {a!r}*{c20}*bx",
        f"{kind}_gy": f"{b!r}*({s21}*bz - {c22}*by + {s22}*bx) - {a!r}*{c20}*by",
        f"{kind}_gz": f"{b!r}*({c21}*bx + {s21}*by) + {2 * a!r}*{c20}*bz",  # of q, which is q = r . grad q / 2
        f"{kind}_size": f"{size!r}/r**5",
        f"{kind}_in": f"2.5*{kind}_size*(bx*{kind}_gx + by*{kind}_gy + bz*{kind}_gz)/r**2",
    }
    pull = tuple(f"({kind}_size*{kind}_g{c} - {kind}_in*b{c})" for c in "xyz")
    return Force(f"{kind}_on", text, pull, fixed=True)  # type: ignore[arg-type]


def body_place(name: str) -> dict[str, str]:
    """Position of a body and its distance from the Earth."""
    return {
        f"{name}_x, {name}_y, {name}_z": f"{name}(t)",
        f"{name}_r": f"sqrt({name}_x**2 + {name}_y**2 + {name}_z**2)",
        **{f"{name}_d{a}": f"{name}_{a} - {a}" for a in "xyz"},
        f"{name}_d": f"sqrt({name}_dx**2 + {name}_dy**2 + {name}_dz**2)",
    }


def third_body(name: str, gm: float) -> Force:
    """What a body draws the satellite with, less what it draws the Earth (or the Sun) with."""
    text = {f"{name}_near": f"{gm!r}/{name}_d**3", f"{name}_far": f"{gm!r}/{name}_r**3"}
    pull = tuple(f"({name}_near*{name}_d{a} - {name}_far*{name}_{a})" for a in "xyz")
    return Force(f"{name}_on", text, pull)  # type: ignore[arg-type]


def solid_tide(name: str) -> Force:
    """The tide that a body raises in the Earth, degree 2, the permanent part included."""
    text = {
        f"{name}_cos": f"(x*{name}_x + y*{name}_y + z*{name}_z)/(r*{name}_r)",
        f"{name}_swell": f"{LOVE_K2 / 2 * GM[name] * RADIUS**5!r}/({name}_r**3*r**4)",
        f"{name}_up": f"{name}_swell*(3 - 15*{name}_cos**2)/r",
        f"{name}_toward": f"6*{name}_swell*{name}_cos/{name}_r",
    }
    pull = tuple(f"({name}_up*{a} + {name}_toward*{name}_{a})" for a in "xyz")
    return Force("tides_on", text, pull)  # type: ignore[arg-type]


def schwarzschild(gm: float) -> Force:
    """Schwarzschild's term of general relativity."""
    text = {
        "relativity_c": f"{gm / SPEED_OF_LIGHT**2!r}/r**3",
        "relativity_r": f"relativity_c*({4 * gm!r}/r - vx**2 - vy**2 - vz**2)",
        "relativity_v": "4*relativity_c*(x*vx + y*vy + z*vz)",
    }
    return Force("relativity_on", text, tuple(f"(relativity_r*{a} + relativity_v*v{a})" for a in "xyz"))  # type: ignore[arg-type]


def lense_thirring() -> Force:
    """What the spin of the Earth drags along: eq. 10.12 of the IERS Conventions."""
    spin = EARTH_MOMENTUM / EARTH_SPIN
    text = SPIN | _cross("drags", "xyz", ("vx", "vy", "vz")) | _cross("dragged", ("vx", "vy", "vz"), TURN)
    text |= {
        "drag_size": f"{2 * GM['earth'] * spin / SPEED_OF_LIGHT**2!r}/r**3",
        "drag_along": "3*(x*turn_x + y*turn_y + z*turn_z)/r**2",
    }
    return Force("lense_thirring_on", text, tuple(f"drag_size*(drag_along*drags_{a} + dragged_{a})" for a in "xyz"))  # type: ignore[arg-type]


def de_sitter() -> Force:
    """What the motion about the Sun turns: twice the geodesic precession across the velocity."""
    text = {"geodesic_x, geodesic_y, geodesic_z": "geodesic(t)"}
    text |= _cross("geodesic_v", ("geodesic_x", "geodesic_y", "geodesic_z"), ("vx", "vy", "vz"))
    return Force("de_sitter_on", text, tuple(f"2*geodesic_v_{a}" for a in "xyz"))  # type: ignore[arg-type]


def _cross(name: str, u: Sequence[str], v: Sequence[str]) -> dict[str, str]:
    """The three components of a cross product."""
    pairs = zip("xyz", ((1, 2), (2, 0), (0, 1)), strict=True)
    return {f"{name}_{a}": f"{u[i]}*{v[j]} - {u[j]}*{v[i]}" for a, (i, j) in pairs}


SHADOW_EDGES = {"sunlit": "shadow - disc", "half_lit": "shadow + disc"}  # positive in full light, and where some is left


def radiation(shadows: Sequence[str]) -> Force:
    """Sunlight on a sphere, `cr_a_m` its coefficient times area over mass, with the shadows of the Earth and the Moon.

    `shadow` is the angle between the limbs of Earth and Sun, positive in the light; `lit` the part of the Sun that is seen.
    """
    text = {"disc": f"asin({SUN_RADIUS!r}/sun_d)"}
    text |= {name: line for body in shadows for name, line in (_earth_shadow() if body == "earth" else _moon_shadow()).items()}
    text["lit"] = "*".join(f"{body}_lit" for body in shadows) or "1"
    text["light"] = f"-{SOLAR_PRESSURE * ASTRONOMICAL_UNIT**2!r}*cr_a_m*lit/sun_d**3"
    values = {"moon_shadow_on": 1.0} if "moon" in shadows else {}
    return Force("radiation_on", text, tuple(f"light*sun_d{a}" for a in "xyz"), ("cr_a_m",), values)  # type: ignore[arg-type]


def _earth_shadow() -> dict[str, str]:
    """The part of the Sun's disc beside the Earth's limb, which is taken as an arc of its curvature on the sky."""
    side = tuple(f"sun_d{a}" for a in "xyz")
    return _cross("side", "xyz", side) | {
        "apart": "atan2(sqrt(side_x**2 + side_y**2 + side_z**2), -(x*sun_dx + y*sun_dy + z*sun_dz))",
        "shadow": f"apart - asin({EARTH_RADIUS!r}/r)",
        "edge": f"max(min(shadow/disc, {EDGE!r}), -{EDGE!r})",
        "chord": "sqrt(1 - edge**2)",
        "limb": f"disc*sqrt(r**2 - {EARTH_RADIUS**2!r})/{3 * EARTH_RADIUS!r}",
        "earth_lit": f"0.5 + (asin(edge) + edge*chord + limb*chord**3)/{pi!r}",
    }


def _moon_shadow() -> dict[str, str]:
    """The part of the Sun's disc that the Moon's leaves: two circles on the sky, less the segments that they share."""
    text = _cross("moon_side", tuple(f"moon_d{a}" for a in "xyz"), tuple(f"sun_d{a}" for a in "xyz")) | {
        "moon_across": "sqrt(moon_side_x**2 + moon_side_y**2 + moon_side_z**2)",
        "moon_apart": "atan2(moon_across, moon_dx*sun_dx + moon_dy*sun_dy + moon_dz*sun_dz)",
        "moon_disc": f"asin({MOON_RADIUS!r}/moon_d)",
        "moon_between": f"2*max(moon_apart, {1.0 - EDGE!r})",
    }
    for one, other in (("disc", "moon_disc"), ("moon_disc", "disc")):
        text[f"{one}_cos"] = f"max(min((moon_apart**2 + {one}**2 - {other}**2)/(moon_between*{one}), {EDGE!r}), -{EDGE!r})"
        text[f"{one}_part"] = f"{one}**2*(acos({one}_cos) - {one}_cos*sqrt(1 - {one}_cos**2))"
    return text | {"moon_lit": f"1 - moon_shadow_on*(disc_part + moon_disc_part)/({pi!r}*disc**2)"}


def empirical(names: Sequence[str]) -> Force:
    """Accelerations (m/s2) along R, T and N that are parameters.

    Those named `radial`, `along`, `cross` are constant; with `_sin` or `_cos` they go with that of the argument of latitude.
    """
    text = dict(LATITUDE if any("_" in name for name in names) else ORBIT_AXES)
    sizes: dict[str, list[str]] = {}
    for name in names:
        direction, _, wave = name.partition("_")
        sizes.setdefault(direction, []).append(f"{name}*latitude_{wave}" if wave else name)
    text |= {f"{direction}_size": " + ".join(parts) for direction, parts in sizes.items()}
    total = along_axes({f"{name}_size": name for name in sizes}, [f"{name}_size" for name in sizes])
    return Force("empirical_on", text, total, tuple(names))


def sunlight(names: Sequence[str]) -> Force:
    """What sunlight on a body does that it does not on a sphere, in shares of what it does to that.

    Shares are along D, to the Sun, Y, across the directions of the Sun and the Earth, and B, across both: the axes of a body
    that turns itself to the Earth and its panels to the Sun.  With `_cos` and `_sin` they go with the components of D along R
    and T, with `_cos2` and `_sin2` with what twice that angle has.  Where the Sun is above or below the body, Y turns over
    within some degrees.

    Sources: the model ECOM, Beutler et al. (1994), Manuscripta Geodaetica 19, 367; Springer et al. (1999), GPS Solutions 2, 50;
    for waves along D Arnold et al. (2015), J. Geodesy 89, 775.
    """
    text = ORBIT_AXES | {f"to_sun_{a}": f"sun_d{a}/sun_d" for a in "xyz"}
    sun = tuple(f"to_sun_{a}" for a in "xyz")
    text |= _cross("panel", sun, "xyz") | _cross("ahead", ("hx", "hy", "hz"), "xyz")
    text |= {
        "panel": f"sqrt(panel_x**2 + panel_y**2 + panel_z**2 + {TURNS_OVER**2!r}*r**2)",
        "light_cos": "(x*to_sun_x + y*to_sun_y + z*to_sun_z)/r",
        "light_sin": "(ahead_x*to_sun_x + ahead_y*to_sun_y + ahead_z*to_sun_z)/(h*r)",
        "light_cos2": "light_cos**2 - light_sin**2",
        "light_sin2": "2*light_cos*light_sin",
    }
    text |= _cross("across", sun, ("panel_x", "panel_y", "panel_z"))
    sizes: dict[str, list[str]] = {axis: [] for axis in "dyb"}
    for name in names:
        _, axis, *wave = name.split("_")
        sizes[axis].append("*".join([name, *(f"light_{one}" for one in wave)]))
    text |= {f"light_{axis}_size": " + ".join(parts) or "0" for axis, parts in sizes.items()}
    text["light_on_body"] = "-light*sun_d"
    total = tuple(
        f"light_on_body*(light_d_size*to_sun_{a} + (light_y_size*panel_{a} + light_b_size*across_{a})/panel)" for a in "xyz"
    )
    return Force("radiation_on", text, total, tuple(names))  # type: ignore[arg-type]


TURNS_OVER = 0.05  # rad: what the angle between Sun and Earth is when a body turns as fast as it can
ORBIT_AXES = {f"h{a}": f"{b}*v{c} - {c}*v{b}" for a, b, c in ("xyz", "yzx", "zxy")} | {"h": "sqrt(hx**2 + hy**2 + hz**2)"}
LATITUDE = ORBIT_AXES | {  # its argument, from the ascending node; without an inclination there is none, and no wave
    "node": "r*sqrt(hx**2 + hy**2 + 1e-24*h**2)",
    "latitude_sin": "z*h/node",
    "latitude_cos": "(y*hx - x*hy)/node",
}
_UNIT = {
    "radial": {a: f"{a}/r" for a in "xyz"},
    "along": {a: f"(h{b}*{c} - h{c}*{b})/(h*r)" for a, b, c in ("xyz", "yzx", "zxy")},
    "cross": {a: f"h{a}/h" for a in "xyz"},
}


def along_axes(directions: Mapping[str, str], names: Sequence[str]) -> tuple[str, str, str]:
    """The components along x, y, z of named sizes along the axes R, T and N of the orbit."""
    x, y, z = ("(" + " + ".join(f"{name}*{_UNIT[directions[name]][a]}" for name in names) + ")" for a in "xyz")
    return x, y, z
