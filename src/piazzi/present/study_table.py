"""A study's summary as a table for terminals, and in sentences."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from piazzi.evaluate.grids import fits, rich_table
from piazzi.evaluate.quantities import NOTHING, Display, display_of, duration, ideal, number, unit_of
from piazzi.problem.checks import Array
from piazzi.study import Line, Stored, Summary
from piazzi.text import printable

if TYPE_CHECKING:
    from rich.console import Console, ConsoleOptions, RenderResult

TOLD = 5  # failures, and bounds that are not known, of which more are counted
_VIEW = {"realtime": "real time", "delayed": "delayed"}


@dataclass(frozen=True)
class Column:
    """One column: what it is, its unit or remark, the text of every line, and whether it is shown where there is no room."""

    title: str
    unit: str
    texts: tuple[str, ...]
    essential: bool = True


def group_display(stored: Stored, group: str) -> Display:
    """The unit to show the errors of a group of states in, one for all lines."""
    units = dict(zip(stored.groups, stored.about["units"], strict=True))
    return display_of(unit_of(units[group]), [line.rmse_last_half[group] for line in stored.summary.lines])


def point_name(point: Mapping[str, Any]) -> str:
    """Values of the axes at a point, in words; "" where nothing is varied."""
    return printable(", ".join(f"{name} = {value}" for name, value in point.items()))


def ideal_nees(lines: Sequence[Line]) -> str:
    """What the mean NEES should be: how many directions of the error have any variance."""
    return ideal(x.history.ideal for x in lines)


def widest_bounds(lines: Sequence[Line]) -> Array | None:
    """Bounds of the mean NEES (2, T), of the line whose are the widest; None where no line has any."""
    found = [x.history.nees_bounds for x in lines if np.isfinite(x.history.nees_bounds).any()]
    return max(found, key=lambda b: float(np.nanmean(b[1] - b[0])), default=None)


def columns(summary: Summary) -> list[Column]:
    """Everything the table shows."""
    lines, stored = summary.lines, summary.stored
    found = [Column(printable(axis), "", tuple(str(line.point[axis]) for line in lines)) for axis in stored.about["axes"]]
    found += [
        Column("estimator", "", tuple(printable(line.estimator) for line in lines)),
        Column("view", "", tuple(_VIEW.get(line.view, line.view) for line in lines)),
        Column("diverged", "95 % interval", tuple(_rate(line) for line in lines)),
    ]
    for group in stored.groups:
        show, name = group_display(stored, group), printable(group)
        found.append(
            Column(f"{name} error, last half", f"{show.unit}: 5, 50, 95 %", tuple(_spread(x, group, show) for x in lines))
        )
        ratios = tuple(number(line.over_bound[group], 3) for line in lines)
        found.append(Column(f"{name} RMSE over bound", "ideal 1", ratios, False))
    inside = tuple(NOTHING if (i := x.history.inside) is None else f"{100 * i:.0f} %" for x in lines)
    found += [
        Column("mean NEES", ideal_nees(lines), tuple(number(line.mean_nees_last_half, 3) for line in lines)),
        Column("median NEES", "last half", tuple(number(line.median_nees_last_half, 3) for line in lines), False),
        Column("NEES in 99 % bounds", "of epochs", inside, False),
        Column("mean NIS", "ideal: components per row", tuple(number(line.mean_nis, 3) for line in lines), False),
        Column("time", "per run", tuple(duration(line.seconds) for line in lines)),
        Column("failed", "", tuple(f"{line.failed:,}" if line.failed else "" for line in lines)),
    ]
    return [c for c in found if any(text not in ("", NOTHING) for text in c.texts)]


class StudyTable:
    """The lines of a study for rich: all columns where they fit, else the most telling ones, else a block for each line."""

    def __init__(self, summary: Summary) -> None:
        self._columns = columns(summary)

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        from rich.text import Text

        for shown in (self._columns, [c for c in self._columns if c.essential]):
            table = _table(shown)
            if fits(table, console, options):
                yield table
                if shown is not self._columns:
                    yield Text("A wider terminal shows more.", style="dim")
                return
        for row in zip(*(c.texts for c in self._columns), strict=True):
            for c, value in zip(self._columns, row, strict=True):
                if value not in ("", NOTHING):
                    yield Text(f"{'' if c is self._columns[0] else '  '}{c.title}: {value}{f' ({c.unit})' if c.unit else ''}")


def _table(shown: list[Column]) -> Any:
    words = next(i for i, c in enumerate(shown) if c.title == "view") + 1
    heads = [("\n".join([*c.title.split(), *filter(None, [c.unit])]), i < words) for i, c in enumerate(shown)]
    return rich_table(heads, zip(*(c.texts for c in shown), strict=True))


def heading(stored: Stored) -> str:
    """One line on what was studied."""
    specification = stored.about["specification"]
    points = len(stored.points)
    at = f" at {points:,} points" if points > 1 else ""
    runs = f"{specification['runs']:,} runs of {stored.about['epochs']:,} epochs{at}"
    return printable(f"{specification['name'] or 'study'}: {runs}, seed {specification['seed']}")


def failures(summary: Summary) -> list[str]:
    """The first runs that failed and bounds that are not known, and why."""
    document = summary.to_dict()
    found, unknown = document["messages"][:TOLD], document["bounds_unknown"][:TOLD]
    out = [printable(f"run {m['run']}, {m['estimator']} ({_VIEW[m['view']]}): {m['message']}") for m in found]
    total = sum(line.failed for line in summary.lines)
    if total > TOLD:
        out.append(f"... and {total - TOLD:,} more")
    stored = summary.stored
    for m in unknown:
        point = point_name(dict(zip(stored.about["axes"], stored.points[m["point"]], strict=True)))
        out.append(printable(f"Cramer-Rao bound{f' ({point})' if point else ''}: {m['message']}"))
    if len(document["bounds_unknown"]) > TOLD:
        out.append(f"... and {len(document['bounds_unknown']) - TOLD:,} more Cramer-Rao bounds")
    return out


def _rate(line: Line) -> str:
    if line.diverged_interval is None:
        return NOTHING
    low, high = (f"{100 * x:.2g}" if x < 0.095 else f"{100 * x:.0f}" for x in line.diverged_interval)
    done = line.runs - line.failed
    return f"{100 * line.diverged / done:.3g} % ({low}-{high})"


def _spread(line: Line, group: str, show: Display) -> str:
    found = line.rmse_last_half_quantiles[group]
    return NOTHING if found is None else "  ".join(number(v * show.factor, 3) for v in found)
