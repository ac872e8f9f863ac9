"""The page of a determination: its verdict, its numbers, and the page of its estimators."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from piazzi.determination.document import document
from piazzi.determination.showing import grids, heading, remarks
from piazzi.evaluate.comparison import Comparison
from piazzi.evaluate.rows import evaluate
from piazzi.present.report import Section, Tab, comparison_tab, write_page
from piazzi.present.report.blocks import Point, Table, Text

EARTH = 6378137.0


def report(found: Any, path: Any) -> Path:
    """Write the page; returns its path."""
    return write_page(path, f"Piazzi: {found.object or 'determination'}", [tab(found)])


def tab(found: Any) -> Tab:
    """The tab of a determination."""
    facts = document(found)
    title = next(iter(heading(found, facts)))
    tables = [
        Section(grid.title, [Table([(head.replace("\n", " "), "") for head in grid.heads], grid.rows)])
        for grid in grids(found, facts)
    ]
    ends = [Section("Forces, and what was assumed", [Text(list(remarks(facts)))])]
    tone = {False: "bad", True: "good", None: "plain"}
    verdict = sorted(facts["verdict"].items(), key=lambda item: item[1]["ok"] is not False)
    points = [Point(key.capitalize(), one["sentence"], tone[one["ok"]]) for key, one in verdict]  # type: ignore[arg-type]
    beside = _compared(found)
    if beside is None:
        return Tab(found.object or "Determination", title, points, [*tables, *ends])
    whole = comparison_tab(beside, title=found.object or "Determination", planet_radius=EARTH)
    return Tab(whole.title, title, points, [*tables, *whole.sections, *ends], whole.keys, whole.times, whole.show_time)


def _compared(found: Any) -> Comparison | None:
    """The estimates side by side; None where one of them is not finite, for which there is nothing to draw."""
    usable = {name: e for name, e in found.estimates.items() if e.success}
    if not usable:
        return None
    rows = [
        evaluate(name, one, None, thorough=False) for name, e in usable.items() for one in (e, e.delayed) if one is not None
    ]
    return Comparison(found.problem, found.tracking, tuple(rows), usable, found.object)
