"""Axes of time with dates.  Loads matplotlib, so it is imported where something is drawn."""

from __future__ import annotations

from typing import Any

from matplotlib.axes import Axes
from matplotlib.ticker import FixedFormatter, Locator

from piazzi.earth.epoch import Epoch
from piazzi.present.dates import Calendar

_ROOM = 0.75  # inches for a mark


class _Round(Locator):
    """Marks at round readings of a clock; hands their words to a formatter."""

    def __init__(self, calendar: Calendar, factor: float, words: FixedFormatter) -> None:
        self._calendar, self._factor, self._words = calendar, factor, words

    def __call__(self) -> Any:
        assert self.axis is not None
        return self.tick_values(*sorted(self.axis.get_view_interval()))

    def tick_values(self, vmin: float, vmax: float) -> Any:
        axes: Any = getattr(self.axis, "axes", None)
        wide = 5.0 if axes is None else axes.bbox.width / axes.figure.dpi
        marks = self._calendar.ticks(vmin / self._factor, vmax / self._factor, max(2, int(wide / _ROOM)))
        self._words.seq = [f"{mark.text}\n{mark.below}" if mark.below else mark.text for mark in marks]
        return [mark.t * self._factor for mark in marks]


def date_axis(ax: Axes, epoch: Epoch, factor: float, scale: str = "") -> None:
    """Dates on the axis of time, where x is `factor` times seconds past the epoch."""
    calendar, words = Calendar(epoch, scale), FixedFormatter([])
    ax.xaxis.set_major_locator(_Round(calendar, factor, words))
    ax.xaxis.set_major_formatter(words)
    ax.set_xlabel(calendar.label)
