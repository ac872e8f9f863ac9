"""A comparison -> the tab of a page."""

from __future__ import annotations

from collections.abc import Sequence

from piazzi.evaluate import Comparison
from piazzi.evaluate.comparison_table import columns
from piazzi.present.figures.style import time_display
from piazzi.present.report.answer import answer, measured, over_time
from piazzi.present.report.blocks import CursorValues, Point, Section, Tab, Table, Text
from piazzi.present.report.panels import consistency, group_charts, innovations, passes, state_charts
from piazzi.present.report.paths import orbits
from piazzi.present.report.views import Views
from piazzi.present.report.words import points
from piazzi.present.tables import summary
from piazzi.problem import epoch_of

_PLAY = "Dots and 3-sigma ellipses are where the cursor is: play, drag the slider, or click on any chart over time."
_UNKNOWN = "The truth is not known, so errors are not shown; what the covariances expect of them is."
_INSIDE = "The error of the estimator looked at closely, within three sigma of its own covariance: it should rarely leave them."
_CONSISTENCY = (
    "Innovations should look like noise within three sigma. NEES and NIS are squared errors and innovations in units of the"
    " covariance: values that stay above the grey range mean that the covariance is too small."
)
_NO_NEES = " NEES needs the truth, which is not known here."


def comparison_tab(
    comparison: Comparison,
    *,
    title: str = "",
    planet_radius: float | None = None,
    more: Sequence[Section] = (),
    warning: str = "",
    orbit: bool = True,
) -> Tab:
    """Summary, orbit, errors, consistency and table of a comparison.

    Parameters
    ----------
    comparison : Comparison
    title : by default its source
    planet_radius : m, drawn to scale about the origin
    more : sections to put before the table, such as a window trade
    warning : of the problem itself, such as of long steps; "" for none
    orbit : whether the path and the passes are drawn
    """
    views = Views.of(comparison)
    sections = [*_sections(views, planet_radius, orbit)] if views.found else []
    return Tab(
        title or comparison.source or "Comparison",
        summary(comparison.problem, comparison.tracking, comparison.source or "measurements"),
        [*points(comparison), *([Point("Warning", f"{warning[:1].upper()}{warning[1:]}.", "bad")] if warning else [])],
        [*sections, *more, _table(comparison, views), _reading()],
        keys=views.keys,
        times=views.times if views.found else None,
        show_time=time_display(comparison.tracking.times),
        epoch=epoch_of(comparison.problem, comparison.tracking),
    )


def _sections(views: Views, planet_radius: float | None, orbit: bool) -> list[Section]:
    known = views.truth is not None
    paths = orbits(views, planet_radius) if orbit else []
    return [
        *([Section("The orbit" if planet_radius else "The path", paths, _PLAY)] if paths else []),
        answer(views),
        *([Section("Passes", [sights], _PASSES)] if orbit and (sights := passes(views)) else []),
        Section(
            "Errors and their predicted standard deviations",
            [*group_charts(views), CursorValues("Values at the cursor")],
            "" if known else _UNKNOWN,
        ),
        *([Section("State by state", state_charts(views), _INSIDE)] if known else []),
        over_time(views),
        *([measured(views)] if orbit else []),
        Section("Consistency", [*innovations(views), *consistency(views)], _CONSISTENCY if known else _CONSISTENCY + _NO_NEES),
    ]


_PASSES = "When each station measured: rows without a gap of more than 2.5 times the usual interval."


def _table(comparison: Comparison, views: Views) -> Section:
    """What the terminal shows, all columns of it."""
    shown = columns(comparison.problem.model, comparison.rows, comparison.tracking.values)
    heads = [(c.name, ", ".join(filter(None, (c.part, c.unit)))) for c in shown]
    order = {pair: i for i, pair in enumerate(views.found)}
    keys = [order.get((row.estimator, row.view), -1) for row in comparison.rows]
    return Section("All numbers", [Table(heads, list(zip(*(c.texts for c in shown), strict=True)), keys=keys)])


def _reading() -> Section:
    return Section(
        "How to read this",
        [
            Text(
                [
                    "RMSE is the root of the mean squared length of the error; the last half is what is left once an estimator"
                    " has settled. Real time means from measurements up to each epoch; delayed, that later ones helped too.",
                    "NEES is the squared error, NIS the squared innovation, in units of the covariance that the estimator"
                    " claims. Their means should be near the number of states and of measured components; where a covariance is"
                    " singular, near its rank. Errors of one run are correlated in time, so one run proves little: try other"
                    " seeds before relying on a covariance.",
                ]
            )
        ],
    )
