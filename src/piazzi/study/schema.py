"""What a log and a store of a study hold, checked when they are read: sums that are right say nothing of the contents."""

from __future__ import annotations

from collections.abc import Mapping
from math import prod
from typing import TYPE_CHECKING, Any

import numpy as np

from piazzi.problem.epochs import epoch_given
from piazzi.study.score import NUMBERS

if TYPE_CHECKING:
    from piazzi.earth import Epoch

KINDS = ("<f8", "<f4", "<i8", "|u1", "<u2", "<u4", "<u8", "|b1")
VIEWS = ("realtime", "delayed")
_MOST = 2**40


def check_record(header: Any, size: int) -> None:
    """Raise ValueError unless this is the header of a piece, its task, arrays of `size` bytes and messages of its runs."""
    if not isinstance(header, dict):
        raise ValueError("a record holds no table")
    task = header.get("task")
    if not (isinstance(task, list) and len(task) == 3 and all(map(_index, task))):
        raise ValueError(f"a record has the task {str(task)[:60]}, not a point, a first run and a number of runs")
    arrays = header.get("arrays")
    if not (isinstance(arrays, list) and all(map(_array, arrays)) and len({a[0] for a in arrays}) == len(arrays)):
        raise ValueError("a record does not say which arrays it holds")
    wanted = sum(prod(shape) * np.dtype(kind).itemsize for _, kind, shape in arrays)
    if wanted != size:
        raise ValueError(f"a record declares arrays of {str(wanted)[:60]} bytes and holds {size}")
    messages = header.get("messages")
    if not (isinstance(messages, list) and all(_message(m, *task) for m in messages)):
        raise ValueError("a record has messages that are no row, run and text")


def epoch_said(specification: Mapping[str, Any]) -> Epoch | None:
    """The epoch of a study's problem, None where it has none; raises ValueError for what is no date."""
    problem = specification.get("problem")
    text = problem.get("epoch") if isinstance(problem, Mapping) else None
    return epoch_given(text if isinstance(text, str) else None)


def check_about(about: Mapping[str, Any]) -> None:
    """Raise ValueError unless this describes a finished study."""
    specification = about.get("specification")
    if not isinstance(specification, Mapping):
        raise ValueError("it does not say which study it is of")
    sound = {
        "specification": isinstance(specification.get("name"), str)
        and all(_index(specification.get(key)) for key in ("runs", "seed"))
        and isinstance(specification.get("vary"), Mapping),
        "rows": _rows(about.get("rows")),
        "axes": _texts(about.get("axes")),
        "points": _listed(about.get("points"), lambda p: isinstance(p, list) and len(p) == len(about["axes"])),
        "groups": _texts(about.get("groups")),
        "units": _listed(about.get("units"), _texts),
        "states": _texts(about.get("states")) and bool(about["states"]),
        "epochs": _index(about.get("epochs")),
        "digest": isinstance(about.get("digest"), str),
        "messages": _listed(about.get("messages"), _placed) and _index(about.get("messages_left_out", 0)),
        "bounds_unknown": _listed(about.get("bounds_unknown", []), lambda b: _pair(b, about)),
    }
    for name, fits in sound.items():
        if not fits:
            raise ValueError(f"what it says of its {name} is not what a study has")
    epoch_said(about["specification"])
    if len(about["units"]) != len(about["groups"]):
        raise ValueError(f"it has units for {len(about['units'])} groups of {len(about['groups'])}")
    for point, row, *_ in about["messages"]:
        if point >= len(about["points"]) or row >= len(about["rows"]):
            raise ValueError(f"a message is of point {point}, row {row}, which the study does not have")


def check_arrays(root: Any, about: Mapping[str, Any]) -> None:
    """Raise ValueError unless the variables of a store have the sizes of its study."""
    per_run = (len(about["points"]), len(about["rows"]), int(about["specification"]["runs"]))
    G, T = len(about["groups"]), len(root["time"])
    shapes: dict[str, tuple[int, ...]] = {n: (*per_run, G) if grouped else per_run for n, grouped in NUMBERS.items()}
    shapes |= {"success": per_run, "diverged": per_run, "error": (*per_run, T, G), "nees": (*per_run, T)}
    shapes |= {"bound": (per_run[0], 2, T, G), "bound_last_half": (per_run[0], 2, G), "bound_runs": (per_run[0], 2)}
    if "rank" in root:  # not in earlier stores
        shapes["rank"] = (*per_run, T)
    for name, shape in shapes.items():
        if name not in root:
            raise ValueError(f"it has no variable {name!r}")
        if root[name].shape != shape or root[name].dtype.kind not in "fiub":
            raise ValueError(
                f"variable {name!r} has shape {root[name].shape} of {root[name].dtype}; the study has {shape} numbers"
            )


def _index(value: Any) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and 0 <= value < _MOST


def _array(found: Any) -> bool:
    if not (isinstance(found, list) and len(found) == 3 and isinstance(found[0], str) and found[1] in KINDS):
        return False
    return isinstance(found[2], list) and len(found[2]) <= 8 and all(map(_index, found[2]))


def _message(found: Any, point: int, first: int, count: int) -> bool:
    if not (isinstance(found, list) and len(found) == 3 and isinstance(found[2], str)):
        return False
    row, run, _ = found
    if not count:
        return (row, run) == (-1, -1)  # why a bound is not known
    return _index(row) and _index(run) and first <= run < first + count


def _placed(found: Any) -> bool:
    return isinstance(found, list) and len(found) == 4 and all(map(_index, found[:3])) and isinstance(found[3], str)


def _pair(found: Any, about: Mapping[str, Any]) -> bool:
    if not (isinstance(found, list) and len(found) == 2 and _index(found[0]) and isinstance(found[1], str)):
        return False
    return bool(found[0] < len(about["points"]))


def _rows(found: Any) -> bool:
    return bool(found) and _listed(found, lambda r: isinstance(r, list) and len(r) == 2 and _texts(r) and r[1] in VIEWS)


def _texts(found: Any) -> bool:
    return _listed(found, lambda text: isinstance(text, str))


def _listed(found: Any, fits: Any) -> bool:
    return isinstance(found, list) and all(map(fits, found))
