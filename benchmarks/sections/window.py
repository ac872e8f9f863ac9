"""Sliding windows through ``estimate``, covariances included; measurements new at every call."""

from __future__ import annotations

from collections.abc import Iterator

from cases import apart, calls, floor, recording, variants
from figures import Figure, interleaved

import piazzi as pz

REPEATS = {10: 15, 50: 9, 100: 7, 200: 5}
BOUND = 2.0


def figures() -> Iterator[Figure]:
    from piazzi.estimate.sliding_window import SlidingWindow

    for lag, repeats in REPEATS.items():
        ours = calls(SlidingWindow(lag=lag), variants(repeats + 1))
        seconds, ratio = interleaved(ours, lambda lag=lag: floor().seconds("window", 1, lag=lag))
        note = apart(floor().window(lag)[0], SlidingWindow(lag=lag).estimate(*pz.load(recording())))
        per_step = seconds / floor().K * 1e6
        yield Figure(f"window of {lag}, per step", per_step, "us", ratio=ratio, to="C floor", bound=BOUND, note=note)
