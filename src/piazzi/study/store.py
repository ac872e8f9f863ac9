"""A finished study in one NetCDF-4 file, read row by row; and its summary."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from piazzi.drawn import Drawn
from piazzi.io import hdf5
from piazzi.problem.checks import Array
from piazzi.study.plan import SCHEMA
from piazzi.study.schema import check_about, check_arrays, epoch_said
from piazzi.study.score import NUMBERS
from piazzi.study.summary import QUANTILES, Line, Row, line_of

if TYPE_CHECKING:
    from piazzi.earth import Epoch

_NOT_COMPARED = ("seconds",)
MOST_SHOWN = 20  # messages of failed runs


@dataclass(frozen=True, eq=False)
class Stored(Drawn):
    """A finished study: what it was, and its results row by row.

    Attributes
    ----------
    about : everything that is not a number over runs: specification, digest, rows, groups, units, states, axes, messages,
        and why the bound of a point is not known
    times : (T,), epochs at which every run is kept, s
    """

    path: Path
    about: Mapping[str, Any]
    times: Array

    def __repr__(self) -> str:
        """In short: of what, how many runs and points."""
        about, points = self.about["specification"], len(self.points)
        return f"<Study of {about['name'] or 'a study'}: {about['runs']} runs at {points} point{'s' * (points != 1)}>"

    @property
    def epoch(self) -> Epoch | None:
        """The instant that times are past, where the problem has one."""
        return epoch_said(self.about["specification"])

    @property
    def rows(self) -> list[tuple[str, str]]:
        return [(label, view) for label, view in self.about["rows"]]

    @property
    def points(self) -> list[list[Any]]:
        """Values of the axes at every point."""
        return list(self.about["points"])

    @property
    def groups(self) -> list[str]:
        return list(self.about["groups"])

    @cached_property
    def summary(self) -> Summary:
        """Who diverges how often, how far off they are, whether they know, what it costs."""
        return Summary(self)

    def row(self, point: int, row: int) -> Row:
        """Results of all runs; raises OSError, ValueError."""
        with hdf5.opened(self.path) as root:
            found = {name: hdf5.slab(root, name, (point, row)) for name in (*NUMBERS, "success", "diverged", "error", "nees")}
            rank = hdf5.slab(root, "rank", (point, row)) if "rank" in root else None
        if rank is None:  # of an earlier version, for which every covariance was of full rank
            rank = np.full(found["nees"].shape, len(self.about["states"]))
        success, diverged = (found.pop(name).astype(bool) for name in ("success", "diverged"))
        error, nees = found.pop("error"), found.pop("nees")
        return Row(found, success, diverged, error, nees, rank)

    def bound(self, point: int, view: str) -> tuple[Array, Array, int]:
        """Cramer-Rao bounds as standard deviations: at the epochs that are kept (T, G), and over the last half (G,).

        Third, how many runs, the first ones, they were averaged over.
        """
        at = (point, ("realtime", "delayed").index(view))
        with hdf5.opened(self.path) as root:
            return hdf5.slab(root, "bound", at), hdf5.slab(root, "bound_last_half", at), int(hdf5.slab(root, "bound_runs", at))


@dataclass(frozen=True, eq=False)
class Summary(Drawn):
    """A study's results in short."""

    stored: Stored

    def __repr__(self) -> str:
        """In short."""
        return f"<Summary of {self.stored!r}>"

    @cached_property
    def lines(self) -> tuple[Line, ...]:
        """A line for every point and row of the study, in order."""
        stored = self.stored
        return tuple(
            line_of(at, label, view, stored.groups, stored.row(point, row), stored.bound(point, view))
            for point, values in enumerate(stored.points)
            for at in [dict(zip(stored.about["axes"], values, strict=True))]
            for row, (label, view) in enumerate(stored.rows)
        )

    @property
    def success(self) -> bool:
        """Whether every run of every estimator finished."""
        return not any(line.failed for line in self.lines)

    def to_dict(self) -> dict[str, Any]:
        """The object of schema piazzi.study/1."""
        about = self.stored.about
        specification = about["specification"]
        return {
            "schema": SCHEMA,
            "source": specification["name"],
            "runs": specification["runs"],
            "seed": specification["seed"],
            "epochs": about["epochs"],
            "states": about["states"],
            "axes": specification["vary"],
            "digest": about["digest"],
            "quantiles": list(QUANTILES),
            **({} if self.stored.epoch is None else {"epoch": self.stored.epoch.exact()}),
            "times": self.stored.times.tolist(),
            "rows": [line.to_dict() for line in self.lines],
            "messages": [
                {"point": point, "estimator": stored_row[0], "view": stored_row[1], "run": run, "message": text}
                for point, row, run, text in about["messages"][:MOST_SHOWN]
                for stored_row in [self.stored.rows[row]]
            ],
            "bounds_unknown": [
                {"point": point, "message": text}
                for point, text in about.get("bounds_unknown", [])  # not in earlier stores
            ],
        }


def read_store(path: str | os.PathLike[str]) -> Stored:
    """The finished study in a file; raises OSError, or ValueError where it holds none."""
    with hdf5.opened(path) as root:
        about = hdf5.document(root, "about")
        if about.get("schema") != SCHEMA:
            raise ValueError("it holds no study")
        times = hdf5.array(root, "time")
        if times is None or times.ndim != 1:
            raise ValueError("it has no times")
        check_about(about)
        check_arrays(root, about)
        return Stored(Path(path), about, times)


def same_results(a: str | os.PathLike[str], b: str | os.PathLike[str]) -> list[str]:
    """Names of what differs between two stores in any bit, wall-clock seconds aside."""
    with hdf5.opened(a) as one, hdf5.opened(b) as other:
        names = {*one, *other}
        return sorted(name for name in names if name not in _NOT_COMPARED and not _same(one, other, name))


def _same(one: Any, other: Any, name: str) -> bool:
    if name not in one or name not in other or one[name].dtype != other[name].dtype or one[name].shape != other[name].shape:
        return False
    return bool(one[name][()].tobytes() == other[name][()].tobytes())
