"""Seconds of an estimation alone."""

from __future__ import annotations

import time

from piazzi.kernels import build_seconds


class Stopwatch:
    """Wall-clock seconds since it was made, without those in which kernels were compiled or loaded."""

    def __init__(self) -> None:
        self._built, self._started = build_seconds(), time.perf_counter()

    def seconds(self) -> float:
        """Seconds so far."""
        return time.perf_counter() - self._started - (build_seconds() - self._built)
