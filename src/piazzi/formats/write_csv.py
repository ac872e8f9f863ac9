"""Observations as a table of dates: one row a time, station and object, one column a kind."""

from __future__ import annotations

import csv
import io
from math import isnan

import numpy as np

from piazzi.arrays import distinct
from piazzi.formats.conventions import RANGES
from piazzi.formats.kinds import KINDS, TAGS
from piazzi.formats.observations import Observations
from piazzi.formats.writing import dates
from piazzi.text import escape_formula


def csv_text(observations: Observations) -> str:
    """A CSV with dates in the scale of the files; rows of one time, station and object that stand together share a line.

    Conventions that hold for all rows stand above it, as ``# frame = ITRF``.  Columns are ``time[SCALE]``, ``station`` and
    ``object`` where there are any, each kind with its SI unit, and ``sigma KIND [UNIT]`` where there are sigmas.

    Raises
    ------
    ValueError
        For no rows, or rows in more than one time scale.
    """
    rows = observations
    if not len(rows):
        raise ValueError("there are no rows to write")
    scales = sorted({rows.segments[i].scale for i in distinct(rows.segment)})
    if len(scales) > 1:
        raise ValueError(f"a CSV has one time scale, and there are {', '.join(scales)}")
    kinds = [kind for kind in rows.kinds if rows.of_kind(kind).any()]
    sigmas = [kind for kind in kinds if not np.isnan(rows.sigma[rows.of_kind(kind)]).all()]
    people = {name: getattr(rows, name) for name in ("station", "object") if (getattr(rows, name) >= 0).any()}
    heads = [f"{kind} [{KINDS[kind].unit}]" if KINDS[kind].unit else kind for kind in kinds]
    out = io.StringIO()
    out.writelines(f"# {name} = {word}\n" for name, word in _said(rows))
    table = csv.writer(out, lineterminator="\n")
    table.writerow(
        [
            f"time[{scales[0]}]",
            *people,
            *heads,
            *(f"sigma {head}" for head, kind in zip(heads, kinds, strict=True) if kind in sigmas),
        ]
    )
    place = {kind: i for i, kind in enumerate(kinds)}
    columns = [place.get(kind, -1) for kind in rows.kinds]
    beside = {columns[rows.kinds.index(kind)]: len(kinds) + i for i, kind in enumerate(sigmas)}
    texts = dates(scales[0], rows.epoch, rows.t)
    names = [escape_formula(name) for name in rows.participants] + [""]
    keys = [column.tolist() for column in people.values()]
    opening: list[str] = []
    cells: list[str] = []
    before: object = None
    data = zip(rows.t.tolist(), rows.kind.tolist(), rows.value.tolist(), rows.sigma.tolist(), strict=True)
    for i, (t, kind, value, sigma) in enumerate(data):
        key, column = (t, *(part[i] for part in keys)), columns[kind]
        if key != before or cells[column]:
            if before is not None:
                table.writerow([*opening, *cells])
            opening, cells, before = [texts[i], *(names[part[i]] for part in keys)], [""] * (len(kinds) + len(sigmas)), key
        cells[column] = repr(value)
        if column in beside and not isnan(sigma):
            cells[beside[column]] = repr(sigma)
    table.writerow([*opening, *cells])
    return out.getvalue()


def _said(rows: Observations) -> list[tuple[str, str]]:
    """Conventions that are the same for all rows, by the names of `Conventions`."""
    used = [rows.segments[i] for i in distinct(rows.segment)]
    out = [
        (name, {getattr(segment, name) for segment in used}) for name in ("frame", "angles", "interval", "interval_reference")
    ]
    ways = {ends: word for word, ends in RANGES.items()}
    out.append(("range", {ways.get((segment.way, segment.range_is)) for segment in used}))
    out.append(("tag", {TAGS[i] or None for i in distinct(rows.tag)}))
    return [(name, str(words.pop())) for name, words in out if len(words) == 1 and None not in words]
