"""Drag as text of the language, by three models of the density of the air.

Sources: Montenbruck and Gill, Satellite Orbits (2000), 3.5; U.S. Standard Atmosphere 1976; CIRA-72.
"""

from __future__ import annotations

from math import cos, exp, radians, sin

from piazzi.earth.atmosphere import BOTTOM, BOTTOM_SCALES, TOP, TOP_SCALES
from piazzi.earth.force_text import EARTH_RADIUS, FLATTENING, SPIN, Force
from piazzi.model.functions import Signature

AIR_TERMS = 8  # of the polynomials of a thermosphere
# Height (km), density (kg/m3) and scale height (km): U.S. Standard Atmosphere 1976 and CIRA-72
ATMOSPHERE = (
    (100, 5.297e-7, 5.877), (110, 9.661e-8, 7.263), (120, 2.438e-8, 9.473), (130, 8.484e-9, 12.636), (140, 3.845e-9, 16.149),
    (150, 2.070e-9, 22.523), (180, 5.464e-10, 29.740), (200, 2.789e-10, 37.105), (250, 7.248e-11, 45.546),
    (300, 2.418e-11, 53.628), (350, 9.518e-12, 53.298), (400, 3.725e-12, 58.515), (450, 1.585e-12, 60.828),
    (500, 6.967e-13, 63.822), (600, 1.454e-13, 71.835), (700, 3.614e-14, 88.667), (800, 1.170e-14, 124.64),
    (900, 5.245e-15, 181.05), (1000, 3.019e-15, 268.00),
)  # fmt: skip
LAG = radians(30.0)  # of the bulge behind the Sun
EXPONENT = 2.0  # about right for low inclinations, 6 for polar orbits
NOWHERE = Signature.of_table(7, AIR_TERMS)  # of a thermosphere that is not made yet
# Over the ellipsoid: to the second order of the flattening, 0.06 m off; the first is 26 m off, one in 2000 of the density
_ALTITUDE = (
    f"r - {EARTH_RADIUS!r} + latitude_sin2*({EARTH_RADIUS * FLATTENING!r}"
    f" + {EARTH_RADIUS * FLATTENING**2!r}*(1 - latitude_sin2)*({2 * EARTH_RADIUS!r}/r - 0.5))"
)
DENSITIES = ("exponential", "harris-priester", "msis")


def drag(kind: str, height: float) -> Force:
    """Air that turns with the Earth on a sphere of `cd_a_m`, its coefficient times area over mass."""
    density, values = {"exponential": _exponential, "harris-priester": _harris_priester, "msis": _msis}[kind](height)
    text = {
        "latitude_sin2": "bz**2/r**2",
        "altitude": _ALTITUDE,
        **density,
        **SPIN,
        "wind_x": "vx - turn_y*z + turn_z*y",
        "wind_y": "vy - turn_z*x + turn_x*z",
        "wind_z": "vz - turn_x*y + turn_y*x",
        "resistance": "-0.5*cd_a_m*density*sqrt(wind_x**2 + wind_y**2 + wind_z**2)",
    }
    return Force("drag_on", text, tuple(f"resistance*wind_{a}" for a in "xyz"), ("cd_a_m",), values)  # type: ignore[arg-type]


def _exponential(height: float) -> tuple[dict[str, str], dict[str, float]]:
    density, scale = air(height)
    text = {"density": "air_density*exp((air_height - altitude)/air_scale)"}
    return text, {"air_density": density, "air_height": height, "air_scale": scale}


def air(height: float) -> tuple[float, float]:
    """Density (kg/m3) and scale height (m) at a height (m): those of the layer that it lies in."""
    if not 100e3 <= height <= 1500e3:
        raise ValueError(f"air_height is {height:g} m; densities are known from 100e3 to 1500e3 m")
    base, density, scale = max(row for row in ATMOSPHERE if row[0] * 1e3 <= height)
    return density * exp((base * 1e3 - height) / (scale * 1e3)), scale * 1e3


def _harris_priester(height: float) -> tuple[dict[str, str], dict[str, float]]:
    """Between the least density, at night, and the largest, in a bulge behind the Sun; exponential beyond the table."""
    text = {
        "air_at": f"max(min(altitude, {TOP!r}), {BOTTOM!r})",
        "log_night, log_day": "air(air_at)",
        "bulge_x": f"{cos(LAG)!r}*sun_x - {sin(LAG)!r}*sun_y",
        "bulge_y": f"{sin(LAG)!r}*sun_x + {cos(LAG)!r}*sun_y",
        "bulge": "max(0.5 + 0.5*(x*bulge_x + y*bulge_y + z*sun_z)/(r*sun_r), 1e-12)**(air_exponent/2)",
        "air_over": f"max(altitude - {TOP!r}, 0)",
        "air_under": f"min(altitude - {BOTTOM!r}, 0)",
        **{
            f"{name}_air": f"exp(log_{name} - air_over/{TOP_SCALES[i]!r} - air_under/{BOTTOM_SCALES[i]!r})"
            for i, name in enumerate(("night", "day"))
        },
        "density": "night_air + (day_air - night_air)*bulge",
    }
    return text, {"air_exponent": EXPONENT}


def _msis(height: float) -> tuple[dict[str, str], dict[str, float]]:
    """The logarithm as a polynomial in the height beside that of a nominal arc, whose coefficients go with time."""
    text = {
        "air_0, air_1, air_2, air_3, air_4, arc_height, air_reach": "air(t)",
        "beside": "max(min((altitude - arc_height)/air_reach, 1), -1)",
        "density": "exp(air_0 + beside*(air_1 + beside*(air_2 + beside*(air_3 + beside*air_4))))",
    }
    return text, {}
