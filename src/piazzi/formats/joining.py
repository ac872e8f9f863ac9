"""Several tables of observations as one."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from piazzi.arrays import Array
from piazzi.formats.observations import NUMBERS, Observations, is_constant


def concatenate(parts: Iterable[Observations]) -> Observations:
    """All rows of several tables after one another, about the first one's epoch.

    Raises
    ------
    ValueError
        For no tables.
    """
    tables = list(parts)
    if not tables:
        raise ValueError("there are no observations to put together")
    if len(tables) == 1:
        return tables[0]
    first = tables[0]
    plain = ("value", *NUMBERS, "tag", "used", "line")
    joined: dict[str, Any] = {name: _joined([getattr(table, name) for table in tables]) for name in plain}
    joined["t"] = _joined([table.t + (table.epoch - first.epoch) if table is not first else table.t for table in tables])
    for name, indices in {"kinds": ("kind",), "participants": ("station", "object", "participant"), "files": ("file",)}.items():
        names = tuple(dict.fromkeys(text for table in tables for text in getattr(table, name)))
        joined[name] = names
        for index in indices:
            joined[index] = _joined([_moved(getattr(table, index), getattr(table, name), names) for table in tables])
    for name, several in {"segment": "segments", "place": "places"}.items():
        before = np.cumsum([0, *(len(getattr(table, several)) for table in tables)])
        moved = [_shifted(getattr(table, name), int(k)) for table, k in zip(tables, before, strict=False)]
        joined[name] = _joined(moved)
    joined["segments"] = tuple(segment for table in tables for segment in table.segments)
    joined["places"] = np.concatenate([table.places for table in tables])
    joined["extra"] = _extras(tables)
    for name in ("assumed", "open"):
        joined[name] = tuple(dict.fromkeys(text for table in tables for text in getattr(table, name)))
    counts: dict[str, int] = {}
    for reason, count in (pair for table in tables for pair in table.left_out):
        counts[reason] = counts.get(reason, 0) + count
    return Observations(epoch=first.epoch, **joined, left_out=tuple(counts.items()))


def _joined(columns: Sequence[Array]) -> Array:
    """Columns one after the other; still one number where all are the same."""
    full = [column for column in columns if len(column)]
    if full and all(is_constant(column) for column in full):
        first = full[0][0]
        if len(np.unique(np.array([column[0] for column in full]))) == 1:  # where NaN is one value, too
            return np.broadcast_to(first, (sum(map(len, full)),))
    return np.concatenate(columns)


def _moved(index: Array, names: tuple[str, ...], new: tuple[str, ...]) -> Array:
    """Indices into `names` as indices into `new`; -1 stays."""
    if new[: len(names)] == names:
        return index
    places = {name: i for i, name in enumerate(new)}
    table = np.array([*(places[name] for name in names), -1], dtype=index.dtype)
    return np.broadcast_to(table[index[0]], index.shape) if is_constant(index) else np.asarray(table[index])


def _shifted(index: Array, by: int) -> Array:
    if not by or not len(index):
        return index
    if is_constant(index):
        return np.broadcast_to(index.dtype.type(index[0] + by if index[0] >= 0 else -1), index.shape)
    return np.where(index >= 0, index + index.dtype.type(by), index)


def _extras(tables: Sequence[Observations]) -> dict[str, Array]:
    """Further columns; where a table has none of that name, NaN, -1, False or an empty text."""
    out: dict[str, Array] = {}
    for name in dict.fromkeys(name for table in tables for name in table.extra):
        kind = next(table.extra[name].dtype for table in tables if name in table.extra)
        absent = {"f": np.nan, "i": -1, "b": False}.get(kind.kind, "")
        columns = [table.extra.get(name, np.broadcast_to(np.array(absent, dtype=kind), (len(table),))) for table in tables]
        out[name] = _joined(columns)
    return out
