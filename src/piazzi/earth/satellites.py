"""Spheres that carry laser reflectors: mass, size, and how far the reflectors are from the centre."""

from __future__ import annotations

import math
from dataclasses import dataclass

from piazzi.text import suggest


@dataclass(frozen=True)
class LaserSphere:
    """A passive satellite for laser ranging.

    Parameters
    ----------
    name : as the ILRS has it
    cospar : international designator
    norad : catalogue number
    sic : satellite identification code of the ILRS
    centre_of_mass : m, that is added to a range to reach the centre; standard value of the ILRS
    centre_of_mass_sigma : m, how far single stations and detectors are from it
    mass : kg
    diameter : m
    source : of these
    """

    name: str
    cospar: str
    norad: int
    sic: int
    centre_of_mass: float
    centre_of_mass_sigma: float
    mass: float
    diameter: float
    source: str

    @property
    def area(self) -> float:
        """Cross section, m^2."""
        return math.pi * self.diameter**2 / 4.0

    @property
    def area_to_mass(self) -> float:
        """Cross section over mass, m^2/kg."""
        return self.area / self.mass

    @property
    def ilrs(self) -> str:
        """Number in files of the ILRS: year, launch and piece, such as 9207002."""
        return f"{self.cospar[2:4]}{self.cospar[5:8]}{ord(self.cospar[8]) - ord('A') + 1:02d}"


_ILRS = "ILRS mission parameters and centre-of-mass pages"
_OTSUBO = "; sigma as Otsubo and Appleby 2003, J. Geophys. Res. 108(B4), 2201"
LASER_SPHERES = (
    LaserSphere("LAGEOS-1", "1976-039A", 8820, 1155, 0.251, 0.005, 406.965, 0.60, _ILRS + _OTSUBO),
    LaserSphere("LAGEOS-2", "1992-070B", 22195, 5986, 0.251, 0.005, 405.38, 0.60, _ILRS + _OTSUBO),
    LaserSphere("Starlette", "1975-010A", 7646, 1134, 0.075, 0.005, 47.29, 0.24, _ILRS),
    LaserSphere("Stella", "1993-061B", 22824, 643, 0.075, 0.005, 48.0, 0.24, _ILRS),
    LaserSphere("Ajisai", "1986-061A", 16908, 1500, 1.010, 0.025, 685.0, 2.15, _ILRS + _OTSUBO),
    LaserSphere("Etalon-1", "1989-001C", 19751, 525, 0.576, 0.025, 1415.0, 1.294, _ILRS + _OTSUBO),
    LaserSphere("Etalon-2", "1989-039C", 20026, 4146, 0.576, 0.025, 1415.0, 1.294, _ILRS + _OTSUBO),
    LaserSphere("LARES", "2012-006A", 38077, 5987, 0.133, 0.005, 386.8, 0.364, _ILRS),
    LaserSphere("Larets", "2003-042F", 27944, 5557, 0.0625, 0.003, 23.28, 0.24, _ILRS + "; centre of mass as Ries 2024"),
)


def laser_sphere(identity: str | int) -> LaserSphere:
    """The sphere of that name (capitals, hyphens and blanks aside), COSPAR or ILRS designator, or catalogue number.

    Raises KeyError where there is none, with the nearest name.
    """
    wanted = _plain(str(identity))
    for sphere in LASER_SPHERES:
        if wanted in (_plain(sphere.name), _plain(sphere.cospar), sphere.ilrs, str(sphere.norad)):
            return sphere
    names = [sphere.name for sphere in LASER_SPHERES]
    known = suggest(str(identity), names) or f"; there are {', '.join(names)}"
    raise KeyError(f"no laser sphere {identity!r} in the package{known}; else give centre of mass, mass and area")


def _plain(name: str) -> str:
    plain = name.upper().replace("-", "").replace(" ", "").replace("_", "")
    return "LAGEOS1" if plain == "LAGEOS" else plain
