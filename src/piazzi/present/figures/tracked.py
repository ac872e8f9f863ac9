"""When what was measured, by whom."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from piazzi.formats import Observations
from piazzi.present.colours import STATIONS
from piazzi.present.figures.style import RC, new_figure, plain, time_axis

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLUMNS = 1500  # instants nearer together than the width of the picture by this are one mark
MOST_LINES = 60


def schedule(ax: Axes, observations: Observations) -> Axes:
    """Marks over time, one line for each station (or object, where nobody is said to measure) and kind."""
    rows = observations[observations.measured] if observations.measured.any() else observations
    pairs = np.stack([np.where(rows.station >= 0, rows.station, rows.object), rows.kind], axis=1)
    lines = np.unique(pairs, axis=0)[:MOST_LINES]
    start = float(rows.t.min()) if len(rows) else 0.0
    ends = np.array([0.0, float(rows.t.max()) - start]) if len(rows) else np.zeros(0)
    begin = (rows.instant(int(np.argmin(rows.t))), rows.segments[0].scale) if len(rows) else (None, "")
    shown = time_axis(ax, ends, *begin)
    step = max(float(np.ptp(rows.t)) / COLUMNS, 1e-9) if len(rows) else 1.0
    names = []
    for y, (who, kind) in enumerate(lines.tolist()):
        own = rows.t[(pairs[:, 0] == who) & (pairs[:, 1] == kind)] - start
        marks = np.unique(np.round(own / step)) * step * shown.factor
        ax.plot(marks, np.full(len(marks), y), "|", color=STATIONS[kind % len(STATIONS)], markersize=9)
        name = f"{rows.participants[who]}, " if who >= 0 else ""
        names.append(plain(f"{name}{rows.kinds[kind].replace('_', ' ')}"))
    ax.set_yticks(range(len(names)), names)
    ax.set_ylim(len(names) - 0.5, -0.5)
    return ax


def schedule_page(observations: Observations, title: str) -> Figure:
    """The picture of when what was measured."""
    from matplotlib import rc_context

    style: Any = RC
    with rc_context(style):
        pairs = len(np.unique(np.stack([observations.station, observations.kind], axis=1), axis=0))
        figure = new_figure(10.5, 1.4 + 0.28 * min(pairs, MOST_LINES))
        schedule(figure.subplots(), observations)
        figure.suptitle(plain(title), fontsize=11, x=0.01, ha="left")
    return figure
