"""What can be seen of the first state as measurements come in."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from piazzi.evaluate.observable import Observability
from piazzi.present.colours import DASHES
from piazzi.present.figures.style import MEASURED, STATIONS, plain, plain_ticks, time_axis
from piazzi.problem import epoch_of
from piazzi.problem.checks import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def singular_values(ax: Axes, found: Observability) -> Axes:
    """Singular values of the root of the Fisher information over time; at 1 measurements tell as much as the prior."""
    n = found.growth_values.shape[1]
    labels = ["best seen", *(f"direction {i}" for i in range(2, n)), "worst seen"][:n]
    _growing(ax, found, found.growth_values, labels)
    ax.set_ylabel("singular value [1/prior sigma]")
    return ax


def bound_sigmas(ax: Axes, found: Observability) -> Axes:
    """Cramer-Rao standard deviation of each value of the first state over time, in units of the prior's."""
    _growing(ax, found, found.growth_sigma / found.scale, [plain(name) for name in found.problem.model.names])
    ax.set_ylabel("Cramer-Rao sigma [prior sigma]")
    return ax


def _dash(i: int) -> Any:
    """Of the i-th line, where the colours begin anew."""
    dash = DASHES[i // len(STATIONS) % len(DASHES)]
    return (0, dash) if dash else "-"


def _growing(ax: Axes, found: Observability, values: Array, labels: Sequence[str]) -> None:
    time = time_axis(ax, found.growth_times, epoch_of(found.problem, found.tracking))
    shown = np.where(np.isfinite(values) & (values > 0), values, np.nan)
    for i, label in enumerate(labels):
        ax.plot(found.growth_times * time.factor, shown[:, i], color=STATIONS[i % len(STATIONS)], ls=_dash(i), label=label)
    ax.axhline(1, color=MEASURED, lw=0.9, ls=(0, (5, 3)), label="prior")
    if not np.isnan(shown).all():
        ax.set_yscale("log")
        low, high = ax.get_ylim()
        ax.set_ylim(max(low, 1e-6), min(high, 1e6))
        plain_ticks(ax)
