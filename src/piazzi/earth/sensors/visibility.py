"""Who sees what in simulation: satellite above the mask, station in the dark, satellite in sunlight, no Earth between them.

Rules have the place of now, without light time.
"""

from __future__ import annotations

from math import radians

from piazzi.earth.geodetic import ELLIPSOIDS
from piazzi.earth.sensors.air import Air
from piazzi.earth.sensors.text import AXES, names

NIGHT = radians(-12.0)  # of the Sun's elevation: the end of nautical twilight


def rule(name: str) -> tuple[str, dict[str, str], dict[str, float]]:
    """A rule by its name: text that is above zero where it holds, definitions, numbers of the station."""
    line = tuple(f"now_line_{a}" for a in AXES)
    seen = {names("now_place"): "station(t)"} | {f"now_line_{a}": f"{a} - now_place_{a}" for a in AXES}
    if name == "above":
        air = Air("now_")
        air.turn("t", line)
        return "now_elevation - mask", seen | air.definitions, air.numbers | {"mask": 0.0}
    if name == "dark":
        air = Air("dusk_")
        air.turn("t", tuple(f"sun_{a}" for a in AXES))
        return "night - dusk_elevation", air.definitions, air.numbers | {"night": NIGHT}
    if name == "sunlit":
        radius = ELLIPSOIDS["WGS84"][0]
        text = {
            "sunward": "(x*sun_x + y*sun_y + z*sun_z)/sun_r",
            "aside": f"sqrt(x**2 + y**2 + z**2 - sunward**2) - {radius!r}",
        }
        return "max(sunward, aside)", text, {}
    if name == "clear":
        radius = ELLIPSOIDS["WGS84"][0]
        along = " + ".join(f"{a}*now_line_{a}" for a in AXES)
        length = " + ".join(f"now_line_{a}**2" for a in AXES)
        text = {
            **seen,
            "now_length": f"sqrt({length})",
            "now_past": f"({along})/now_length",
            "now_passed": f"sqrt(x**2 + y**2 + z**2 - now_past**2) - {radius!r}",
        }  # fmt: skip
        # the line comes nearest to the Earth's centre beyond either end, or passes above the Earth
        return "max(max(-now_past, now_past - now_length), now_passed)", text, {}
    return name, {}, {}
