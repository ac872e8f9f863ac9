"""Numbers of rows for xarray datasets: every one by the name that it has in JSON, with its unit."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from piazzi.evaluate.quantities import unit_of
from piazzi.evaluate.rows import Row
from piazzi.model import Model
from piazzi.problem.checks import Array


def numbers(model: Model, rows: Sequence[Row]) -> list[tuple[str, Array, dict[str, str]]]:
    """Every number of the rows by the name that it has in JSON, NaN where it is not known, with its unit."""
    records = [row.to_dict() for row in rows]
    out: list[tuple[str, Array, dict[str, str]]] = []
    for key in dict.fromkeys(key for record in records for key in record):
        values = [record.get(key) for record in records]
        if all(v is None or isinstance(v, bool | int | float) for v in values):
            if not any(v is None for v in values) and isinstance(values[0], bool):
                out.append((key, np.array(values, dtype=bool), {}))
            else:
                out.append((key, np.array([np.nan if v is None else v for v in values], dtype=float), _unit(model, key)))
    return out


def _unit(model: Model, key: str) -> dict[str, str]:
    """The unit of a number of this name."""
    for what in ("_rmse", "_crlb"):
        group, found, _ = key.partition(what)
        if found:
            return {"units": unit_of(model.unit(s) for s in dict(model.groups).get(group, (group,)) if s in model.names)}
    return {"units": "s"} if key in ("seconds", "convergence_time") else {}
