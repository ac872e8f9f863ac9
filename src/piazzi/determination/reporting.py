"""The page of a determination: verdict, orbit, answer, residuals, how well it is known, and how it was made."""

from __future__ import annotations

from importlib.metadata import version
from pathlib import Path
from typing import Any

from piazzi.determination.document import document
from piazzi.determination.page.charts import gained, known, passes_of, residuals, spans
from piazzi.determination.page.made import made, modes, tests
from piazzi.determination.page.places import sections, station_rows
from piazzi.determination.page.sampled import Sampled, sampled
from piazzi.determination.residuals import table
from piazzi.determination.showing import grids, heading
from piazzi.evaluate.comparison import Comparison
from piazzi.evaluate.rows import evaluate
from piazzi.present.figures.style import time_display
from piazzi.present.report import Key, Section, Tab, comparison_tab, write_page
from piazzi.present.report.blocks import Axis, Point, Table, Text
from piazzi.present.report.write import page_path

_NOT_DRAWN = "The orbit is not drawn: it is not finite, or it leaves the tables of the forces."


def report(found: Any, path: Any, title: str | None = None) -> Path:
    """Write the page, in a folder that is made where it is not there; returns its path."""
    foot = f"Made by Piazzi {version('piazzi')}. The page needs no network."
    page_path(path).parent.mkdir(parents=True, exist_ok=True)
    return write_page(path, title or f"Piazzi: {found.object or 'determination'}", [tab(found)], foot=foot)


def tab(found: Any) -> Tab:
    """The tab of a determination."""
    facts, columns, path = document(found), table(found), sampled(found)
    rows = station_rows(found, path)
    times = _times(found, path)
    time = Axis("time", time_display(times))
    passes = passes_of(found, columns)
    tone = {False: "bad", True: "good", None: "plain"}
    verdict = sorted(facts["verdict"].items(), key=lambda item: item[1]["ok"] is not False)
    points = [Point(*_said(one["sentence"]), tone[one["ok"]]) for _, one in verdict]  # type: ignore[arg-type]
    beside = _beside(found)
    parts = [
        *sections(found, path, rows),
        *([Section("The orbit", [Text([_NOT_DRAWN])])] if path is None else []),
        *_answer(found, facts),
        residuals(found, time),
        known(path, time, spans(passes, columns)) if path is not None else None,
        gained(found, passes, columns),
        modes(facts),
        *(beside.sections if beside is not None else ()),
        tests(facts),
        *made(found, facts),
    ]
    keys: tuple[Key, ...] = tuple(beside.keys) if beside is not None else ()
    shown = [part for part in parts if part is not None]
    title = next(iter(heading(found, facts)))
    return Tab(
        found.object or "Determination",
        title,
        points,
        shown,
        keys,
        times if len(times) > 1 else None,
        time.show,
        switch=len(keys) > 1,
        epoch=found.setup.measured.epoch,
        scale=found.scale,
    )


def _times(found: Any, path: Sampled | None) -> Any:
    """Times of the cursor: those of the orbit between the measurements, where all of them are drawn."""
    epochs = found.estimate.times
    if path is not None and path.about == "sun":
        return path.times
    if path is None or path.times[0] > epochs[0]:
        return epochs
    return path.times[path.times <= epochs[-1] + 1e-6]


def _answer(found: Any, facts: dict[str, Any]) -> list[Section]:
    """Tables of the answer."""
    tables = [
        Table([(head.replace("\n", " "), "") for head in grid.heads], grid.rows, caption=grid.title, half=len(grid.heads) == 4)
        for grid in grids(found, facts)
    ]
    return [Section("The answer", tables)]


def _beside(found: Any) -> Tab | None:
    """Estimators side by side, folded; None where none of them is finite."""
    usable = {name: e for name, e in found.estimates.items() if e.success}
    if not usable:
        return None
    rows = [
        evaluate(name, one, None, thorough=False) for name, e in usable.items() for one in (e, e.delayed) if one is not None
    ]
    whole = comparison_tab(Comparison(found.problem, found.tracking, tuple(rows), usable, found.object), orbit=False)
    folded = [Section(s.title, s.blocks, s.intro, folded=True) for s in whole.sections]
    return Tab(whole.title, "", [], folded, whole.keys, whole.times, whole.show_time)


def _said(sentence: str) -> tuple[str, str]:
    """The word that a sentence of the verdict begins with, which is its heading, and the rest of it."""
    word, _, rest = sentence.partition(": ")
    return word, rest[:1].upper() + rest[1:]
