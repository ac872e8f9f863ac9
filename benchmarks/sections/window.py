"""Sliding windows through ``estimate``, covariances included; measurements new at every call."""

from __future__ import annotations

from collections.abc import Iterator

from cases import calls, floor, variants
from figures import Figure, interleaved

REPEATS = {10: 15, 50: 9, 100: 7, 200: 5}
BOUND = 3.5


def figures() -> Iterator[Figure]:
    from piazzi.estimate.sliding_window import SlidingWindow

    for lag, repeats in REPEATS.items():
        ours = calls(SlidingWindow(lag=lag), variants(repeats + 1))
        seconds, ratio = interleaved(ours, lambda lag=lag: floor().seconds("window", 1, lag=lag))
        per_step = seconds / floor().K
        yield Figure(f"window of {lag}, per step", per_step * 1e6, "us", ratio=ratio, to="C floor", bound=BOUND)
