"""Measurements and estimates as xarray datasets: every axis named, every number with its unit."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from piazzi.problem import Problem, Tracking
from piazzi.problem.checks import Array
from piazzi.problem.epochs import epoch_of

if TYPE_CHECKING:
    import xarray

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
    return xr.Dataset(variables, coordinates, {"title": label(problem.name), **instant(problem, tracking)})


def estimate_variables(
    problem: Problem, tracking: Tracking, arrays: Mapping[str, Array]
) -> tuple[dict[str, Any], dict[str, Any]]:
    """Variables and coordinates of an estimate, given its mean, covariance, innovations and innovation_covariances by name.

    Dimensions: time (K), state and state_2 (n), row (J), component and component_2 (m).
    """
    names = np.array(problem.model.names, dtype=object)
    variables = _rows(problem, tracking)
    variables["state_mean"] = (("time", "state"), arrays["mean"], {"long_name": "estimated state"})
    variables["covariance"] = (("time", "state", "state_2"), arrays["covariance"], {"long_name": "covariance of the estimate"})
    variables["innovation"] = (("row", "component"), arrays["innovations"], {"long_name": "measurement minus prediction"})
    variables["innovation_covariance"] = (("row", "component", "component_2"), arrays["innovation_covariances"])
    if tracking.truth is not None and tracking.truth.shape[1] == len(names):
        variables["truth"] = (("time", "state"), tracking.truth, {"long_name": "true state"})
    coordinates = _epochs(problem, tracking) | _places(problem, arrays["innovations"].shape[1])
    return variables, coordinates | {"state_2": ("state_2", names)}


def plain_details(details: Mapping[str, Any]) -> dict[str, Any]:
    """The details that are no arrays, as JSON keeps them; raises ValueError for one that it cannot keep."""
    return {key: _plain(value, key) for key, value in details.items() if not isinstance(value, np.ndarray)}


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


def instant(problem: Problem, tracking: Tracking) -> dict[str, Any]:
    """The instant that times are past: as text with its scale, and as whole seconds of TT past J2000.0 and a fraction."""
    epoch = epoch_of(problem, tracking)
    return {} if epoch is None else {"epoch": epoch.exact(), "epoch_tt": np.array([epoch.whole, epoch.fraction])}


def label(text: str) -> str:
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
