"""The forces on a body that goes about the Sun, as text of the language: axes of the ICRF, SI units, seconds of TDB."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from piazzi.earth.constants import ASTRONOMICAL_UNIT, GM
from piazzi.earth.force_text import ORBIT_AXES, Force, along_axes, body_place, schwarzschild, third_body

BODIES = tuple(name for name in GM if name not in ("sun", "pluto"))
# m^3/s^2, those of JPL's kernel of asteroids sb441-n16
ASTEROIDS = {"ceres": 6.26288864e10, "pallas": 1.36658781e10, "juno": 1.920570e9, "vesta": 1.728823288e10}
NUMBERS = {"ceres": 1, "pallas": 2, "juno": 3, "vesta": 4}
NONGRAVITATIONAL = ("A1", "A2", "A3")


def sun() -> Force:
    """The Sun as a point."""
    text = {"r": "sqrt(x**2 + y**2 + z**2)", "sun_pull": f"-{GM['sun']!r}/r**3"}
    return Force("", text, ("sun_pull*x", "sun_pull*y", "sun_pull*z"))


def nongravitational(names: Sequence[str]) -> Force:
    """A1, A2 and A3 along R, T and N at one astronomical unit (m/s2), with the inverse square of the distance."""
    axes = along_axes(dict(zip(NONGRAVITATIONAL, ("radial", "along", "cross"), strict=True)), names)
    text = ORBIT_AXES | {"as_light": f"({ASTRONOMICAL_UNIT!r}/r)**2"}
    return Force("outgassing_on", text, tuple(f"as_light*{pull}" for pull in axes), tuple(names))  # type: ignore[arg-type]


def parts(bodies: Sequence[str], asteroids: Mapping[str, float], relativity: bool, names: Sequence[str]) -> tuple[Force, ...]:
    """The forces of a choice."""
    masses = {**{name: GM[name] for name in bodies}, **asteroids}
    return (
        sun(),
        *(third_body(name, gm) for name, gm in masses.items()),
        *([schwarzschild(GM["sun"])] if relativity else []),
        *([nongravitational(names)] if names else []),
    )


def places(names: Sequence[str]) -> dict[str, str]:
    """Where those bodies are seen from the Sun."""
    return {left: text for name in names for left, text in body_place(name).items()}
