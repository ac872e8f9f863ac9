"""Which format a file is in: by the ending of its name."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from piazzi.problem import Problem, Tracking
from piazzi.problem.checks import Array
from piazzi.text import nearest

if TYPE_CHECKING:
    from piazzi.estimate.estimator import Estimate

RECORDINGS = (".nc", ".npz", ".csv")


def ending(path: str | os.PathLike[str], known: tuple[str, ...] = RECORDINGS) -> str:
    """The ending of a name, in lower case; raises ValueError unless it is one of those known."""
    suffix = Path(path).suffix.lower()
    if suffix not in known:
        raise ValueError(f"{os.fspath(path)}: files end in {', '.join(known)}, not {suffix!r}{nearest(suffix, known)}")
    return suffix


def save(path: str | os.PathLike[str], problem: Problem, tracking: Tracking) -> None:
    """Write a problem and its measurements, whole or not at all, in the format of the path's ending.

    ``.nc`` holds everything; ``.npz`` (the founding layout) the satellite-bearing problem only; ``.csv`` the measurements,
    to be loaded with their scenario.

    Raises
    ------
    OSError
        Where the file cannot be written.
    ValueError
        For another ending, or a problem that the format cannot hold.
    """
    kind = ending(path)
    if kind == ".nc":
        from piazzi.io.netcdf import write_netcdf

        write_netcdf(path, problem, tracking)
    elif kind == ".npz":
        from piazzi.io.npz import write_npz

        write_npz(path, problem, tracking)
    else:
        from piazzi.io.csv import write_csv

        write_csv(path, problem, tracking)


def save_estimate(path: str | os.PathLike[str], estimate: Estimate) -> None:
    """Write an estimate, whole or not at all, in the format of the path's ending.

    ``.nc`` holds everything, problem and measurements included, for `load_estimate`; ``.npz`` the arrays; ``.csv`` a row for
    each epoch with time, means, standard deviations and covariances.

    Raises
    ------
    OSError
        Where the file cannot be written.
    ValueError
        For another ending.
    """
    kind = ending(path)
    if kind == ".nc":
        from piazzi.io.netcdf import write_estimate

        write_estimate(path, estimate)
    elif kind == ".npz":
        from piazzi.io.npz import write_arrays

        write_arrays(path, _arrays(estimate))
    else:
        from piazzi.io.csv import write_estimate_csv

        write_estimate_csv(path, estimate)


def load_estimate(path: str | os.PathLike[str]) -> Estimate:
    """The estimate in a ``.nc`` file that `save_estimate` wrote, bit for bit; raises OSError, ValueError."""
    ending(path, (".nc",))
    from piazzi.io.netcdf import read_estimate

    return read_estimate(path)


def _arrays(estimate: Estimate) -> Mapping[str, Array]:
    out: dict[str, Array] = {
        "times": estimate.times, "names": np.array(estimate.names), "mean": estimate.mean, "covariance": estimate.covariance,
        "innovations": estimate.innovations, "innovation_covariances": estimate.innovation_covariances,
    }  # fmt: skip
    from piazzi.io.npz import instant

    out |= instant(estimate.problem, estimate.tracking)
    if estimate.delayed is not None:
        out |= {"delayed_mean": estimate.delayed.mean, "delayed_covariance": estimate.delayed.covariance}
    return out
