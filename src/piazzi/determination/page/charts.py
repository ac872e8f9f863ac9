"""Residuals, how well the orbit is known, and what every pass added."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from piazzi.determination.page.sampled import Sampled
from piazzi.determination.passes import passes
from piazzi.determination.residuals import table
from piazzi.determination.setup import scale_of
from piazzi.evaluate.information import factor
from piazzi.evaluate.quantities import Display, display_of, fine, number
from piazzi.present.colours import station_colour
from piazzi.present.report.blocks import Axis, Chart, Line, Section
from piazzi.problem.checks import Array

RTN = (("R, along the radius", "#0072B2"), ("T, along the track", "#D55E00"), ("N, across the plane", "#009E73"))
WIDEST = 4.0  # times the typical residual: what is farther is drawn at the edge
_RESIDUALS = (
    "Observed minus computed at the answer, in the colour of the station. Crosses were not used, and are drawn at the edge"
    " where they lie beyond it; point at one for why. Numbers of each station stand in the table of residuals."
)
_KNOWN = "Standard deviations of the estimate along the axes of the orbit; while a station measures, the background is grey."
_GAINED = (
    "Bits by which each pass narrowed what all before it left open, and those that would be lost without it. A bit halves the"
    " volume of what is not known. It begins with an orbit uncertain by a tenth of distance and speed."
)


def residuals(found: Any, time: Axis) -> Section | None:
    """A chart for each kind; None where the fit gave nothing."""
    columns = table(found)
    if not np.isfinite(columns["o_minus_c"]).any():
        return None
    stations = {name: i for i, name in enumerate(dict.fromkeys(columns["station"].tolist()))}
    kinds = dict.fromkeys(zip(columns["component"].tolist(), columns["unit"].tolist(), strict=True))
    return Section("Residuals", [_kind(columns, kind, unit, stations, time) for kind, unit in kinds], _RESIDUALS)


def _kind(columns: dict[str, Array], kind: str, unit: str, stations: dict[str, int], time: Axis) -> Chart:
    own = columns["component"] == kind
    used = own & columns["used"] & np.isfinite(columns["o_minus_c"])
    left = own & ~columns["used"] & np.isfinite(columns["o_minus_c"])
    size = columns["o_minus_c"][used] if used.any() else columns["o_minus_c"][left]
    largest = float(np.abs(size).max()) if size.size else 1.0
    rms = float(np.sqrt(np.mean(size**2))) if size.size else 1.0
    half = 1.1 * max(min(largest, 20.0 * rms), min(WIDEST * rms, _largest(columns, left))) or 1.0
    show = fine(unit, rms)
    lines = [
        Line(*_values(columns, here), name, kind="points", colour=station_colour(index), notes=_notes(columns, here))
        for name, index in stations.items()
        if (here := np.flatnonzero(used & (columns["station"] == name))).size
    ]
    if left.any():
        here = np.flatnonzero(left)
        lines.append(Line(*_values(columns, here), "not used", kind="crosses", notes=_notes(columns, here)))
    words = kind.replace("_", " ")
    return Chart(f"Residuals of {words}", time, Axis(f"O-C of {words}", show, low=-half, high=half), lines)


def _values(columns: dict[str, Array], rows: Array) -> tuple[Array, Array]:
    return columns["t"][rows], columns["o_minus_c"][rows]


def _largest(columns: dict[str, Array], rows: Array) -> float:
    return float(np.abs(columns["o_minus_c"][rows]).max()) if rows.any() else 0.0


def _notes(columns: dict[str, Array], rows: Array) -> list[str]:
    """How many sigma each is, and why it was not used."""
    out = []
    for i in rows.tolist():
        sigmas = f"{number(float(columns['whitened'][i]), 3)} sigma"
        out.append(sigmas if columns["used"][i] else f"{sigmas}, {columns['station'][i]}: {columns['reason'][i]}")
    return out


def known(path: Sampled, time: Axis, shades: Array) -> Section | None:
    """Sigma along R, T, N of position and of velocity."""
    sigmas = path.sigmas
    if not (np.isfinite(sigmas) & (sigmas > 0)).any():
        return None
    charts = []
    for what, unit, part in (("position", "m", sigmas[:, :3]), ("velocity", "m/s", sigmas[:, 3:])):
        typical = float(np.nanmedian(part))
        show = Display("mm/s", 1e3) if unit == "m/s" and typical < 0.1 else display_of(unit, [typical])
        lines = [Line(path.times, part[:, i], label, colour=colour) for i, (label, colour) in enumerate(RTN)]
        charts.append(Chart(f"Sigma of {what}", time, Axis(f"sigma of {what}", show, "log"), lines, shades=shades))
    return Section("How well it is known", charts, _KNOWN)


def spans(passes: Sequence[tuple[str, Array]], columns: dict[str, Array]) -> Array:
    """First and last time (S, 2) of passes."""
    return np.array([[columns["t"][rows].min(), columns["t"][rows].max()] for _, rows in passes]).reshape(-1, 2)


def passes_of(found: Any, columns: dict[str, Array]) -> list[tuple[str, Array]]:
    """Station and entries of every pass, those that the verdict counts, in the order of their beginnings."""
    row = np.nonzero(found.setup.rows >= 0)[0]  # of the tracking, of every entry
    every = [np.flatnonzero(np.isin(row, own)) for own in passes(found.setup, np.ones(len(found.setup.rows), dtype=bool))]
    return [(str(columns["station"][own[0]]), own) for own in every if len(own)]


def gained(found: Any, passes: Sequence[tuple[str, Array]], columns: dict[str, Array]) -> Section | None:
    """Bits that every pass brought, and those that would be missed; None for fewer than two passes."""
    if found.analysis is None or not 2 <= len(passes) <= 400:
        return None
    scale = scale_of(found.setup, found.setup.states[0])
    rows = np.nonzero(found.setup.rows >= 0)[0]  # row of the tracking of every entry
    n = len(scale)
    before, total = np.eye(n), np.eye(n)
    parts = []
    for _, entries in passes:
        own = np.unique(rows[entries])
        own = own[found.keep[own]]
        H = np.nan_to_num(found.analysis.rows[own]).reshape(-1, n) * scale
        parts.append(H)
        total = factor(np.vstack([total, H]))
    bits, missed = [], []
    for i, H in enumerate(parts):
        after = factor(np.vstack([before, H]))
        bits.append(_bits(after) - _bits(before))
        others = factor(np.vstack([np.eye(n), *parts[:i], *parts[i + 1 :]]))
        missed.append(_bits(total) - _bits(others))
        before = after
    order = np.arange(1.0, len(parts) + 1.0)
    notes = [f"{name}, {len(entries):,} measurements" for name, entries in passes]
    brought = Line(order, np.array(bits), "brought when it came", kind="bars", colour="#0072B2", notes=notes)
    lost = Line(order, np.array(missed), "lost without it", kind="points", colour="#D55E00", notes=notes)
    y = Axis("information", Display("bits"), low=0.0, high=1.08 * float(max(*bits, *missed)))
    chart = Chart("Information by pass", Axis("pass", Display("")), y, [brought, lost], time=False)
    return Section("What every pass added", [chart], _GAINED)


def _bits(root: Array) -> float:
    """Half the logarithm of the determinant of the information that has this root."""
    return float(np.log2(np.abs(np.diag(root))).sum())
