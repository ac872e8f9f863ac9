"""A colour for every estimator: the same in each picture and on each page, distinguishable with every colour vision."""

from __future__ import annotations

import re
from collections.abc import Iterable
from math import log2

# Okabe and Ito (2008)
COLOURS = {
    "ekf": "#0072B2",
    "iekf": "#56B4E9",
    "srekf": "#004C7A",
    "ukf": "#CC79A7",
    "graph": "#D55E00",
    "window": "#009E73",
    "smoother": "#E69F00",
    "batch": "#7A7A7A",
}
OTHER = "#7A7A7A"
TRUTH = "#000000"
MEASURED = "#555555"
PLANET = "#C9D3DC"
STATIONS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
DASHES = ((), (5, 2), (1, 2), (6, 2, 1, 2))
LONG, DOT, MOST_DOTS = (12, 2), (1, 2), 4
_LAG = 100  # of the window that has the colour of windows as it is
_OPTION = 0.3  # how far an estimator with options is from the plain one, towards white


def colour_of(name: str) -> str:
    """Colour of an estimator's kind by the name it has on the command line; options after the colon do not change it."""
    return COLOURS.get(name.partition(":")[0], OTHER)


def shade_of(name: str) -> str:
    """Colour of an estimator with its options: shorter windows are paler, longer ones darker, other options pale.

    It depends on the name alone, so that company does not change it.
    """
    kind, _, option = name.partition(":")
    colour = colour_of(name)
    if kind not in COLOURS or not option:
        return colour
    if kind != "window":
        return mixed(colour, 255, _OPTION)
    lag = re.match(r"\d{1,9}", option)
    octaves = log2(max(int(lag.group()), 1) / _LAG) if lag else 0.0
    return mixed(colour, 255, min(-octaves / 6.0, 0.6)) if octaves < 0 else mixed(colour, 0, min(octaves / 5.0, 0.5))


def shades(names: Iterable[str]) -> dict[str, str]:
    """The shade of every name; names of the user's own take the colours that no known one here uses, in order."""
    found = {name: shade_of(name) for name in dict.fromkeys(names)}
    known = {colour_of(name) for name in found if name.partition(":")[0] in COLOURS}
    free = [c for c in STATIONS if c not in known] or [OTHER]
    own = [name for name in found if name.partition(":")[0] not in COLOURS]
    return found | {name: free[i % len(free)] for i, name in enumerate(own)}


def dash_of(name: str, view: str, names: Iterable[str] = ()) -> tuple[int, ...]:
    """Lengths of dashes and gaps, () for a whole line: what a window says late has short dashes.

    Names that share a shade get dashes of their own.  So do windows, whose shades are near each other: the second among `names`
    has a dot between its dashes, the third has two.
    """
    if name.partition(":")[0] == "window":
        windows = [other for other in dict.fromkeys(names) if other.partition(":")[0] == "window"]
        dots = DOT * (windows.index(name) % MOST_DOTS if name in windows else 0)
        return (*DASHES[1], *dots) if view == "delayed" else (*LONG, *dots) if dots else DASHES[0]
    found = shades(names)
    same = [other for other in found if found[other] == found.get(name)]
    place = same.index(name) if name in same else 0
    return (DASHES[0], *DASHES[2:])[place % 3]


def mixed(colour: str, towards: int, share: float) -> str:
    """A colour (#RRGGBB) moved by a share towards black (0) or white (255)."""
    channels = (int(colour[i : i + 2], 16) for i in (1, 3, 5))
    return "#" + "".join(f"{round(c + share * (towards - c)):02X}" for c in channels)


def label_of(name: str, view: str) -> str:
    """Name for legends; a window says which of its two views is meant."""
    return f"{name}, {'delayed' if view == 'delayed' else 'real time'}" if name.partition(":")[0] == "window" else name


def station_colour(index: int) -> str:
    """Colour of a station by its place in a list: six that differ, then darker and paler ones."""
    colour = STATIONS[index % len(STATIONS)]
    turn = index // len(STATIONS) % 3
    return colour if not turn else mixed(colour, 0 if turn == 1 else 255, 0.4)
