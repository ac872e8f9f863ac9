"""A study by its grid: every number that was varied, of the problem or of estimators, alike."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations, product
from typing import Any

from piazzi.study.store import Summary
from piazzi.study.summary import Line
from piazzi.study.variations import Value

Who = tuple[str, str]  # an estimator as it was given, and its view
At = Mapping[str, Value]


@dataclass(frozen=True, eq=False)
class Grid:
    """The lines of a study by the values of what was varied.

    Attributes
    ----------
    axes : what takes more than one value, with its values in order
    cells : estimator and view, the value of every axis that they have, and the line; an estimator without a setting is the same
        at all its values
    """

    axes: Mapping[str, tuple[Value, ...]]
    cells: Sequence[tuple[Who, At, Line]]

    @classmethod
    def of(cls, summary: Summary) -> Grid:
        """The grid of a study."""
        about = summary.stored.about
        settings: Mapping[str, Any] = about.get("settings", {})  # not in earlier stores
        found: dict[str, list[Value]] = {}
        cells = []
        for line in summary.lines:
            given, own = settings.get(line.estimator, (line.estimator, {}))
            at = {**line.point, **own}
            cells.append(((_name(given, own), line.view), at, line))
            for name, value in at.items():
                values = found.setdefault(name, [])
                if value not in values:
                    values.append(value)
        axes = {name: tuple(ordered(values)) for name, values in found.items() if len(values) > 1}
        return cls(axes, cells)

    @property
    def estimators(self) -> list[Who]:
        """Every estimator and view, in order."""
        return list(dict.fromkeys(who for who, _, _ in self.cells))

    @property
    def pairs(self) -> list[tuple[str, str]]:
        """Every two of the axes."""
        return list(combinations(self.axes, 2))

    def others(self, *axes: str) -> list[At]:
        """Every combination of values of all axes but these."""
        rest = {name: values for name, values in self.axes.items() if name not in axes}
        return [dict(zip(rest, values, strict=True)) for values in product(*rest.values())]

    def line(self, who: Who, at: At) -> Line | None:
        """The line of an estimator at these values of all axes."""
        for one, there, line in self.cells:
            if one == who and all(there.get(name, value) == value for name, value in at.items()):
                return line
        return None

    def along(self, axis: str, at: At) -> dict[Who, list[Line | None]]:
        """For every estimator its lines at the values of an axis, where the others have these values."""
        return {who: [self.line(who, {**at, axis: value}) for value in self.axes[axis]] for who in self.estimators}

    def has(self, who: Who, axis: str) -> bool:
        """Whether an axis makes a difference to an estimator: not where it is a setting that others have."""
        return any(one == who and axis in at for one, at, _ in self.cells)


def numeric(values: Sequence[Value]) -> bool:
    """Whether all are numbers."""
    return all(isinstance(v, (int, float)) and not isinstance(v, bool) for v in values)


def ordered(values: Sequence[Value]) -> Sequence[Value]:
    """Numbers from the smallest on; else as they came."""
    return sorted(values, key=float) if numeric(values) else values


def _name(given: str, own: Mapping[str, Any]) -> str:
    """A window whose length is varied is not called by one length."""
    return given.partition(":")[0] if {"lag", "iterations"} & {*own} else given
