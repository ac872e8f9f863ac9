"""The native format: a problem, its measurements and an estimate in one labelled NetCDF-4 file, bit for bit.

The root group holds the tracking, the groups `estimate` and `delayed` an estimate; any NetCDF reader shows them with names and
units.  What is no array is JSON, in variables of characters: `about` in every group, and `problem`, which has the tables of a
scenario file in SI units.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, cast, get_args

import numpy as np

from piazzi.estimate.dataset import DETAIL, plain_details, tracking_to_dataset
from piazzi.estimate.estimator import Estimate, View
from piazzi.io import hdf5
from piazzi.problem import Problem, Tracking
from piazzi.problem.checks import Array
from piazzi.problem.epochs import epoch_given
from piazzi.scenarios.table import Faults, Table
from piazzi.scenarios.write import problem_from_tables, problem_to_tables
from piazzi.text import shown

if TYPE_CHECKING:
    import xarray

FORMAT = "piazzi/1"


def write_netcdf(path: str | os.PathLike[str], problem: Problem, tracking: Tracking) -> None:
    """Write a problem and its measurements such that `read_netcdf` gives them back bit for bit; raises OSError, ValueError."""
    _write(path, {"/": _root(problem, tracking)})


def write_estimate(path: str | os.PathLike[str], estimate: Estimate) -> None:
    """Write an estimate with all it was made from, such that `read_estimate` gives it back; raises OSError, ValueError."""
    groups = {"/": _root(estimate.problem, estimate.tracking), "estimate": _group(estimate)}
    if estimate.delayed is not None:
        groups["delayed"] = _group(estimate.delayed)
    _write(path, groups)


def write_dataset(path: str | os.PathLike[str], dataset: xarray.Dataset) -> None:
    """Write a dataset for any NetCDF reader, whole or not at all; raises OSError."""
    _write(path, {"/": dataset})


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


# ---- writing -----------------------------------------------------------------------------------------------------------


def _root(problem: Problem, tracking: Tracking) -> xarray.Dataset:
    named = tracking.row_stations is not None
    epoch = "" if tracking.epoch is None else tracking.epoch.exact()
    about = {"format": FORMAT, "name": problem.name, "epoch": epoch, "stations_named": named}
    return _with_json(tracking_to_dataset(problem, tracking), about=about, problem=problem_to_tables(problem))


def _group(estimate: Estimate) -> xarray.Dataset:
    about = {
        "view": estimate.view, "iterations": int(estimate.iterations), "seconds": float(estimate.seconds),
        "failure": estimate.failure, "details": plain_details(estimate.details),
    }  # fmt: skip
    return _with_json(estimate.to_dataset(), about=about)


def _with_json(dataset: xarray.Dataset, **documents: Mapping[str, Any]) -> xarray.Dataset:
    """The dataset with a variable for each document."""
    texts = {name: ((), np.array(json.dumps(content).encode("ascii"))) for name, content in documents.items()}
    out = dataset.assign(texts)
    for name in documents:
        out[name].encoding = {"dtype": "S1", "char_dim_name": f"{name}_characters"}
    return out


def _write(path: str | os.PathLike[str], groups: Mapping[str, xarray.Dataset]) -> None:
    from xarray.backends import H5NetCDFStore

    with hdf5.written(path) as file:
        for group, dataset in groups.items():
            # no fill values: NaN already says what is missing, and integers have none missing
            encoding = {name: {"_FillValue": None, **variable.encoding} for name, variable in dataset.variables.items()}
            dataset.dump_to_store(H5NetCDFStore(file, group=group, mode="a"), encoding=encoding)


# ---- reading -----------------------------------------------------------------------------------------------------------


def _content(root: Any) -> tuple[Problem, Tracking]:
    faults = Faults()
    if "about" not in root and "o_minus_c" in root:
        raise ValueError(
            "it is what a determination found, without its problem: name the tracking itself, with --scenario, or give the "
            "estimators to determine, each by --with"
        )
    about = Table(hdf5.document(root, "about"), "about", faults)
    if about.text("format") != FORMAT:
        kind = "format" if about.raw("format") is not None else "schema"  # a study has one, and no measurements
        raise ValueError(f"it holds no measurements: its {kind} is {shown(about.raw(kind))}; Piazzi reads {FORMAT!r}")
    name, named = about.text("name", ""), about.flag("stations_named", False)
    epoch: Any = about.text("epoch", "")
    with faults.at("about.epoch"):
        epoch = epoch_given(epoch)
    _raise_first(faults)
    problem = problem_from_tables(hdf5.document(root, "problem"), name or "", "variable 'problem'")
    times, values, truth = hdf5.array(root, "row_time"), hdf5.array(root, "value"), hdf5.array(root, "truth", required=False)
    stations = _stations(root, problem) if named else None
    return problem, Tracking(times, values, stations, truth, epoch)


def _stations(root: Any, problem: Problem) -> Array:
    """Station of every row."""
    index = hdf5.array(root, "row_station")
    names = [s.name for s in problem.stations]
    assert index is not None
    sound = index.dtype.kind in "iu" and index.ndim == 1 and index.size and names
    if not (sound and 0 <= index.min() <= index.max() < len(names)):
        raise ValueError(f"variable 'row_station' does not hold indices into the {len(names)} stations of the problem")
    return np.array(names)[index]


def _estimate(group: Any, problem: Problem, tracking: Tracking, delayed: Estimate | None) -> Estimate:
    J, K, n = len(tracking.row_times), len(tracking.times), problem.model.n
    m = _shaped(group, "innovation", (J, None)).shape[1]
    faults = Faults()
    about = Table(hdf5.document(group, "about"), "about", faults)
    view, failure = about.text("view", choices=get_args(View)), about.text("failure", "")
    iterations, seconds = about.number("iterations"), about.number("seconds")
    details = about.raw("details")
    if not isinstance(details, dict):
        about.fault("details", "must be a table")
    _raise_first(faults)
    if view is None or iterations is None or seconds is None:
        raise ValueError("variable 'about' lacks the view, the iterations or the seconds of the estimate")
    details |= {key.removeprefix(DETAIL): _detail(group, key) for key in group if key.startswith(DETAIL)}
    return Estimate(
        problem, tracking,
        _shaped(group, "state_mean" if "state_mean" in group else "mean", (K, n)), _shaped(group, "covariance", (K, n, n)),
        _shaped(group, "innovation", (J, m)), _shaped(group, "innovation_covariance", (J, m, m)),
        int(iterations), seconds, cast(View, view), delayed, details, failure or "",
    )  # fmt: skip


def _detail(group: Any, name: str) -> Array | None:
    """An array of the details; the format keeps what is true or false as bytes."""
    found = hdf5.array(group, name)
    return found.astype(bool) if found is not None and found.dtype == np.int8 else found


def _raise_first(faults: Faults) -> None:
    if faults:
        raise ValueError(f"in variable {faults[0]}")


def _shaped(group: Any, name: str, shape: tuple[int | None, ...]) -> Array:
    """A variable of that shape as float64, where None stands for any length."""
    value = hdf5.array(group, name)
    assert value is not None
    wanted = tuple(have if want is None else want for want, have in zip(shape, value.shape, strict=False))
    if wanted != value.shape or len(wanted) != len(shape):
        raise ValueError(f"variable {name!r} has shape {value.shape}; it must be {shape}")
    return np.array(value, dtype=float)
