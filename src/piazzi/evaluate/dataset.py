"""Comparisons, window trades and observability as xarray datasets: every axis named, every number with its unit."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from piazzi.evaluate.quantities import unit_of
from piazzi.problem import Problem
from piazzi.problem.checks import Array

if TYPE_CHECKING:
    import xarray

    from piazzi.evaluate.comparison import Comparison
    from piazzi.evaluate.observable import Observability
    from piazzi.evaluate.rows import Row
    from piazzi.evaluate.window_trade import WindowTrade


def comparison_to_dataset(comparison: Comparison) -> xarray.Dataset:
    """Rows of a comparison along dimension row, labelled by estimator and view; what is not known is NaN."""
    import xarray as xr

    rows = comparison.rows
    coordinates = {
        "estimator": ("row", np.array([r.estimator for r in rows], dtype=object)),
        "view": ("row", np.array([r.view for r in rows], dtype=object)),
    }
    variables = {key: (("row",), values, attributes) for key, values, attributes in _numbers(comparison.problem, rows)}
    variables["message"] = (("row",), np.array([r.message for r in rows], dtype=object), {})
    return xr.Dataset(variables, coordinates, {"source": comparison.source, "epochs": len(comparison.tracking.times)})


def windows_to_dataset(trade: WindowTrade) -> xarray.Dataset:
    """Everything against lag and view, and the seconds of the full graph against its epochs."""
    import xarray as xr

    both = [{k: (v, a) for k, v, a in _numbers(trade.problem, trade.rows(view))} for view in ("realtime", "delayed")]
    variables: dict[str, Any] = {
        key: (("lag", "view"), np.stack([values, both[1][key][0]], axis=1), attributes)
        for key, (values, attributes) in both[0].items()
    }
    variables["microseconds_per_step"] = (("lag",), trade.microseconds_per_step, {"units": "us"})
    coordinates: dict[str, Any] = {"lag": trade.lags, "view": np.array(["realtime", "delayed"], dtype=object)}
    if trade.timing is not None:
        coordinates["graph_epochs"] = trade.timing.epochs
        variables["graph_seconds"] = (("graph_epochs",), trade.timing.seconds, {"units": "s"})
        variables["graph_iterations"] = (("graph_epochs",), trade.timing.iterations)
    attributes = {"source": trade.source, "epochs": len(trade.tracking.times), "iterations": trade.iterations}
    return xr.Dataset(variables, coordinates, attributes)


def observability_to_dataset(found: Observability) -> xarray.Dataset:
    """Singular values, their directions, bounds, their growth over time, and twins."""
    import xarray as xr

    model, twins = found.problem.model, found.twins
    n, units = model.n, np.array([model.unit(name) for name in model.names], dtype=object)
    variables: dict[str, Any] = {
        "first_state": (("state",), found.state),
        "scale": (("state",), found.scale, {"long_name": "unit of each state in directions"}),
        "crlb_sigma": (("state",), found.crlb_sigma, {"long_name": "Cramer-Rao standard deviation"}),
        "singular_value": (("direction",), found.singular_values),
        "direction_vector": (("direction", "state"), found.information.directions),
        "singular_value_growth": (("time", "direction"), found.growth_values),
        "crlb_sigma_growth": (("time", "state"), found.growth_sigma),
        "twin_state": (("twin", "state"), np.array([t.state for t in twins]).reshape(-1, n)),
        "twin_misfit": (("twin",), np.array([t.misfit for t in twins]), {"long_name": "RMS difference in sigma"}),
    }
    coordinates = {
        "state": ("state", np.array(model.names, dtype=object)),
        "unit": ("state", units),
        "time": ("time", found.growth_times, {"units": "s"}),
    }
    return xr.Dataset(variables, coordinates, {"source": found.source, "about": found.about, "verdict": found.verdict})


def _numbers(problem: Problem, rows: Sequence[Row]) -> list[tuple[str, Array, dict[str, str]]]:
    """Every number of the rows by the name that it has in JSON, NaN where it is not known, with its unit."""
    records = [row.to_dict() for row in rows]
    out: list[tuple[str, Array, dict[str, str]]] = []
    for key in dict.fromkeys(key for record in records for key in record):
        values = [record.get(key) for record in records]
        if all(v is None or isinstance(v, bool | int | float) for v in values):
            if not any(v is None for v in values) and isinstance(values[0], bool):
                out.append((key, np.array(values, dtype=bool), {}))
            else:
                out.append((key, np.array([np.nan if v is None else v for v in values], dtype=float), _unit(problem, key)))
    return out


def _unit(problem: Problem, key: str) -> dict[str, str]:
    """The unit of a number of this name."""
    model = problem.model
    for what in ("_rmse", "_crlb"):
        group, found, _ = key.partition(what)
        if found:
            return {"units": unit_of(model.unit(s) for s in dict(model.groups).get(group, (group,)) if s in model.names)}
    return {"units": "s"} if key in ("seconds", "convergence_time") else {}
