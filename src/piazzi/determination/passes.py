"""Passes of a determination: which rows are one, by the rule that tables of tracking have too."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from piazzi.determination.sensing import Measured
from piazzi.formats.passes import numbered
from piazzi.problem import Tracking
from piazzi.problem.checks import Array

if TYPE_CHECKING:
    from piazzi.determination.setup import Setup


def pass_of_rows(seen: Measured, tracking: Tracking, rows: Array) -> Array:
    """Number of the pass (J,) of each row, from 1, each station's in order of time; 0 where nothing was measured.

    Parameters
    ----------
    seen, tracking : what was measured, and a tracking of it
    rows : (J, m), for each row of the tracking and component the index of the observation, -1 for none
    """
    there = np.isfinite(tracking.values).any(axis=1) & (rows.max(axis=1) >= 0)
    labels = np.array([seen.labels[name] for name in tracking.row_stations[there]], dtype=object)
    out = np.zeros(len(there), dtype=np.int64)
    out[there] = numbered(tracking.row_times[there], labels, seen.observations.segment[rows.max(axis=1)[there]])
    return out


def passes(given: Setup, keep: Array) -> list[Array]:
    """Rows of each pass that are kept, each (R,), in order of their beginnings."""
    number = pass_of_rows(given.measured, given.tracking, given.rows)
    found = [np.flatnonzero((number == k) & keep) for k in range(1, int(number.max(initial=0)) + 1)]
    t = given.tracking.row_times
    return sorted((rows for rows in found if len(rows)), key=lambda rows: float(t[rows[0]]))


def labels_of(given: Setup) -> Array:
    """(J,), the names by which users know the stations of rows."""
    which = given.tracking.stations_of(given.problem)
    return np.array([given.measured.labels[s.name] for s in given.problem.stations], dtype=object)[which]
