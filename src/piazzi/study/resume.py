"""What an interrupted study can be continued from: the log of the same study, and the records in it that are pieces of it."""

from __future__ import annotations

import json
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

from piazzi.study.log import Check
from piazzi.study.pieces import failed_piece
from piazzi.study.plan import Plan
from piazzi.study.tasks import Piece, Task
from piazzi.study.versions import difference_of, fingerprint


def checks(study: Plan, path: Path, specification: Mapping[str, Any]) -> Check:
    """What a record of the study's log has to be; raises ValueError for the log of another study, or of other versions.

    It may have been begun with fewer runs.
    """
    there = {k: v for k, v in specification.items() if k != "versions"}
    runs = there.get("runs")
    if isinstance(runs, int) and 0 < runs < study.runs:
        there["runs"] = study.runs
    differs = difference(there, study.specification)
    if differs:
        raise ValueError(f"{path} has runs of another study: {differs}")
    versions = specification.get("versions")
    change = difference_of(versions if isinstance(versions, dict) else {}, fingerprint())
    if change:
        raise ValueError(f"{path} was begun by {change}: results would not be the same; finish it there, or remove it")
    return partial(_check_piece, study, [_layout(failed_piece(study, Task(0, 0, count), "")) for count in (0, 1)])


def _layout(piece: Piece) -> dict[str, tuple[str, list[int]]]:
    """Kind and shape of each array."""
    return {name: (a.dtype.str, list(a.shape)) for name, a in piece.arrays.items()}


def _check_piece(study: Plan, layouts: list[dict[str, tuple[str, list[int]]]], header: Mapping[str, Any]) -> None:
    """Raise ValueError unless a record holds runs of the study, or the bound of a point, in the arrays of such a piece.

    Whatever is in a log, this is what the runs that are missing are counted by, and what the store is made of.
    `layouts` are those of a bound and of one run; runs are along the second axis.
    """
    point, first, count = header["task"]
    if point >= study.points or first + count > study.runs:
        raise ValueError(f"the study has no runs {first} to {first + count - 1} at point {point}")
    found = {name: (kind, shape) for name, kind, shape in header["arrays"]}
    if count:
        found = {name: (kind, [*shape[:1], 1, *shape[2:]]) for name, (kind, shape) in found.items() if shape[1:2] == [count]}
    if found != layouts[min(count, 1)]:
        raise ValueError("its arrays are not those that the study keeps")
    if any(row >= len(study.rows) for row, *_ in header["messages"]):
        raise ValueError("a message is of no row of the study")


def difference(there: Any, here: Mapping[str, Any]) -> str:
    """What differs first between two specifications, "" where they are equal."""
    here = json.loads(json.dumps(here))
    there = there if isinstance(there, dict) else {}
    for key in (*here, *there):
        if here.get(key) != there.get(key):
            if isinstance(here.get(key), (int, str)) and isinstance(there.get(key), (int, str)) and key != "times":
                return f"{key} is {there[key]!r} there and {here[key]!r} here"
            return f"its {key} {'are' if key.endswith('s') else 'is'} not the same"
    return ""
