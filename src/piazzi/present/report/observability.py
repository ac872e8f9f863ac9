"""What can be seen of the first state, as a tab of its own or a section of another."""

from __future__ import annotations

from typing import Any

import numpy as np

from piazzi.evaluate.observable import Observability
from piazzi.evaluate.quantities import Display
from piazzi.present.colours import DASHES, STATIONS
from piazzi.present.figures.style import time_display
from piazzi.present.report.blocks import Axis, Chart, Line, Point, Section, Tab, Text, Tone
from piazzi.present.report.windows import table_of
from piazzi.present.tables import summary
from piazzi.problem import epoch_of

_INTRO = (
    "What the measurements alone, without the prior, say about the first state, as they come in: a singular value s determines"
    " a direction of the state to 1/s prior sigma, and no unbiased estimator does better than the Cramer-Rao sigma."
)
_HEADINGS: dict[str, Tone] = {"Verdict": "good", "Observability": "plain", "Twins": "plain", "Twin": "plain"}
_TRIED = "Errors of the last half"  # how the sentence on what estimators made of it begins


def observability_tab(found: Observability, *, title: str = "") -> Tab:
    """Observability by itself."""
    subtitle = summary(found.problem, found.tracking, found.source or "measurements")
    return Tab(
        title or found.source or "Observability",
        subtitle,
        verdict_points(found),
        [observability_section(found, words=False)],
        times=found.growth_times,
        show_time=time_display(found.growth_times),
        epoch=epoch_of(found.problem, found.tracking),
    )


def observability_section(found: Observability, *, words: bool = True) -> Section:
    """Singular values and Cramer-Rao sigmas over time, directions, and twins."""
    says = [Text([f"{point.heading}: {point.text}" for point in verdict_points(found)])] if words else []
    return Section("Observability", [*says, _singular_values(found), _sigmas(found), *map(table_of, found.grids())], _INTRO)


def verdict_points(found: Observability) -> list[Point]:
    """The verdict's sentences under headings of their own: what it calls verdict first."""
    points: list[Point] = []
    for line in found.sentences():
        heading, colon, rest = line.partition(": ")
        if colon and heading in _HEADINGS:
            rest = rest if heading == "Twin" else rest[:1].upper() + rest[1:]  # which begins with the name of a state
            points.append(Point(heading, rest, _HEADINGS[heading]))
        elif line.startswith(_TRIED):
            points.append(Point("What estimators make of it", line))
        elif points:
            last = points.pop()
            points.append(Point(last.heading, f"{last.text} {line}", last.tone))
        else:
            points.append(Point("What can be seen", line))
    return sorted(points, key=lambda point: point.heading != "Verdict")


def _singular_values(found: Observability) -> Chart:
    n = found.growth_values.shape[1]
    lines = []
    for i in range(n):
        label = "best seen" if i == 0 else "worst seen" if i == n - 1 else f"direction {i + 1}"
        values = found.growth_values[:, i]
        values = np.where(values > 0, values, np.nan)
        lines.append(Line(found.growth_times, values, label, **_look(i)))
    y = Axis("singular value [1/prior sigma]", Display(""), "log", *_limits(lines, 1.0))
    x = _time(found)
    return Chart("Information about the first state", x, y, lines, levels=[(1.0, "as much as the prior")])


def _sigmas(found: Observability) -> Chart:
    lines = []
    for i, state in enumerate(found.problem.model.names):
        sigma = found.growth_sigma[:, i] / found.scale[i]
        sigma = np.where(np.isfinite(sigma) & (sigma > 0), sigma, np.nan)
        lines.append(Line(found.growth_times, sigma, state, **_look(i)))
    y = Axis("Cramer-Rao sigma [prior sigma]", Display(""), "log", *_limits(lines, 1.0))
    x = _time(found)
    return Chart("How well each state can be known", x, y, lines, levels=[(1.0, "as well as the prior")])


def _look(i: int) -> dict[str, Any]:
    """Of the i-th line: dashed where the colours begin anew."""
    return {"colour": STATIONS[i % len(STATIONS)], "dash": DASHES[i // len(STATIONS) % len(DASHES)]}


def _time(found: Observability) -> Axis:
    return Axis("time", time_display(found.growth_times))


def _limits(lines: list[Line], mark: float) -> tuple[float, float]:
    """Limits that hold the mark and the lines, up to a factor of 1e6 from it."""
    values = np.concatenate([np.asarray(line.y) for line in lines])
    good = values[np.isfinite(values)]
    low, high = (float(good.min()), float(good.max())) if good.size else (mark, mark)
    return max(min(low, mark) / 1.5, mark / 1e6), min(max(high, mark) * 1.5, mark * 1e6)
