"""The forces on a satellite of the Earth, as text of the language: each a few definitions and three components.

Axes are those of the GCRF, units SI.  The state is x, y, z, vx, vy, vz.

Sources: Montenbruck and Gill, Satellite Orbits (2000), 3.3, 3.4, 3.5, 3.7; IERS Conventions 2010, 6.2.1 and 10.3.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import exp

from piazzi.earth.constants import ASTRONOMICAL_UNIT, EARTH_SPIN, GM, LOVE_K2, SOLAR_PRESSURE, SPEED_OF_LIGHT, SUN_RADIUS
from piazzi.earth.geodetic import ELLIPSOIDS
from piazzi.earth.tides import RADIUS

BODIES = tuple(name for name in GM if name not in ("earth", "pluto"))  # Pluto has no series
EARTH_RADIUS, FLATTENING = ELLIPSOIDS["WGS84"]
EDGE = 1.0 - 1e-9  # as near to the edges of the penumbra as the arcsine is asked for

# Height (km), density (kg/m3) and scale height (km): U.S. Standard Atmosphere 1976 and CIRA-72
ATMOSPHERE = (
    (100, 5.297e-7, 5.877), (110, 9.661e-8, 7.263), (120, 2.438e-8, 9.473), (130, 8.484e-9, 12.636), (140, 3.845e-9, 16.149),
    (150, 2.070e-9, 22.523), (180, 5.464e-10, 29.740), (200, 2.789e-10, 37.105), (250, 7.248e-11, 45.546),
    (300, 2.418e-11, 53.628), (350, 9.518e-12, 53.298), (400, 3.725e-12, 58.515), (450, 1.585e-12, 60.828),
    (500, 6.967e-13, 63.822), (600, 1.454e-13, 71.835), (700, 3.614e-14, 88.667), (800, 1.170e-14, 124.64),
    (900, 5.245e-15, 181.05), (1000, 3.019e-15, 268.00),
)  # fmt: skip


@dataclass(frozen=True)
class Force:
    """A force: named values, acceleration along x, y, z, and the parameters that it has; `switch` is one of them."""

    switch: str
    definitions: Mapping[str, str]
    acceleration: tuple[str, str, str]
    parameters: tuple[str, ...] = ()  # the user's to give
    values: Mapping[str, float] = field(default_factory=dict)  # those that have a value


def gravity() -> Force:
    """The field, whole, by way of the axes fixed to the Earth."""
    text = {
        "bx, by, bz": "fixed(t, x, y, z)",
        "field_x, field_y, field_z": "field(bx, by, bz)",
        "ax, ay, az": "free(t, field_x, field_y, field_z)",
        "r": "sqrt(x**2 + y**2 + z**2)",
    }
    return Force("", text, ("ax", "ay", "az"))


def body_place(name: str) -> dict[str, str]:
    """Position of a body and its distance from the Earth."""
    return {
        f"{name}_x, {name}_y, {name}_z": f"{name}(t)",
        f"{name}_r": f"sqrt({name}_x**2 + {name}_y**2 + {name}_z**2)",
        **{f"{name}_d{a}": f"{name}_{a} - {a}" for a in "xyz"},
        f"{name}_d": f"sqrt({name}_dx**2 + {name}_dy**2 + {name}_dz**2)",
    }


def third_body(name: str) -> Force:
    """What a body draws the satellite with, less what it draws the Earth with."""
    text = {f"{name}_near": f"{GM[name]!r}/{name}_d**3", f"{name}_far": f"{GM[name]!r}/{name}_r**3"}
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


def relativity() -> Force:
    """Schwarzschild's term of general relativity."""
    text = {
        "relativity_c": f"{GM['earth'] / SPEED_OF_LIGHT**2!r}/r**3",
        "relativity_r": f"relativity_c*({4 * GM['earth']!r}/r - vx**2 - vy**2 - vz**2)",
        "relativity_v": "4*relativity_c*(x*vx + y*vy + z*vz)",
    }
    return Force("relativity_on", text, tuple(f"(relativity_r*{a} + relativity_v*v{a})" for a in "xyz"))  # type: ignore[arg-type]


def radiation() -> Force:
    """Sunlight on a sphere, `cr_a_m` its coefficient times area over mass; the penumbra has the limb of the Earth straight.

    `shadow` is the angle between the limbs, positive in the light; `lit` the part of the Sun's disc that is seen.
    """
    text = {
        **{f"side_{a}": f"({b}*sun_d{c} - {c}*sun_d{b})" for a, b, c in ("xyz", "yzx", "zxy")},
        "apart": "atan2(sqrt(side_x**2 + side_y**2 + side_z**2), -(x*sun_dx + y*sun_dy + z*sun_dz))",
        "disc": f"asin({SUN_RADIUS!r}/sun_d)",
        "shadow": f"apart - asin({EARTH_RADIUS!r}/r)",
        "edge": f"max(min(shadow/disc, {EDGE!r}), -{EDGE!r})",
        "lit": "0.5 + (asin(edge) + edge*sqrt(1 - edge**2))/3.141592653589793",
        "light": f"-{SOLAR_PRESSURE * ASTRONOMICAL_UNIT**2!r}*cr_a_m*lit/sun_d**3",
    }
    return Force("radiation_on", text, tuple(f"light*sun_d{a}" for a in "xyz"), ("cr_a_m",))  # type: ignore[arg-type]


def drag(height: float) -> Force:
    """Air whose density falls exponentially about a height and that turns with the Earth; `cd_a_m` as `cr_a_m`."""
    density, scale = air(height)
    text = {
        "altitude": f"r - {EARTH_RADIUS!r}*(1 - {FLATTENING!r}*bz**2/r**2)",
        "density": "air_density*exp((air_height - altitude)/air_scale)",
        "turn_x, turn_y, turn_z": f"free(t, 0, 0, {EARTH_SPIN!r})",
        "wind_x": "vx - turn_y*z + turn_z*y",
        "wind_y": "vy - turn_z*x + turn_x*z",
        "wind_z": "vz - turn_x*y + turn_y*x",
        "resistance": "-0.5*cd_a_m*density*sqrt(wind_x**2 + wind_y**2 + wind_z**2)",
    }
    values = {"air_density": density, "air_height": height, "air_scale": scale}
    return Force("drag_on", text, tuple(f"resistance*wind_{a}" for a in "xyz"), ("cd_a_m",), values)  # type: ignore[arg-type]


def air(height: float) -> tuple[float, float]:
    """Density (kg/m3) and scale height (m) at a height (m): those of the layer that it lies in."""
    if not 100e3 <= height <= 1500e3:
        raise ValueError(f"air_height is {height:g} m; densities are known from 100e3 to 1500e3 m")
    base, density, scale = max(row for row in ATMOSPHERE if row[0] * 1e3 <= height)
    return density * exp((base * 1e3 - height) / (scale * 1e3)), scale * 1e3


def empirical(names: tuple[str, ...]) -> Force:
    """Constant accelerations along R, T and N (m/s2), which are the parameters `radial`, `along` and `cross`."""
    text: dict[str, str] = {}
    if "along" in names or "cross" in names:
        text |= {f"h{a}": f"{b}*v{c} - {c}*v{b}" for a, b, c in ("xyz", "yzx", "zxy")} | {"h": "sqrt(hx**2 + hy**2 + hz**2)"}
    parts = {
        "radial": {a: f"radial*{a}/r" for a in "xyz"},
        "along": {a: f"along*(h{b}*{c} - h{c}*{b})/(h*r)" for a, b, c in ("xyz", "yzx", "zxy")},
        "cross": {a: f"cross*h{a}/h" for a in "xyz"},
    }
    total = tuple("(" + " + ".join(parts[name][a] for name in names) + ")" for a in "xyz")
    return Force("empirical_on", text, total, names)  # type: ignore[arg-type]
