"""Make src/piazzi/present/data/land.txt from the land of Natural Earth at 1:110 million, which is in the public domain.

    python docs/machinery/land.py land-110m.json > src/piazzi/present/data/land.txt

`land-110m.json` is a file of version 2 of the package `world-atlas` of npm: TopoJSON, with the rings joined across the
antimeridian and about the pole.  Points that are less than a tenth of a degree off the line between others are left out.
"""

from __future__ import annotations

import json
import sys
from itertools import pairwise
from math import dist, radians, sin
from typing import Any

OFF = 0.1  # degrees
HEAD = """\
# Land of Natural Earth, 1:110 million (public domain, naturalearthdata.com), made by docs/machinery/land.py.
# A ring a line: longitude and latitude of a point, then the steps to the next ones, in tenths of degrees; what it
# encloses is on its left: land, or a sea within it.
"""
Point = tuple[float, float]


def rings(topology: dict[str, Any]) -> list[list[Point]]:
    """Rings of longitude and latitude in degrees, the last point the first, what they enclose on their left."""
    (sx, sy), (tx, ty) = topology["transform"]["scale"], topology["transform"]["translate"]
    arcs = []
    for arc in topology["arcs"]:
        x = y = 0
        points = []
        for dx, dy in arc:
            x, y = x + dx, y + dy
            points.append((tx + sx * x, ty + sy * y))
        arcs.append(points)
    out = []
    for geometry in topology["objects"]["land"]["geometries"]:
        for ring in (ring for polygon in geometry["arcs"] for ring in polygon):
            points = [p for i in ring for p in (arcs[i] if i >= 0 else arcs[~i][::-1])[:-1]]
            points.append(points[0])
            out.append(points if is_on_the_left(points) else points[::-1])
    return out


def is_on_the_left(ring: list[Point]) -> bool:
    """Whether the smaller part of the sphere is on the left of the ring."""
    turns = [(b - a + 180) % 360 - 180 for (a, _), (b, _) in pairwise(ring)]
    if abs(sum(turns)) > 180:  # Antarctica, westward
        return sum(turns) < 0
    sines = [sin(radians(latitude)) for _, latitude in ring]
    return sum(turn * (p + q) for turn, (p, q) in zip(turns, pairwise(sines), strict=True)) < 0


def simplified(ring: list[Point]) -> list[Point]:
    """Points of the ring that lie off the line between their neighbours."""
    if len(ring) < 3:
        return ring
    (a, p), (b, q) = ring[0], ring[-1]
    length = dist((a, p), (b, q))

    def off(x: float, y: float) -> float:
        return dist((x, y), (a, p)) if length == 0 else abs((b - a) * (y - p) - (q - p) * (x - a)) / length

    far, at = max((off(*point), i) for i, point in enumerate(ring[1:-1], 1))
    if far < OFF:
        return [ring[0], ring[-1]]
    return simplified(ring[: at + 1])[:-1] + simplified(ring[at:])


def line(ring: list[Point]) -> str:
    """The ring as text."""
    places = [(round(10 * x), round(10 * y)) for x, y in ring]
    steps = [((c - a + 1800) % 3600 - 1800, d - b) for (a, b), (c, d) in pairwise(places)]
    return " ".join(f"{x} {y}" for x, y in [places[0], *(step for step in steps if step != (0, 0))])


def main(path: str) -> None:
    """Print the file."""
    with open(path, encoding="utf-8") as file:
        found = rings(json.load(file))
    print(HEAD, end="")
    for ring in found:
        print(line(simplified(ring)))


if __name__ == "__main__":
    main(sys.argv[1])
