"""What the columns of somebody else's table are called here."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping, Sequence

from piazzi.io.cells import STATION, TIME
from piazzi.problem import Problem
from piazzi.scenarios.table import shown
from piazzi.text import nearest

TRUTH = "truth:"
WEEK, SECONDS = "week", "sow"
_LABEL = re.compile(r"(.*?)\s*(?:\[([^\[\]]*)\])?")
_PAIR = re.compile(r"\s*([^\s=,]+)\s*=\s*((?:[^\s,\[\]]|\[[^\[\]]*\])+)\s*(?:,|(?=\s)|$)")


def parse_columns(text: str) -> dict[str, str]:
    """Pairs of a name here and a column of a file, such as ``week=gps_week x=X[km]``; raises ValueError for other text."""
    out: dict[str, str] = {}
    at = 0
    while text[at:].strip():
        match = _PAIR.match(text, at)
        if match is None:
            raise ValueError(f"columns: {shown(text[at:].strip())} is not NAME=COLUMN, such as x=X[km]")
        if match[1] in out:
            raise ValueError(f"columns: {match[1]!r} is given twice")
        out[match[1]], at = match[2], match.end()
    return out


def own_names(problem: Problem) -> list[str]:
    """Names that columns of a problem's measurements may have."""
    components = sorted({c for s in problem.stations for c in problem.model.sensor(s.sensor).components})
    return [TIME, STATION, *components, *(TRUTH + s for s in problem.model.names)]


def named(header: Sequence[str], problem: Problem, columns: Mapping[str, str]) -> list[str]:
    """What each column of a header is called here, "" for one that is left out.

    A column that `columns` names takes that name, and its unit; those beside are known by their own names, whatever
    the case, and left out where they mean nothing here.  Without `columns` every name stays, for the reader to judge.

    Raises
    ------
    ValueError
        Where `columns` says a name that the problem does not have, or a column that the file does not have; where two columns
        have one name.
    """
    known = own_names(problem)
    valid = [*known, WEEK, SECONDS]
    out = [_folded(name, known, header) for name in header]
    if columns:
        taken: dict[int, str] = {}
        for ours, theirs in columns.items():
            if ours not in valid:
                raise ValueError(f"columns: {ours[:60]!r} is not measured here{nearest(ours[:60], valid)}")
            at, unit = _found(theirs, header)
            taken[at] = f"{ours}[{unit}]" if unit else ours
        out = [taken.get(i, name if _parts(name)[0] in known and name not in columns else "") for i, name in enumerate(out)]
    labels = [_parts(name)[0] for name in out if name]
    twice = next((label for label in labels if labels.count(label) > 1), None)
    if twice is not None:
        raise ValueError(f"two columns are called {twice[:60]!r}")
    return out


def fitting(header: Sequence[str], columns: Mapping[str, str]) -> dict[str, str]:
    """Those of the names that this header needs: not where it has our own name and lacks the other."""
    labels = {_parts(name)[0] for name in header}
    return {ours: theirs for ours, theirs in columns.items() if ours not in labels or _parts(theirs)[0] in labels}


def _parts(name: str) -> tuple[str, str]:
    """A name without its unit, and the unit, "" for none."""
    match = _LABEL.fullmatch(name)
    return (match[1], (match[2] or "").strip()) if match else (name, "")


def _folded(name: str, known: Collection[str], header: Sequence[str]) -> str:
    """The known name that differs in case only, where there is one and no other column has it."""
    label, unit = _parts(name)
    same = [k for k in known if k.casefold() == label.casefold()]
    if label in known or len(same) != 1 or any(_parts(other)[0] in same for other in header):
        return name
    return f"{same[0]}[{unit}]" if unit else same[0]


def _found(theirs: str, header: Sequence[str]) -> tuple[int, str]:
    """Where a column is that was named with or without its unit, and the unit."""
    label, unit = _parts(theirs)
    places = [i for i, name in enumerate(header) if name == theirs or _parts(name)[0] == label]
    if not places:
        places = [i for i, name in enumerate(header) if _parts(name)[0].casefold() == label.casefold()]
    if len(places) != 1:
        what = "there is no column" if not places else "there are several columns"
        hint = nearest(label[:60], header) if not places else ""
        raise ValueError(f"columns: {what} {label[:60]!r}{hint}; the file has {', '.join(header)[:200]}")
    own = _parts(header[places[0]])[1]
    if unit and own and unit != own:
        raise ValueError(f"columns: {label[:60]!r} is in {own!r} by its name, and {unit!r} was said")
    return places[0], unit or own
