"""Which rows are one pass: the one rule, for tables of tracking, biases per pass and rows that are left out in turn."""

from __future__ import annotations

import numpy as np

from piazzi.arrays import Array, median

GAP = 3600.0  # s without a row, behind which another pass begins: a low satellite comes again after 75 min or more
LONG = 2.0  # times the usual interval: a pause between two blocks of a file that makes them two passes


def numbered(t: Array, who: Array, block: Array) -> Array:
    """Number of the pass (R,) of each row, from 1; those of each station follow one another, in order of time.

    A pass ends where nothing comes for an hour, and where its block of the file ends before another begins, after more than
    twice the usual interval.  Blocks that overlap, as of ranges and of angles, are one pass, and so are those that follow
    each other without a pause.

    Parameters
    ----------
    t : (R,), s
    who : (R,), the station, or whatever else passes are of
    block : (R,), 0 or more, the part of a file
    """
    out, last = np.zeros(len(t), dtype=np.int64), 0
    for one in dict.fromkeys(who.tolist()):
        own = np.flatnonzero(who == one)
        own = own[np.argsort(t[own], kind="stable")]
        times, blocks = t[own], block[own]
        ends = np.full(int(blocks.max()) + 1, -np.inf)
        np.maximum.at(ends, blocks, times)
        until = np.maximum.accumulate(ends[blocks])[:-1]  # of the blocks so far
        steps, apart = np.diff(times), times[1:] > until
        inside = steps[~apart & (steps > 0)]
        pause = apart & (steps > LONG * median(inside)) if len(inside) else np.zeros(len(steps), dtype=np.bool_)
        out[own] = last + 1 + np.concatenate([[0], np.cumsum((steps > GAP) | pause)])
        last = int(out[own[-1]])
    return out
