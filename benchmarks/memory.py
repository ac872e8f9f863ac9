"""How much memory a call needs at its peak."""

from __future__ import annotations

import tracemalloc
from collections.abc import Callable
from pathlib import Path
from typing import Any

STATUS, CLEAR = Path("/proc/self/status"), Path("/proc/self/clear_refs")


def peak_bytes(run: Callable[[], Any]) -> tuple[Any, int]:
    """What the call returns, and the most bytes it held at once, its result included.

    By tracemalloc, which counts NumPy's arrays from when they are asked for; the compiled code asks for none.
    """
    tracemalloc.start()
    try:
        before = tracemalloc.get_traced_memory()[0]
        tracemalloc.reset_peak()
        result = run()
        return result, tracemalloc.get_traced_memory()[1] - before
    finally:
        tracemalloc.stop()


def peak_resident_bytes(run: Callable[[], Any]) -> tuple[Any, int | None]:
    """What the call returns, and by how much the resident memory grew at its peak; None where the system does not tell."""
    try:
        CLEAR.write_text("5")  # forget the highest size so far
        before = _status("VmRSS")
    except (OSError, KeyError):
        return run(), None
    result = run()
    return result, _status("VmHWM") - before


def _status(key: str) -> int:
    fields = dict(line.split(":", 1) for line in STATUS.read_text().splitlines())
    return int(fields[key].split()[0]) * 1024


def result_bytes(estimate: Any) -> int:
    """Bytes of an estimate's arrays."""
    arrays = (estimate.mean, estimate.covariance, estimate.innovations, estimate.innovation_covariances)
    return sum(a.nbytes for a in arrays)
