"""What a page is made of.  Values are in SI units; an axis says in which unit they are shown."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal

from piazzi.evaluate.quantities import Display
from piazzi.problem.checks import Array

Scale = Literal["linear", "log", "symmetric"]
Tone = Literal["good", "bad", "plain"]


@dataclass(frozen=True)
class Point:
    """One thing to say in a summary: a few words of heading, and sentences."""

    heading: str
    text: str
    tone: Tone = "plain"


@dataclass(frozen=True)
class Key:
    """One entry of the legend, which switches everything of this name on a tab."""

    label: str
    colour: str
    dash: tuple[int, ...] = ()


@dataclass(frozen=True)
class Axis:
    """A label, the unit to show, the scale, and limits in SI units.

    A symmetric scale is linear up to `threshold` and logarithmic beyond.
    """

    label: str
    show: Display
    scale: Scale = "linear"
    low: float | None = None
    high: float | None = None
    threshold: float = 0.0


@dataclass(frozen=True, eq=False)
class Line:
    """Values against x: a line, points, thick spans, or a band of +-y about zero.

    `key` is the index of its legend entry, -1 for none.

    Where `y` is a tuple of arrays, the root of their summed squares is meant.  What is drawn is `times` as large.
    """

    x: Array
    y: Array | tuple[Array, ...]
    label: str
    key: int = -1
    kind: Literal["line", "points", "band", "bars", "spans"] = "line"
    times: float = 1.0
    colour: str = "#7A7A7A"
    dash: tuple[int, ...] = ()


@dataclass(frozen=True, eq=False)
class Chart:
    """Lines on one pair of axes.

    Attributes
    ----------
    time : whether x is the time of the tab, which has a cursor
    single : whether it shows only the estimator that is looked at closely
    levels : horizontal lines with a label
    ranges : horizontal bands, low to high, with a label
    column : heading under which the values at the cursor are listed, "" for none
    """

    title: str
    x: Axis
    y: Axis
    lines: Sequence[Line]
    time: bool = True
    single: bool = False
    levels: Sequence[tuple[float, str]] = ()
    ranges: Sequence[tuple[float, float, str]] = ()
    note: str = ""
    column: str = ""


@dataclass(frozen=True, eq=False)
class Track:
    """A path in a plane and, but for the truth, the covariance along it: sigmas and their correlation, (K,) each."""

    x: Array
    y: Array
    label: str
    key: int = -1
    sigma_x: Array | None = None
    sigma_y: Array | None = None
    correlation: Array | None = None


@dataclass(frozen=True, eq=False)
class Orbit:
    """An animated path about a planet; with `close` errors about the origin, scaled anew at every epoch."""

    title: str
    tracks: Sequence[Track]
    labels: tuple[str, str]
    show: Display
    limits: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)
    planet_radius: float | None = None
    close: bool = False
    note: str = ""


@dataclass(frozen=True)
class Table:
    """Headings with units, and rows of text; `keys` colours the rows by their legend entry."""

    heads: Sequence[tuple[str, str]]
    rows: Sequence[Sequence[str]]
    caption: str = ""
    keys: Sequence[int] = ()


@dataclass(frozen=True)
class CursorValues:
    """A table of the values at the cursor, filled by the page from the charts that have a column."""

    title: str = "At the cursor"


@dataclass(frozen=True)
class Text:
    """Paragraphs."""

    paragraphs: Sequence[str]


Block = Chart | Orbit | Table | CursorValues | Text


@dataclass(frozen=True)
class Section:
    """A heading, a sentence on what there is to see, and blocks."""

    title: str
    blocks: Sequence[Block]
    intro: str = ""


@dataclass(frozen=True, eq=False)
class Tab:
    """One problem, or one study: a summary first, then sections.  With `times` (K,) it has a cursor and can be played."""

    title: str
    subtitle: str
    points: Sequence[Point]
    sections: Sequence[Section]
    keys: Sequence[Key] = ()
    times: Array | None = None
    show_time: Display = field(default_factory=lambda: Display("s"))
