"""Arrays and JSON out of an HDF5 file that may be anything: no links are followed, no objects made, nothing absurd is read."""

from __future__ import annotations

import io
import json
import os
from collections.abc import Iterator
from contextlib import contextmanager
from math import prod
from typing import Any

import numpy as np

from piazzi.io.atomic import atomic_path, check_writable
from piazzi.opening import opened as opened_file
from piazzi.problem.checks import Array
from piazzi.text import one_line

SIGNATURE = b"\x89HDF\r\n\x1a\n"
# A data set may hold this much, or this many times its size in the file if that is more
FREE_BYTES = 64 * 2**20
EXPANSION = 20
_DAMAGE = (OSError, KeyError, RuntimeError, TypeError, OverflowError, MemoryError, AttributeError, IndexError, ArithmeticError)


@contextmanager
def written(path: str | os.PathLike[str]) -> Iterator[Any]:
    """An h5netcdf file that appears at `path` when the block ends well, whole or not at all.

    It is made in memory: HDF5 does not survive a disk that is full, and takes the process along.  Raises OSError.
    """
    import h5netcdf

    check_writable(path)
    content = io.BytesIO()
    with h5netcdf.File(content, "w") as file:
        yield file
    with atomic_path(path) as work, open(work, "wb") as sink:
        sink.write(content.getbuffer())


@contextmanager
def opened(path: str | os.PathLike[str]) -> Iterator[Any]:
    """The file's root group; whatever is wrong in it comes out as a ValueError that names the file.

    Raises
    ------
    OSError
        Where the file cannot be read.
    """
    name = os.fspath(path)
    with opened_file(path) as file:
        start = file.read(8)
    if start != SIGNATURE:
        what = {b"": "is empty", b"CDF": "is classic NetCDF; NetCDF-4 is needed"}.get(start[:3], "is not a NetCDF-4 file")
        raise ValueError(f"{name}: the file {what}")
    import h5py

    try:
        with h5py.File(path, "r", locking=False) as root:
            yield root
    except ValueError as error:
        raise ValueError(f"{name}: {one_line(str(error))}") from None
    except _DAMAGE as error:
        raise ValueError(f"{name}: the file is damaged: {one_line(str(error))}") from None


def subgroup(group: Any, name: str) -> Any | None:
    """The group of that name inside another; None where there is none."""
    import h5py

    found = _member(group, name)
    if found is not None and not isinstance(found, h5py.Group):
        raise ValueError(f"{name!r} is not a group")
    return found


def array(group: Any, name: str, *, required: bool = True) -> Array | None:
    """The numbers of a variable.

    Raises
    ------
    ValueError
        Where it is missing but required, or holds anything but real numbers, lies outside the file or is absurdly large.
    """
    data = _variable(group, name, required)
    if data is None:
        return None
    if data.dtype.kind not in "biuf":
        raise ValueError(f"variable {name!r} is not made of real numbers: it has type {str(data.dtype)[:40]}")
    _check_size(data, name, data.dtype.itemsize)
    return np.asarray(data[()])


def slab(group: Any, name: str, index: tuple[int | slice, ...]) -> Array:
    """A part of the numbers of a variable; raises ValueError as `array` does."""
    data = _variable(group, name, True)
    if data.dtype.kind not in "biuf" or data.ndim < len(index):
        raise ValueError(f"variable {name!r} is not an array of numbers with {len(index)} dimensions")
    whole = [1 if isinstance(i, int) else len(range(*i.indices(n))) for i, n in zip(index, data.shape, strict=False)]
    _check_size(data, name, data.dtype.itemsize, prod([*whole, *data.shape[len(index) :]]))
    return np.asarray(data[index])


def document(group: Any, name: str) -> dict[str, Any]:
    """The JSON object in a variable of characters.

    Strings of variable length and attributes are not read at all: in a damaged file they make the HDF5 library hang.
    """
    data = _variable(group, name, True)
    if data.dtype != np.dtype("S1") or data.ndim not in (1, 2) or data.shape[1:] not in ((), (1,)):
        raise ValueError(f"variable {name!r} is not text")
    _check_size(data, name, 1)
    try:
        value = json.loads(np.asarray(data[()]).tobytes().decode("ascii"))
    except RecursionError:
        raise ValueError(f"variable {name!r} is nested too deep") from None
    except ValueError as error:
        raise ValueError(f"variable {name!r} is not JSON: {error}") from None
    if not isinstance(value, dict):
        raise ValueError(f"variable {name!r} is not a JSON object")
    return value


def _member(group: Any, name: str) -> Any | None:
    import h5py

    if name not in group:
        return None
    if not isinstance(group.get(name, getlink=True), h5py.HardLink):
        raise ValueError(f"{name!r} is a link, which is not followed")
    return group[name]


def _variable(group: Any, name: str, required: bool) -> Any:
    import h5py

    data = _member(group, name)
    if data is None:
        if required:
            raise ValueError(f"there is no variable {name!r}")
        return None
    if not isinstance(data, h5py.Dataset) or data.shape is None:
        raise ValueError(f"{name!r} is not a variable with values")
    if data.external or data.is_virtual:
        raise ValueError(f"variable {name!r} has its values in another file, which is not read")
    return data


def _check_size(data: Any, name: str, itemsize: int, count: int | None = None) -> None:
    """Raise where numbers, all or so many of them, take more memory than the file can have meant."""
    size, limit = (
        (int(data.size) if count is None else count) * itemsize,
        max(FREE_BYTES, EXPANSION * data.id.get_storage_size()),
    )
    if size > limit:
        raise ValueError(f"variable {name!r} would take {size:,} bytes, absurd for what the file holds (limit {limit:,})")
