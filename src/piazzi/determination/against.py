"""How far a determination is from another orbit, at the rows of the other or every minute, in metres and in sigma."""

from __future__ import annotations

from typing import Any

import numpy as np

from piazzi.arrays import distinct
from piazzi.determination.arcs import arc_of, dates_of
from piazzi.formats import Ephemeris, read_ephemeris
from piazzi.orbit import Difference, difference

MOST = 2000  # rows


def against(found: Any, other: Any, span: Any = None) -> Difference:
    """The other orbit minus the determination's, along its radial, transverse and normal axes.

    Parameters
    ----------
    found : Determination
    other : a file of an orbit, or an `Ephemeris`; of several objects the one of the same name
    span : as of products; default the measurements that were used

    Raises
    ------
    ValueError
        Where they have no time in common, or the file has several objects of other names.
    OSError
        Where the file cannot be read.
    """
    orbit = other if isinstance(other, Ephemeris) else read_ephemeris(other)
    begin, end = dates_of(found, span)
    chosen = found.object if len(orbit.objects) > 1 and found.object in orbit.objects else None
    arcs = orbit.of(chosen) if chosen else orbit.arcs
    length = end - begin
    if arcs:
        t = distinct(np.concatenate([arc.t + (arc.epoch - begin) for arc in arcs]))
        t = t[(t >= 0.0) & (t <= length)]
    else:
        t = np.linspace(0.0, length, int(min(length // 60.0 + 2, MOST)))
    if len(t) < 2:
        raise ValueError("--against: the other orbit has no two rows within the span of the measurements")
    t = t[distinct(np.linspace(0, len(t) - 1, MOST).astype(int))]
    return difference(arc_of(found, begin, t, "GCRF", formal=False), orbit, object=chosen)
