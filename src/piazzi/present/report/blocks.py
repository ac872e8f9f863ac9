"""What a page is made of.  Values are in SI units; an axis says in which unit they are shown."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal

from piazzi.evaluate.quantities import Display
from piazzi.problem.checks import Array

if TYPE_CHECKING:
    from piazzi.earth import Epoch

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

    A symmetric scale is linear up to `threshold` and logarithmic beyond.  `marks` are values with their words, instead of
    numbers that suit the scale.
    """

    label: str
    show: Display
    scale: Scale = "linear"
    low: float | None = None
    high: float | None = None
    threshold: float = 0.0
    marks: Sequence[tuple[float, str]] = ()


@dataclass(frozen=True, eq=False)
class Line:
    """Values against x: a line, points, thick spans, a band of +-y about zero, or about `about`, or a spread from that to y.

    `key` is the index of its legend entry, -1 for none.  `notes` are words on each value, "" for none, shown under the pointer.

    Where `y` is a tuple of arrays, the root of their summed squares is meant.  What is drawn is `times` as large.
    """

    x: Array
    y: Array | tuple[Array, ...]
    label: str
    key: int = -1
    kind: Literal["line", "points", "crosses", "band", "bars", "spans", "spread"] = "line"
    times: float = 1.0
    colour: str = "#7A7A7A"
    dash: tuple[int, ...] = ()
    notes: Sequence[str] = ()
    about: Array | None = None


@dataclass(frozen=True, eq=False)
class Chart:
    """Lines on one pair of axes.

    Attributes
    ----------
    time : whether x is the time of the tab, which has a cursor
    single : whether it shows only the estimator that is looked at closely
    levels : horizontal lines with a label
    ranges : horizontal bands, low to high, with a label
    shades : stretches of x, (S, 2), that are shaded
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
    shades: Array | None = None


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
    """An animated path about a planet; with `close` errors about the origin, scaled anew at every epoch.

    `sites` are stations: name, colour, and where they stand, or stood when they measured; `rings` are lines that do not move,
    as whole ellipses are.  Where it is `mirrored`, x grows
    to the left, as right ascension does on a sky.
    """

    title: str
    tracks: Sequence[Track]
    labels: tuple[str, str]
    show: Display
    limits: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)
    planet_radius: float | None = None
    close: bool = False
    note: str = ""
    sites: Sequence[tuple[str, str, Array, Array]] = ()
    rings: Sequence[tuple[Array, Array]] = ()
    mirrored: bool = False


@dataclass(frozen=True)
class Heat:
    """A cell for every value of two axes, row by row from below: its colour, that of its letters, its number and its words."""

    title: str
    labels: tuple[str, str]
    marks: tuple[Sequence[str], Sequence[str]]
    measure: str
    cells: Sequence[Sequence[tuple[str, str, str]]]
    note: str = ""


@dataclass(frozen=True)
class Table:
    """Headings with units, and rows of text; `keys` colours the rows by their legend entry, `words` are columns of sentences.

    One that is `half` takes half of the width.
    """

    heads: Sequence[tuple[str, str]]
    rows: Sequence[Sequence[str]]
    caption: str = ""
    keys: Sequence[int] = ()
    words: Sequence[int] = ()
    half: bool = False


@dataclass(frozen=True)
class CursorValues:
    """A table of the values at the cursor, filled by the page from the charts that have a column."""

    title: str = "At the cursor"


@dataclass(frozen=True)
class Text:
    """Paragraphs."""

    paragraphs: Sequence[str]


@dataclass(frozen=True)
class Code:
    """What is typed, letter by letter."""

    text: str


@dataclass(frozen=True, eq=False)
class Rows:
    """Measurements of one station along an orbit, NaN between passes.

    Attributes
    ----------
    label, colour : of the station
    times : (R,), s
    place : (R, 3), of the object when it was measured, fixed to the Earth, m
    turned : (R,), angle of the Earth then, rad
    used : (R,), 1 or 0
    notes : words on each row, "" for none
    site : (3,), of the station, fixed to the Earth, m; None where it stands nowhere
    azimuth, elevation : (R,), of the object seen from there, rad
    """

    label: str
    colour: str
    times: Array
    place: Array
    turned: Array
    used: Array
    notes: Sequence[str] = ()
    site: Array | None = None
    azimuth: Array | None = None
    elevation: Array | None = None


@dataclass(frozen=True, eq=False)
class World:
    """An orbit about the Earth, on a globe that turns or on a map.

    Attributes
    ----------
    times : (T,), s
    place : (T, 3), of the object, fixed to the Earth, m
    covariance : (T, 6), of the place, its upper triangle row by row, m^2; NaN where no tube is drawn
    turned : (T,), angle of the Earth, rad
    sun : (T, 3), direction of the Sun, fixed to the Earth
    period : of a revolution, s
    factor : by which the tube of three sigma is widened
    view : longitude and latitude among the stars, rad, that the globe is seen from at first
    """

    title: str
    view: Literal["globe", "map"]
    times: Array
    place: Array
    covariance: Array
    turned: Array
    sun: Array
    period: float
    factor: float
    rows: Sequence[Rows]
    land: Array
    start: tuple[float, float] = (0.0, 0.3)
    note: str = ""


@dataclass(frozen=True, eq=False)
class Sky:
    """What a station saw of an object: azimuth and elevation, north up and east right."""

    title: str
    rows: Rows
    note: str = ""


Block = Chart | Heat | Orbit | Table | CursorValues | Text | Code | World | Sky


@dataclass(frozen=True)
class Section:
    """A heading, a sentence on what there is to see, and blocks; one that is `folded` is opened by its heading."""

    title: str
    blocks: Sequence[Block]
    intro: str = ""
    folded: bool = False


@dataclass(frozen=True, eq=False)
class Tab:
    """One problem, or one study: a summary first, then sections.  With `times` (K,) it has a cursor and can be played.

    Charts over time have dates where times are past an `epoch`, of a time `scale` (see `present.dates.Calendar`).

    Where it is not to `switch`, its keys are not offered to be switched.  Tabs with values of what was varied, `at`,
    are picked by them, beside those without.
    """

    title: str
    subtitle: str
    points: Sequence[Point]
    sections: Sequence[Section]
    keys: Sequence[Key] = ()
    times: Array | None = None
    show_time: Display = field(default_factory=lambda: Display("s"))
    switch: bool = True
    at: Sequence[tuple[str, str]] = ()
    epoch: Epoch | None = None
    scale: str = ""
