"""How far two orbits are apart, over time."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from piazzi.evaluate.quantities import display_of
from piazzi.orbit.difference import Difference
from piazzi.present.colours import STATIONS
from piazzi.present.figures.style import RC, new_figure, plain, time_axis

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def difference_track(ax: Axes, found: Difference, axis: int) -> Axes:
    """The difference along one axis, with three sigma of both covariances where there are any."""
    hours = found.t * time_axis(ax, found.t, found.epoch).factor
    shown = display_of("m", [float(np.abs(found.position).max())])
    three = 3.0 * found.sigma[:, axis] * shown.factor
    if np.isfinite(three).any():
        ax.fill_between(hours, -three, three, color=STATIONS[axis], alpha=0.15, linewidth=0, label="3 sigma")
    ax.plot(hours, found.position[:, axis] * shown.factor, color=STATIONS[axis], marker="." if len(hours) < 400 else "")
    ax.set_ylabel(f"{found.letters[axis]} [{shown.unit}]")
    if axis == 0 and np.isfinite(three).any():
        ax.legend(loc="upper right")
    return ax


def difference_page(found: Difference, title: str = "") -> Figure:
    """A picture with the three axes below one another."""
    from matplotlib import rc_context

    style: Any = RC
    with rc_context(style):
        figure = new_figure(9.0, 6.0)
        tracks = figure.subplots(3, 1, sharex=True)
        for axis in range(3):
            difference_track(tracks[axis], found, axis).label_outer()
        figure.suptitle(plain(title or f"{found.names[1]} minus {found.names[0]}"), fontsize=11, x=0.01, ha="left")
    return figure
