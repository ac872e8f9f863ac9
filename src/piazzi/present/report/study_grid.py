"""A study against what was varied -> charts with spreads, and heat maps."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from piazzi.evaluate.quantities import Display
from piazzi.present.colours import dash_of, label_of, shades
from piazzi.present.figures.grids import map_values, mapped, shown_of
from piazzi.present.grid import Measure, Scale, colour, letters, measures, shares, spreads, where
from piazzi.present.report.blocks import Axis, Chart, Heat, Key, Line, Section
from piazzi.study import Summary
from piazzi.study.grid import At, Grid, Who
from piazzi.text import printable

_SPREAD = "Shaded: 5 to 95 % of runs; bars: the 95 % interval of a rate."


def grid_keys(grid: Grid) -> list[Key]:
    """A legend entry for every estimator and view."""
    names = [name for name, _ in grid.estimators]
    own = shades(names)
    return [Key(label_of(name, view), own[name], dash_of(name, view, names)) for name, view in grid.estimators]


def sections_along(summary: Summary, grid: Grid, keys: Sequence[Key]) -> list[Section]:
    """A section for every axis; where others are varied too, at some values of theirs."""
    out = []
    for axis in grid.axes:
        for others in shown_of(grid, axis):
            title = f"Against {printable(axis)}{f', where {where(others)}' if others else ''}"
            charts = [_against(grid, axis, measure, others, keys) for measure in measures(summary)]
            out.append(Section(title, charts, _SPREAD))
    return out


def sections_of_maps(summary: Summary, grid: Grid) -> list[Section]:
    """A section for every two of the axes, others at their middle."""
    out = []
    for pair in grid.pairs:
        others = grid.others(*pair)
        at, who = others[len(others) // 2], mapped(grid, pair)
        blocks = [heat for measure in measures(summary) for heat in _maps(grid, pair, measure, who, at)]
        title = f"{printable(pair[0])} and {printable(pair[1])}{f', where {where(at)}' if at else ''}"
        out.append(
            Section(title, blocks, "The colours of a measure are those of all estimators; a NEES as it should be is white.")
        )
    return out


def _against(grid: Grid, axis: str, measure: Measure, at: At, keys: Sequence[Key]) -> Chart:
    scale, show = Scale.of(grid.axes[axis]), measure.show
    lines, everything = [], [np.array([] if measure.ideal is None else [measure.ideal])]
    for i, (who, found) in enumerate(grid.along(axis, at).items()):
        middle, low, high = spreads(measure, found)
        if not np.isfinite(middle).any():
            continue
        everything += [middle, low, high]
        notes = [f"{measure.spread}: {measure.text(a)} to {measure.text(b)}" for a, b in zip(low, high, strict=True)]
        lines.append(Line(scale.places, high, measure.spread, i, "spread", about=low))
        lines.append(Line(scale.places, middle, keys[i].label, i, notes=notes if grid.has(who, axis) else ()))
    values = np.concatenate(everything)
    good = values[np.isfinite(values) & ((values > 0) | (measure.scale != "log"))]
    limits = (0.8 * float(good.min()), 1.25 * float(good.max())) if measure.scale == "log" and good.size else (0.0, None)
    if measure.scale == "linear" and good.size:
        limits = (0.0, 1.05 * max(float(good.max()), 0.01))
    x = Axis(
        printable(axis),
        Display(""),
        scale.kind,
        *scale.limits,
        marks=list(zip(scale.places.tolist(), scale.texts, strict=True)),
    )
    y = Axis(measure.label, show, measure.scale, *limits)
    levels = [] if measure.ideal is None else [(measure.ideal, "ideal")]
    return Chart(f"{measure.heading} against {printable(axis)}", x, y, lines, time=False, levels=levels)


def _maps(grid: Grid, pair: tuple[str, str], measure: Measure, who: Sequence[Who], at: At) -> list[Heat]:
    values = np.stack([map_values(grid, pair, measure, one, at) for one in who])
    across, up = (Scale.of(grid.axes[axis]).texts for axis in pair)
    out = []
    for one, v, share in zip(who, values, shares(measure, values), strict=True):
        cells = []
        for row, shares_of_row in zip(v.tolist(), share.tolist(), strict=True):
            shown = [(colour(measure, s), measure.text(value)) for value, s in zip(row, shares_of_row, strict=True)]
            cells.append([(shade, letters(shade), text) for shade, text in shown])
        title = f"{measure.show.label(measure.heading)}, {label_of(*one)}"
        out.append(
            Heat(title, (printable(pair[0]), printable(pair[1])), (across, up), measure.show.label(measure.label), cells)
        )
    return out
