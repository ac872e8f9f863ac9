"""Results that draw and write themselves by what comes after them in the flow, which is loaded when it is asked for."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def later(module: str, name: str) -> Any:
    """A function of a module that comes later in the flow."""
    return getattr(import_module(f"piazzi.{module}"), name)


class Shown:
    """Something that a notebook shows as a table."""

    def _repr_html_(self) -> str:
        return str(later("present.shown", "html")(self))


class Drawn(Shown):
    """Something with a picture."""

    def plot(self, ax: Axes | None = None, **options: Any) -> Axes:
        """Draw it on these axes, or on new ones; returns them.

        Parameters
        ----------
        ax : matplotlib Axes
        options : what to draw: ``problem`` and ``component`` of a `Tracking`, ``state`` of an `Estimate`, ``group`` of a
            `Comparison`, a `WindowTrade` or a study, ``against`` (what was varied) and ``measure`` of a study

        Raises
        ------
        ValueError
            For a state, a group or a component that there is not.
        """
        drawn: Axes = later("present.plots", "plot")(self, ax, **options)
        return drawn

    def to_latex(self) -> str:
        """Its tables as LaTeX (booktabs), values rounded by their sigmas."""
        return str(later("present.shown", "latex")(self))
