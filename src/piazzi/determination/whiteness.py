"""Fixes that are correlated: a receiver's filter, its clock and the orbits that it knows err alike over minutes.

Rows that share an error know less together than as many that do not.  Where residuals of one row go with those of the next,
only every second row is used, every fourth, and so on, until they do not.  Where they go together however far apart, it is the
forces that do not hold, which other rows do not mend: all are used.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from piazzi.arrays import median
from piazzi.determination.analysis import analysed
from piazzi.determination.setup import Setup
from piazzi.estimate.chi_square import quantile
from piazzi.evaluate.quantities import number
from piazzi.problem.checks import Array

SURE = 0.999
FEWEST = 24  # fixes that are left at the least


def with_white_fixes(given: Setup) -> Setup:
    """The set-up with those fixes set aside that say what others say; itself where residuals are white, or never are."""
    wide = [s.sensor.startswith("position") for s in given.problem.stations]
    own = np.flatnonzero(np.array(wide)[given.tracking.stations_of(given.problem)])
    if len(own) < 2 * FEWEST or not np.isfinite(given.states).all():
        return given
    whitened = analysed(given, given.states).whitened[own]
    stride = 1
    while len(own) // (2 * stride) >= FEWEST and _goes_on(whitened[::stride]):
        stride *= 2
    if stride == 1 or _goes_on(whitened[::stride]):
        return given
    spare = np.zeros(len(given.rows), dtype=np.bool_)
    spare[own] = True
    spare[own[::stride]] = False
    apart = median(np.diff(given.tracking.row_times[own[::stride]]))
    text = f"fixes are correlated: one in {stride} is used, {number(apart / 60.0, 2)} min apart, which are not"
    return replace(given, spare=spare, assumed=(*given.assumed, text))


def _goes_on(whitened: Array) -> bool:
    """Whether residuals (R, m) go with the next ones, by their first autocorrelation with outliers cut off."""
    middle = float(np.nanmedian(np.abs(whitened)))
    cut = np.clip(whitened, -4.0 * middle, 4.0 * middle)
    pairs = cut[1:] * cut[:-1]
    there = np.isfinite(pairs)
    size = float(np.nanmean(cut**2))
    if not (there.any() and size > 0.0):
        return False
    r = float(np.nanmean(pairs)) / size
    return r > 0.0 and r**2 * there.sum() > quantile(SURE, 1)
