"""The native format: a problem, its measurements and an estimate in one labelled NetCDF-4 file, bit for bit.

The root group holds the tracking, with the problem as JSON text in the attribute `problem`; the groups `estimate` and
`delayed` hold an estimate.  Any NetCDF reader shows them with names and units.
"""

from __future__ import annotations

import json
import os
from typing import TYPE_CHECKING, Any, cast, get_args

import numpy as np

from piazzi.estimate import Estimate
from piazzi.estimate.dataset import DETAIL, FORMAT, estimate_to_dataset, tracking_to_dataset
from piazzi.estimate.estimator import View
from piazzi.io import hdf5
from piazzi.io.atomic import atomic_path
from piazzi.problem import Problem, Tracking
from piazzi.problem.checks import Array
from piazzi.scenarios.faults import shown
from piazzi.scenarios.write import problem_from_tables

if TYPE_CHECKING:
    import xarray


def write_netcdf(path: str | os.PathLike[str], problem: Problem, tracking: Tracking) -> None:
    """Write a problem and its measurements such that `read_netcdf` gives them back bit for bit; raises OSError, ValueError."""
    dataset = tracking_to_dataset(problem, tracking)
    with atomic_path(path) as work:
        _put(dataset, work, None)


def write_estimate(path: str | os.PathLike[str], estimate: Estimate) -> None:
    """Write an estimate with all it was made from, such that `read_estimate` gives it back; raises OSError, ValueError."""
    groups = {None: tracking_to_dataset(estimate.problem, estimate.tracking), "estimate": estimate_to_dataset(estimate)}
    if estimate.delayed is not None:
        groups["delayed"] = estimate_to_dataset(estimate.delayed)
    with atomic_path(path) as work:
        for group, dataset in groups.items():
            _put(dataset, work, group)


def _put(dataset: xarray.Dataset, path: Any, group: str | None) -> None:
    # no fill values: NaN already says what is missing, and integers have none missing
    encoding = {name: {"_FillValue": None} for name in dataset.variables}
    dataset.to_netcdf(path, mode="w" if group is None else "a", group=group, engine="h5netcdf", encoding=encoding)


def read_netcdf(path: str | os.PathLike[str]) -> tuple[Problem, Tracking]:
    """Problem and measurements of a file that `write_netcdf` or `write_estimate` wrote.

    Raises
    ------
    OSError
        Where the file cannot be read.
    ValueError
        Where it is no such file; the message names the file and what is wrong in it.
    """
    with hdf5.opened(path) as root:
        return _content(root)


def read_estimate(path: str | os.PathLike[str]) -> Estimate:
    """The estimate in a file that `write_estimate` wrote, with its problem and measurements; raises OSError, ValueError."""
    with hdf5.opened(path) as root:
        problem, tracking = _content(root)
        group, late = hdf5.subgroup(root, "estimate"), hdf5.subgroup(root, "delayed")
        if group is None:
            raise ValueError("it holds measurements but no estimate")
        delayed = None if late is None else _estimate(late, problem, tracking, None)
        return _estimate(group, problem, tracking, delayed)


def _content(root: Any) -> tuple[Problem, Tracking]:
    found = hdf5.text(root, "format", "")
    if found != FORMAT:
        raise ValueError(f"its format is {found[:40]!r}; Piazzi reads {FORMAT!r}")
    problem = problem_from_tables(_json(root, "problem"), hdf5.text(root, "name", ""), "attribute 'problem'")
    times, values, truth = hdf5.array(root, "row_time"), hdf5.array(root, "value"), hdf5.array(root, "truth", required=False)
    return problem, Tracking(times, values, _stations(root), truth, hdf5.text(root, "epoch", ""))


def _stations(root: Any) -> Any:
    """Station of every row, None where the tracking does not name it."""
    index, names = hdf5.array(root, "row_station"), hdf5.texts(root, "station")
    assert index is not None
    sound = index.dtype.kind in "iu" and index.ndim == 1 and index.size and names
    if not (sound and 0 <= index.min() <= index.max() < len(names)):
        raise ValueError(f"variable 'row_station' does not hold indices into the {len(names)} stations")
    return np.array(names)[index] if hdf5.number(root["row_station"], "named") else None


def _estimate(group: Any, problem: Problem, tracking: Tracking, delayed: Estimate | None) -> Estimate:
    J, K, n = len(tracking.row_times), len(tracking.times), problem.model.n
    m = _shaped(group, "innovation", (J, None)).shape[1]
    details, view = _json(group, "details"), hdf5.text(group, "view")
    details |= {key.removeprefix(DETAIL): hdf5.array(group, key) for key in group if key.startswith(DETAIL)}
    if view not in get_args(View):
        raise ValueError(f"attribute 'view' is {shown(view)}; it must be one of {', '.join(get_args(View))}")
    return Estimate(
        problem, tracking,
        _shaped(group, "mean", (K, n)), _shaped(group, "covariance", (K, n, n)),
        _shaped(group, "innovation", (J, m)), _shaped(group, "innovation_covariance", (J, m, m)),
        int(hdf5.number(group, "iterations")), hdf5.number(group, "seconds"),
        cast(View, view), delayed, details, hdf5.text(group, "failure", ""),
    )  # fmt: skip


def _shaped(group: Any, name: str, shape: tuple[int | None, ...]) -> Array:
    """A variable of that shape as float64, where None stands for any length."""
    value = hdf5.array(group, name)
    assert value is not None
    wanted = tuple(have if want is None else want for want, have in zip(shape, value.shape, strict=False))
    if wanted != value.shape or len(wanted) != len(shape):
        raise ValueError(f"variable {name!r} has shape {value.shape}; it must be {shape}")
    return np.array(value, dtype=float)


def _json(group: Any, name: str) -> dict[str, Any]:
    """The table in a text attribute."""
    try:
        value = json.loads(hdf5.text(group, name), parse_constant=_no_constant if name == "problem" else None)
    except RecursionError:
        raise ValueError(f"attribute {name!r} is nested too deep") from None
    except json.JSONDecodeError as error:
        raise ValueError(f"attribute {name!r} is not JSON: {error}") from None
    if not isinstance(value, dict):
        raise ValueError(f"attribute {name!r} is not a JSON object")
    return value


def _no_constant(text: str) -> Any:
    raise ValueError(f"attribute 'problem' holds {text}, which is no number")
