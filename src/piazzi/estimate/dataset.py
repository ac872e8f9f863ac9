"""Measurements and estimates as xarray datasets: every axis named, every number with its unit."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import numpy as np

from piazzi.problem import Problem, Tracking
from piazzi.problem.checks import Array
from piazzi.problem.epochs import epoch_of

if TYPE_CHECKING:
    import xarray

    from piazzi.estimate.estimator import Estimate

DETAIL = "detail_"


def tracking_to_dataset(problem: Problem, tracking: Tracking) -> xarray.Dataset:
    """Measurements, and the truth where it is known, with names and units."""
    import xarray as xr

    variables = _rows(problem, tracking)
    coordinates = _epochs(problem, tracking) | _places(problem, problem.model.width)
    variables["value"] = (
        ("row", "component"),
        tracking.padded(problem.model.width),
        {"long_name": "measurements, NaN where missing"},
    )
    if tracking.truth is not None:
        own = "state" if tracking.truth.shape[1] == problem.model.n else "true_state"
        variables["truth"] = (("time", own), tracking.truth, {"long_name": "true state"})
    return xr.Dataset(variables, coordinates, {"title": _label(problem.name), **_instant(problem, tracking)})


def estimate_to_dataset(estimate: Estimate) -> xarray.Dataset:
    """Means, covariances and innovations with names and units, and the truth where it is known.

    Dimensions: time (K), state and state_2 (n), row (J), component and component_2 (m).
    """
    import xarray as xr

    problem, tracking = estimate.problem, estimate.tracking
    variables = _rows(problem, tracking)
    coordinates = _epochs(problem, tracking) | _places(problem, estimate.innovations.shape[1])
    names = np.array(estimate.names, dtype=object)
    variables["mean"] = (("time", "state"), estimate.mean, {"long_name": "estimated state"})
    variables["covariance"] = (("time", "state", "state_2"), estimate.covariance, {"long_name": "covariance of the estimate"})
    variables["innovation"] = (("row", "component"), estimate.innovations, {"long_name": "measurement minus prediction"})
    variables["innovation_covariance"] = (("row", "component", "component_2"), estimate.innovation_covariances)
    if tracking.truth is not None and tracking.truth.shape[1] == len(names):
        variables["truth"] = (("time", "state"), tracking.truth, {"long_name": "true state"})
    for key, value in estimate.details.items():
        if isinstance(value, np.ndarray):
            variables[DETAIL + key] = (tuple(f"{key}_{i}" for i in range(value.ndim)), value)
    attributes = {
        "view": estimate.view, "iterations": int(estimate.iterations), "seconds": float(estimate.seconds),
        "success": int(estimate.success), "message": _label(estimate.message), "details": json.dumps(plain_details(estimate)),
        **_instant(problem, tracking),
    }  # fmt: skip
    return xr.Dataset(variables, coordinates | {"state_2": ("state_2", names)}, attributes)


def plain_details(estimate: Estimate) -> dict[str, Any]:
    """The details that are no arrays, as JSON keeps them; raises ValueError for one that it cannot keep."""
    return {key: _plain(value, key) for key, value in estimate.details.items() if not isinstance(value, np.ndarray)}


def _rows(problem: Problem, tracking: Tracking) -> dict[str, Any]:
    """Time and station of every row."""
    index = tracking.stations_of(problem).astype(np.int32)
    return {
        "row_time": ("row", tracking.row_times, {"units": "s"}),
        "row_station": ("row", index, {"long_name": "index into station"}),
    }


def _places(problem: Problem, width: int) -> dict[str, Any]:
    """Names of the stations and of what they measure, with units."""
    sensors = [problem.model.sensor(s.sensor) for s in problem.stations]

    def grid(labels: list[tuple[str, ...]]) -> Array:
        return np.array([[*row, *[""] * (width - len(row))] for row in labels], dtype=object)

    return {
        "station": ("station", np.array([s.name for s in problem.stations], dtype=object)),
        "component_name": (("station", "component"), grid([s.components for s in sensors])),
        "component_unit": (("station", "component"), grid([tuple(dict(s.units).values()) for s in sensors])),
    }


def _epochs(problem: Problem, tracking: Tracking) -> dict[str, Any]:
    names = problem.model.names
    epoch = epoch_of(problem, tracking)
    since = "" if epoch is None else f" of TT past {epoch.exact()}"
    units = np.array([problem.model.unit(name) for name in names], dtype=object)
    return {
        "time": ("time", tracking.times, {"units": "s", "long_name": f"seconds{since}"}),
        "state": ("state", np.array(names, dtype=object)),
        "unit": ("state", units, {"long_name": "unit of each state"}),
    }


def _instant(problem: Problem, tracking: Tracking) -> dict[str, Any]:
    """The instant that times are past: as text with its scale, and as whole seconds of TT past J2000.0 and a fraction."""
    epoch = epoch_of(problem, tracking)
    return {} if epoch is None else {"epoch": epoch.exact(), "epoch_tt": np.array([epoch.whole, epoch.fraction])}


def _label(text: str) -> str:
    """A text that any attribute can hold."""
    return text.replace("\0", " ")


def _plain(value: Any, key: str) -> Any:
    """A detail as JSON keeps it."""
    if isinstance(value, np.generic):
        return value.item()
    if value is None or isinstance(value, bool | int | float | str):
        return value
    if isinstance(value, list | tuple):
        return [_plain(v, key) for v in value]
    if isinstance(value, dict):
        return {str(k): _plain(v, key) for k, v in value.items()}
    raise ValueError(f"detail {key!r} of the estimate is a {type(value).__name__}, which cannot be written to a file")
