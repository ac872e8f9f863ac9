"""A study's pieces into one NetCDF-4 file, whole or not at all."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from piazzi.io import hdf5
from piazzi.study.log import Log
from piazzi.study.plan import SCHEMA, Plan
from piazzi.study.score import NUMBERS
from piazzi.study.tasks import Piece, joined
from piazzi.study.versions import fingerprint

_RUNS_TOGETHER = 256
_WRITTEN_TOGETHER = 1 << 25  # bytes
MOST_MESSAGES = 10_000  # that are kept: which runs failed is known of all


def write_store(path: str | os.PathLike[str], study: Plan, log: Log) -> None:
    """Write the finished study of a log, whole or not at all; raises OSError."""
    messages: list[list[Any]] = []
    unknown: list[list[Any]] = []
    lost = 0
    with hdf5.written(path) as file:
        _create(file, study)
        for piece in _merged(log.pieces()):
            task = piece.task
            runs = (slice(None), slice(task.first, task.first + task.count)) if task.count else ()
            for name, values in piece.arrays.items():
                file.variables[name][(task.point, *runs)] = values
            if not task.count:
                unknown += [[task.point, text] for *_, text in piece.messages]
                continue
            room = MOST_MESSAGES - len(messages)
            messages += [[task.point, row, run, text] for row, run, text in piece.messages[:room]]
            lost += max(0, len(piece.messages) - room)
        told = {"messages": sorted(messages), "messages_left_out": lost, "bounds_unknown": unknown}
        _write_text(file, "about", {**_about(study), **told})


def _merged(pieces: Iterable[Piece]) -> Iterator[Piece]:
    """The pieces, those of neighbouring runs as one up to a size: a variable is written as fast for hundreds as for one."""
    waiting: list[Piece] = []
    for piece in pieces:
        if waiting and not _adjoins(piece, waiting):
            yield joined(waiting)
            waiting = []
        waiting.append(piece)
    if waiting:
        yield joined(waiting)


def _adjoins(piece: Piece, before: Sequence[Piece]) -> bool:
    last, size = before[-1].task, sum(a.nbytes for p in (*before, piece) for a in p.arrays.values())
    if piece.arrays.keys() != before[-1].arrays.keys():
        return False
    next_to = (piece.task.point, piece.task.first) == (last.point, last.first + last.count)
    return next_to and piece.task.count > 0 and last.count > 0 and size <= _WRITTEN_TOGETHER


def _about(study: Plan) -> dict[str, Any]:
    from importlib.metadata import version

    model = study.problem.model
    return {
        "schema": SCHEMA,
        "piazzi": version("piazzi"),
        "versions": fingerprint(),
        "specification": study.specification,
        "digest": study.digest,
        "rows": [list(row) for row in study.rows],
        "axes": [axis.name for axis in study.axes],
        "settings": study.settings,
        "points": [list(study.point(i)) for i in range(study.points)],
        "groups": list(study.groups),
        "units": [sorted({model.unit(model.names[i]) for i in columns}) for columns in study.groups.values()],
        "states": list(model.names),
        "epochs": len(study.times),
    }


def _create(file: Any, study: Plan) -> None:
    """Dimensions and empty variables."""
    T, G, R = len(study.kept), len(study.groups), len(study.rows)
    sizes = {"point": study.points, "row": R, "run": study.runs, "epoch": T, "group": G, "view": 2}
    file.dimensions = sizes
    time = file.create_variable("time", ("epoch",), "f8", data=study.times[study.kept])
    time.attrs["units"] = "s"
    together = min(study.runs, _RUNS_TOGETHER)
    per_run = ("point", "row", "run")
    for name, grouped in NUMBERS.items():
        dims = (*per_run, "group") if grouped else per_run
        _variable(file, name, dims, "f8", (1, 1, together, G) if grouped else (1, 1, together), np.nan)
    for name in ("success", "diverged"):
        _variable(file, name, per_run, "u1", (1, 1, together), 0)
    _variable(file, "error", (*per_run, "epoch", "group"), "f4", (1, 1, min(study.runs, 32), T, G), np.nan)
    _variable(file, "nees", (*per_run, "epoch"), "f4", (1, 1, min(study.runs, 64), T), np.nan)
    rank = np.min_scalar_type(study.problem.model.n).str  # one byte, unless constants make more than 255 values
    _variable(file, "rank", (*per_run, "epoch"), rank, (1, 1, min(study.runs, 64), T), 0)
    _variable(file, "bound", ("point", "view", "epoch", "group"), "f4", (1, 2, T, G), np.nan)
    for name in ("bound_whole", "bound_last_half"):
        _variable(file, name, ("point", "view", "group"), "f8", (1, 2, G), np.nan)
    _variable(file, "bound_runs", ("point", "view"), "i8", (1, 2), 0)


def _variable(file: Any, name: str, dims: tuple[str, ...], kind: str, chunks: tuple[int, ...], fill: float) -> None:
    file.create_variable(name, dims, kind, chunks=chunks, fillvalue=np.dtype(kind).type(fill))


def _write_text(file: Any, name: str, document: Mapping[str, Any]) -> None:
    text = np.frombuffer(json.dumps(document).encode("ascii"), "S1")
    file.dimensions[f"{name}_characters"] = len(text)
    file.create_variable(name, (f"{name}_characters",), "S1", data=text)
