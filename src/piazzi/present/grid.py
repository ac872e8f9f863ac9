"""What is shown of a study against what was varied: errors, NEES and divergence, each with its spread over runs."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import isfinite, log10
from typing import Any, Literal

import numpy as np

from piazzi.evaluate.quantities import Display, number
from piazzi.present.study_table import group_display, ideal_nees
from piazzi.problem.checks import Array
from piazzi.study import Line, Summary
from piazzi.study.grid import numeric
from piazzi.study.variations import Value
from piazzi.text import printable

Spread = tuple[float, float, float]  # the value, and the ends of its spread
_DECADE = 20.0  # numbers that span more than this factor stand on a logarithmic axis
# Blues, and violet to brown, by Brewer: both are told apart with every colour vision
_SEQUENCE = ("#F7FBFF", "#DEEBF7", "#C6DBEF", "#9ECAE1", "#6BAED6", "#4292C6", "#2171B5", "#08519C", "#08306B")
_DIVERGING = ("#542788", "#8073AC", "#B2ABD2", "#D8DAEB", "#F7F7F7", "#FEE0B6", "#FDB863", "#E08214", "#B35806")


@dataclass(frozen=True, eq=False)
class Measure:
    """One number of a line with its spread over runs.

    Attributes
    ----------
    name : short, for headings
    label : of its axis, without the unit
    spread : what the spread is, in words
    of : the value and its spread, in SI units; None where there is none
    ideal : what it should be
    """

    name: str
    label: str
    spread: str
    show: Display
    scale: Literal["log", "linear"]
    of: Callable[[Line], Spread | None]
    ideal: float | None = None

    @property
    def heading(self) -> str:
        """The name with a capital letter."""
        return f"{self.name[:1].upper()}{self.name[1:]}"

    def text(self, value: float) -> str:
        """A value as it is shown."""
        return number(value * self.show.factor, 3) if isfinite(value) else "-"


def measures(summary: Summary) -> list[Measure]:
    """The error of each group of states, the mean NEES, and how often runs diverge."""
    stored = summary.stored
    out = [_error(group, group_display(stored, group)) for group in stored.groups]
    ideals = {line.history.ideal for line in summary.lines} - {None}
    one = ideals.pop() if len(ideals) == 1 else None
    nees = f"mean NEES, last half, {ideal_nees(summary.lines)}"
    out.append(Measure("NEES", nees, "5 to 95 % of runs", Display(""), "log", _nees, one))
    out.append(Measure("divergence", "runs that diverge", "95 % interval", Display("%", 100.0), "linear", _diverged))
    return out


def _error(group: str, show: Display) -> Measure:
    name = printable(group)

    def of(line: Line) -> Spread | None:
        found = line.rmse_last_half_quantiles[group]
        return None if found is None else (found[1], found[0], found[2])

    return Measure(f"{name} error", f"{name} error, last half, median", "5 to 95 % of runs", show, "log", of)


def _nees(line: Line) -> Spread | None:
    found = line.mean_nees_last_half_quantiles
    return None if found is None or line.mean_nees_last_half is None else (line.mean_nees_last_half, found[0], found[2])


def _diverged(line: Line) -> Spread | None:
    if line.diverged_interval is None:
        return None
    return (line.diverged / (line.runs - line.failed), *line.diverged_interval)


def spreads(measure: Measure, lines: Sequence[Line | None]) -> Array:
    """Values and ends of spreads, (3, V), NaN where there are none."""
    none = (np.nan, np.nan, np.nan)
    return np.array([none if line is None else measure.of(line) or none for line in lines]).T


@dataclass(frozen=True, eq=False)
class Scale:
    """Where the values of what is varied stand on an axis: numbers where they are, words side by side."""

    places: Array
    texts: tuple[str, ...]
    kind: Literal["log", "linear"]

    @classmethod
    def of(cls, values: Sequence[Value]) -> Scale:
        """The scale of these values."""
        texts = tuple(value_text(v) for v in values)
        if not numeric(values):
            return cls(np.arange(len(values), dtype=float), texts, "linear")
        places = np.array([float(v) for v in values])
        wide = bool((places > 0).all()) and places.max() > _DECADE * places.min()
        return cls(places, texts, "log" if wide else "linear")

    def beside(self, i: int, count: int) -> Array:
        """Places for the i-th of so many marks that would hide each other."""
        low, high = self.limits
        share = 0.012 * (i - 0.5 * (count - 1))
        return self.places * (high / low) ** share if self.kind == "log" else self.places + share * (high - low)

    @property
    def limits(self) -> tuple[float, float]:
        """Ends of the axis, with a margin."""
        low, high = float(self.places.min()), float(self.places.max())
        if self.kind == "log":
            margin = (high / low) ** 0.04 if high > low else 2.0
            return low / margin, high * margin
        margin = 0.04 * (high - low) or 0.5
        return low - margin, high + margin


def value_text(value: Any) -> str:
    """A value as it is written on the command line, short."""
    return f"{value:g}" if isinstance(value, float) else printable(str(value))


def where(at: Mapping[str, Value]) -> str:
    """Values of axes in words, "" for none."""
    return ", ".join(f"{printable(name)} = {value_text(value)}" for name, value in at.items())


def file_name(at: Mapping[str, Value]) -> str:
    """Values of axes as part of the name of a file."""
    return re.sub(r"[^\w.+=-]+", "-", "_".join(f"{name}={value_text(value)}" for name, value in at.items()))[:100]


def shares(measure: Measure, values: Array) -> Array:
    """Where each value is among them between the first colour and the last, 0 to 1; a NEES as it should be is in the middle."""
    with np.errstate(divide="ignore", invalid="ignore"):
        v = np.log10(values) if measure.scale == "log" else values
    v = np.where(np.isfinite(v), v, np.nan)
    if not np.isfinite(v).any():
        return v
    if measure.ideal is not None:
        off = v - log10(measure.ideal)
        return np.asarray(0.5 + 0.5 * off / max(float(np.nanmax(np.abs(off))), log10(2.0)))
    if measure.scale == "linear":
        return np.asarray(v / max(float(np.nanmax(v)), 0.1))
    low, high = float(np.nanmin(v)), float(np.nanmax(v))
    return np.asarray((v - low) / (high - low) if high > low else np.full(v.shape, 0.5))


def colour(measure: Measure, share: float) -> str:
    """The colour of a share; light grey where there is none."""
    if not isfinite(share):
        return "#DDDDDD"
    ramp = _SEQUENCE if measure.ideal is None else _DIVERGING
    at = min(max(share, 0.0), 1.0) * (len(ramp) - 1)
    i = min(int(at), len(ramp) - 2)
    return _between(ramp[i], ramp[i + 1], at - i)


def letters(background: str) -> str:
    """Black or white, whichever stands out."""
    r, g, b = (int(background[i : i + 2], 16) / 255 for i in (1, 3, 5))
    linear = [c / 12.92 if c <= 0.03928 else ((c + 0.055) / 1.055) ** 2.4 for c in (r, g, b)]
    return "#000000" if 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2] > 0.179 else "#FFFFFF"


def _between(a: str, b: str, share: float) -> str:
    pairs = ((int(a[i : i + 2], 16), int(b[i : i + 2], 16)) for i in (1, 3, 5))
    return "#" + "".join(f"{round(x + share * (y - x)):02X}" for x, y in pairs)
