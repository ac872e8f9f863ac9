"""What is in tracking files, as tables and sentences for terminals."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from piazzi.evaluate.grids import Grid
from piazzi.evaluate.quantities import NOTHING, display_of, duration, number
from piazzi.evaluate.tabled import Tabled
from piazzi.text import counted

MOST_PASSES, MOST_STATIONS = 12, 30
MOST_STATED = 6
_QUIET = ("scale", "participants", "segments", "rows")
_LONG = ("path", "second_path", "delays", "frequencies", "wavelength")
_EVENTS = {"transmit": "transmission", "receive": "reception", "bounce": "the bounce"}


@dataclass(frozen=True)
class Tracked(Tabled):
    """The summary of `formats.summary`, with its tables."""

    found: Mapping[str, Any]

    def to_dict(self) -> dict[str, Any]:
        return dict(self.found)

    def heading(self) -> str:
        """One line: files, rows, span, objects and stations."""
        found = self.found
        span = f" over {duration(found['seconds'])}, {found['first']} to {found['last']}" if found["rows"] else ""
        files = ", ".join(found["files"][:3]) + (f" and {len(found['files']) - 3} more" if len(found["files"]) > 3 else "")
        return f"{files}: {counted(found['rows'], 'row')}{span}"

    def grids(self) -> list[Grid]:
        """Tables of kinds, stations and passes."""
        return [grid for grid in (self._kinds(), self._stations(), self._passes()) if grid.rows]

    def _kinds(self) -> Grid:
        rows = []
        for kind in self.found["kinds"]:
            shown = display_of(kind["unit"], [kind["least"], kind["greatest"]])
            sigma = kind["median_sigma"]
            least, greatest = (_shown(kind[end], shown.factor) for end in ("least", "greatest"))
            cells = (kind["kind"].replace("_", " "), f"{kind['rows']:,}", least, greatest, shown.unit or "1")
            own = display_of(kind["unit"], [sigma])
            rows.append((*cells, NOTHING if sigma is None else f"{_shown(sigma, own.factor)} {own.unit}"))
        return Grid("Kinds", ("kind", "rows", "least", "greatest", "unit", "median\nsigma"), tuple(rows), spare=(5,))

    def _stations(self) -> Grid:
        rows = []
        for name in self.found["stations"][:MOST_STATIONS]:
            own = [one for one in self.found["passes"] if one["station"] == name]
            kinds = list(dict.fromkeys(kind for one in own for kind in one["kinds"]))
            seen = list(dict.fromkeys(one["object"] for one in own if one["object"]))
            count = sum(one["rows"] for one in own)
            text = ", ".join(kind.replace("_", " ") for kind in kinds)
            rows.append((name, ", ".join(seen[:3]) or NOTHING, text or NOTHING, f"{count:,}", f"{len(own):,}"))
        return Grid("Stations", ("station", "object", "measures", "rows", "passes"), tuple(rows), left=3)

    def _passes(self) -> Grid:
        rows = [
            (one["station"] or NOTHING, one["object"] or NOTHING, one["first"], duration(one["seconds"]), f"{one['rows']:,}")
            for one in self.found["passes"][:MOST_PASSES]
        ]
        left = len(self.found["passes"]) - len(rows)
        title = f"Passes (the first {len(rows)}; {left:,} more with --json)" if left else "Passes"
        return Grid(title, ("station", "object", "begins", "lasts", "rows"), tuple(rows), left=3)

    def sentences(self) -> Iterator[str]:
        """Conventions, gaps, what is odd, assumed, open and left out."""
        found = self.found
        yield from _stated(found["conventions"])
        if found["gaps"]:
            gap = found["gaps"][0]
            yield f"Longest gap: {duration(gap['seconds'])} after {gap['after']}."
        odd = {"out_of_order": "out of order", "repeated": "of a time and kind that was there before"}
        odd["not_to_be_used"] = "marked as not to be used"
        for key, words in odd.items():
            if found[key]:
                yield f"{counted(found[key], 'row')} {words}."
        yield from (f"Left out: {one['count']:,} {one['reason']}." for one in found["left_out"])
        yield from (f"Assumed: {text}." for text in found["assumed"])
        yield from (f"Open: {text}." for text in found["open"])


def _stated(conventions: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    """What segments state; where they are many, without names and sizes, and the most common first."""
    brief = len(conventions) > MOST_STATED
    counts = Counter[str]()
    for told in conventions:
        counts["; ".join(_told(told, brief))] += told["rows"]
    shown = counts.most_common(MOST_STATED) if brief else counts.items()
    yield from (f"Stated for {counted(rows, 'row')}: {text}." for text, rows in shown)
    if len(counts) > len(shown):
        yield f"{counted(len(counts) - len(shown), 'other set')} of conventions with --json."


def _shown(value: float | None, factor: float) -> str:
    return number(None if value is None else value * factor, 6)


def _told(told: Mapping[str, Any], brief: bool) -> Iterator[str]:
    """Each convention in words: its name and its value, no names and sizes where they should be brief."""
    yield f"dates in {told['scale']}"
    for name, value in told.items():
        if name in _QUIET or value == 0 or (brief and name in _LONG):
            continue
        words = name.replace("_", " ")
        if name == "corrections":
            yield from (_correction(one, brief) for one in value)
        elif name in ("path", "second_path"):
            yield f"{words} {' to '.join(value)}"
        elif name == "tag":
            yield f"times of {_EVENTS[value]}"
        elif isinstance(value, Mapping):
            yield from (f"{'delay' if name == 'delays' else 'frequency'} {key} {number(v, 12)}" for key, v in value.items())
        elif isinstance(value, float):
            yield f"{words} {number(value, 8)}"
        else:
            yield f"{words} {value}"


def _correction(one: Mapping[str, Any], brief: bool) -> str:
    size = "" if one["value"] is None or brief else f" of {number(one['value'], 6)}"
    state = {True: "applied", False: "not applied", None: "not said whether applied"}[one["applied"]]
    return f"correction {one['name'].replace('_', ' ')}{size} {state}"
