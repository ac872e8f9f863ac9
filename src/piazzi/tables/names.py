"""Names of columns: ours, those of a file, and the unit behind them."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping, Sequence

from piazzi.text import nearest, shown

WEEK, SECONDS = "week", "sow"
IGNORE = "ignore"  # what columns are called that are to be left out
_LABEL = re.compile(r"(.*?)\s*(?:\[([^\[\]]*)\])?")
_PAIR = re.compile(r"\s*([^\s=,]+)\s*=\s*((?:[^\s,\[\]]|\[[^\[\]]*\])+)\s*(?:,|(?=\s)|$)")


def parse_columns(text: str) -> dict[str, str]:
    """Pairs of a name here and a column of a file, such as ``week=gps_week x=X[km]``; raises ValueError for other text.

    ``ignore=NAME`` may be repeated; its columns are then parted by commas.
    """
    out: dict[str, str] = {}
    at = 0
    while text[at:].strip():
        match = _PAIR.match(text, at)
        if match is None:
            raise ValueError(f"columns: {shown(text[at:].strip())} is not NAME=COLUMN, such as x=X[km]")
        if match[1] == IGNORE and IGNORE in out:
            out[IGNORE] += f",{match[2]}"
        elif match[1] in out:
            raise ValueError(f"columns: {match[1]!r} is given twice")
        else:
            out[match[1]] = match[2]
        at = match.end()
    return out


def renamed(header: Sequence[str], known: Collection[str], columns: Mapping[str, str], missing: str) -> list[str]:
    """What each column of a header is called here, "" for one that is left out.

    A column that `columns` names takes that name, and its unit; those beside are known by their own names, whatever
    the case, and left out where they mean nothing here.  Without `columns` every name stays, for the reader to judge.
    Pairs may stand the other way round, the file's name first, where that is the only way to read them.

    Raises
    ------
    ValueError
        Where `columns` says a name that is not `known`, to which `missing` says what it lacks, or a column that the file does
        not have; where two columns have one name.
    """
    valid = [*known, WEEK, SECONDS]
    out = [folded(name, known, header) for name in header]
    given = dict(columns)
    ignored = {found(name, header)[0] for name in given.pop(IGNORE, "").split(",") if name.strip()}
    if given:
        taken: dict[int, str] = {}
        for ours, theirs in (_turned(pair, valid, header) for pair in given.items()):
            if ours not in valid:
                raise ValueError(f"columns: {ours[:60]!r} {missing}{nearest(ours[:60], valid)}")
            at, unit = found(theirs, header)
            if at in taken:
                raise ValueError(f"columns: {header[at][:60]!r} is taken for {parts(taken[at])[0]!r} and {ours!r}")
            taken[at] = f"{ours}[{unit}]" if unit else ours
        own = {*given, *(parts(name)[0] for name in taken.values())}
        out = [taken.get(i, name if parts(name)[0] in known and name not in own else "") for i, name in enumerate(out)]
    out = ["" if i in ignored else name for i, name in enumerate(out)]
    labels = [parts(name)[0] for name in out if name]
    twice = next((label for label in labels if labels.count(label) > 1), None)
    if twice is not None:
        raise ValueError(f"two columns are called {twice[:60]!r}")
    return out


def _turned(pair: tuple[str, str], valid: Collection[str], header: Sequence[str]) -> tuple[str, str]:
    """A pair with our name first."""
    ours, theirs = pair
    label, unit = parts(theirs)
    if ours in valid or label not in valid or parts(ours)[0] not in {parts(name)[0] for name in header}:
        return pair
    return label, f"{ours}[{unit}]" if unit else ours


def parts(name: str) -> tuple[str, str]:
    """A name without its unit, and the unit, "" for none."""
    match = _LABEL.fullmatch(name)
    return (match[1], (match[2] or "").strip()) if match else (name, "")


def folded(name: str, known: Collection[str], header: Sequence[str]) -> str:
    """The known name that differs in case only, where there is one and no other column has it."""
    label, unit = parts(name)
    same = [k for k in known if k.casefold() == label.casefold()]
    if label in known or len(same) != 1 or any(parts(other)[0] in same for other in header):
        return name
    return f"{same[0]}[{unit}]" if unit else same[0]


def found(theirs: str, header: Sequence[str]) -> tuple[int, str]:
    """Where a column is that was named with or without its unit, or by its number from 1 on, and the unit."""
    label, unit = parts(theirs)
    places = [i for i, name in enumerate(header) if name == theirs or parts(name)[0] == label]
    if not places:
        places = [i for i, name in enumerate(header) if parts(name)[0].casefold() == label.casefold()]
    if not places and label.isdecimal() and label.isascii() and 1 <= int(label) <= len(header):
        places = [int(label) - 1]
    if len(places) != 1:
        what = "there is no column" if not places else "there are several columns"
        hint = nearest(label[:60], header) if not places else ""
        raise ValueError(f"columns: {what} {label[:60]!r}{hint}; the file has {', '.join(header)[:200]}")
    own = parts(header[places[0]])[1]
    if unit and own and unit != own:
        raise ValueError(f"columns: {label[:60]!r} is in {own!r} by its name, and {unit!r} was said")
    return places[0], unit or own
