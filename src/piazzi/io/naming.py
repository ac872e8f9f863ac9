"""What the columns of somebody else's table are called here."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from piazzi.problem import Problem
from piazzi.tables.cells import STATION, TIME
from piazzi.tables.names import parts, renamed

TRUTH = "truth:"


def own_names(problem: Problem) -> list[str]:
    """Names that columns of a problem's measurements may have."""
    components = sorted({c for s in problem.stations for c in problem.model.sensor(s.sensor).components})
    return [TIME, STATION, *components, *(TRUTH + s for s in problem.model.names)]


def named(header: Sequence[str], problem: Problem, columns: Mapping[str, str]) -> list[str]:
    """What each column of a header is called here, as `tables.names.renamed` has it; without `columns` every name stays."""
    return renamed(header, own_names(problem), columns, "is not measured here")


def fitting(header: Sequence[str], columns: Mapping[str, str]) -> dict[str, str]:
    """Those of the names that this header needs: not where it has our own name and lacks the other."""
    labels = {parts(name)[0] for name in header}
    return {ours: theirs for ours, theirs in columns.items() if ours not in labels or parts(theirs)[0] in labels}
