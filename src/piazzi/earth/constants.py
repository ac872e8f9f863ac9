"""The constants of Earth, Sun, Moon and planets that are used, each with its source: the table of the documentation."""

from __future__ import annotations

from typing import NamedTuple

from piazzi.earth.fields import PERMANENT_TIDE, gravity_field
from piazzi.earth.geodetic import ELLIPSOIDS
from piazzi.earth.satellites import LASER_SPHERES
from piazzi.earth.scales import TT_TAI
from piazzi.earth.tides import H2, H3, L2, L3, MOON_MASS, RADIUS, SUN_MASS

SPEED_OF_LIGHT = 299792458.0
ASTRONOMICAL_UNIT = 149597870700.0
EARTH_SPIN = 7.292115e-5
SOLAR_IRRADIANCE = 1361.0  # at one astronomical unit
SOLAR_PRESSURE = SOLAR_IRRADIANCE / SPEED_OF_LIGHT
SUN_RADIUS = 695700e3
MOON_RADIUS = 1737.4e3
EARTH_MOMENTUM = 9.8e8  # m^2/s, angular momentum over mass
LOVE_K2 = 0.30190  # of the solid Earth, that of the permanent tide too
LOVE_K21, LOVE_K22 = 0.29830 - 0.00144j, 0.30102 - 0.00130j

_DE440 = "JPL DE440; Park et al. 2021, Astron. J. 161, 105"
# m^3/s^2; of planets with moons, that of the system
GM = {
    "sun": 1.32712440041279419e20, "mercury": 2.2031868551e13, "venus": 3.24858592e14, "earth": 3.98600435507e14,
    "moon": 4.902800118e12, "mars": 4.2828375816e13, "jupiter": 1.267127641e17, "saturn": 3.79405848418e16,
    "uranus": 5.7945564e15, "neptune": 6.83652710058e15, "pluto": 9.755e11,
}  # fmt: skip


class Constant(NamedTuple):
    """A constant: what it is, its value in SI units, the unit, and where it is from."""

    name: str
    value: float
    unit: str
    source: str


def constants() -> tuple[Constant, ...]:
    """Every constant of the table, in the order of the documentation."""
    tides = "IERS Conventions 2010, 7.1.1"
    numbers = {"h2": H2, "l2": L2, "h3": H3, "l3": L3}
    egm = gravity_field("EGM2008")
    shapes = {"WGS84": "NIMA TR8350.2 (2000)", "GRS80": "Moritz 2000, J. Geodesy 74"}
    return (
        Constant("speed of light", SPEED_OF_LIGHT, "m/s", "SI"),
        Constant("astronomical unit", ASTRONOMICAL_UNIT, "m", "IAU 2012 resolution B2"),
        Constant("TT - TAI", TT_TAI, "s", "IAU 1991 resolution A4"),
        *(Constant(f"GM of {name}", value, "m^3/s^2", _DE440) for name, value in GM.items()),
        Constant("GM of the Earth in EGM2008", egm.gm, "m^3/s^2", egm.source.removeprefix("package, ")),
        Constant("radius of the Earth in EGM2008", egm.radius, "m", egm.source.removeprefix("package, ")),
        Constant("permanent tide in C20", PERMANENT_TIDE, "", "IERS Conventions 2010, eq. 6.14"),
        Constant("spin of the Earth", EARTH_SPIN, "rad/s", "IERS Conventions 2010, table 1.2"),
        Constant("angular momentum of the Earth over its mass", EARTH_MOMENTUM, "m^2/s", "IERS Conventions 2010, 10.3"),
        *(Constant(f"equatorial radius of {name}", ELLIPSOIDS[name][0], "m", source) for name, source in shapes.items()),
        *(Constant(f"inverse flattening of {name}", 1.0 / ELLIPSOIDS[name][1], "", source) for name, source in shapes.items()),
        Constant("radius of the Earth for tides of stations", RADIUS, "m", tides),
        Constant("mass of the Sun over that of the Earth, for tides of stations", SUN_MASS, "", tides),
        Constant("mass of the Moon over that of the Earth, for tides of stations", MOON_MASS, "", tides),
        *(Constant(f"Love or Shida number {name}", value, "", tides) for name, value in numbers.items()),
        Constant("Love number k2, for the tide's potential", LOVE_K2, "", "IERS Conventions 2010, table 6.3"),
        *(
            Constant(
                f"Love number k2{order}, {part} part, for the tide's potential", value, "", "IERS Conventions 2010, table 6.3"
            )
            for order, k in ((1, LOVE_K21), (2, LOVE_K22))
            for part, value in (("real", k.real), ("imaginary", k.imag))
        ),
        Constant("solar irradiance at one astronomical unit", SOLAR_IRRADIANCE, "W/m^2", "IAU 2015 resolution B3"),
        Constant("pressure of sunlight at one astronomical unit", SOLAR_PRESSURE, "N/m^2", "irradiance over speed of light"),
        Constant("radius of the Sun", SUN_RADIUS, "m", "IAU 2015 resolution B3"),
        Constant("radius of the Moon", MOON_RADIUS, "m", "IAU WGCCRE; Archinal et al. 2018, Celest. Mech. 130, 22"),
    )


def tables() -> str:
    """The tables of constants and of laser spheres as the documentation has them."""
    rows = ["| constant | value | unit | source |", "|---|---|---|---|"]
    rows += [f"| {c.name} | `{c.value:.15g}` | {c.unit} | {c.source} |" for c in constants()]
    rows += ["", "| sphere | COSPAR | catalogue | centre of mass, m | sigma, m | mass, kg | diameter, m | source |"]
    rows += ["|---|---|---|---|---|---|---|---|"]
    for s in LASER_SPHERES:
        numbers = " | ".join(f"`{v:g}`" for v in (s.centre_of_mass, s.centre_of_mass_sigma, s.mass, s.diameter))
        rows.append(f"| {s.name} | {s.cospar} | {s.norad} | {numbers} | {s.source} |")
    return "\n".join(rows)
