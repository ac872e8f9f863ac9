"""The animated orbit of a comparison."""

from __future__ import annotations

import numpy as np

from piazzi.evaluate.quantities import display_of, unit_of
from piazzi.present.colours import station_colour
from piazzi.present.figures.space import planes, position_columns
from piazzi.present.report.blocks import Orbit, Track
from piazzi.present.report.panels import sigmas_of
from piazzi.present.report.views import Views
from piazzi.present.stands import stands
from piazzi.problem.checks import Array


def orbits(views: Views, planet_radius: float | None) -> list[Orbit]:
    """Paths in the plane of two components of position, in space in all three, and close-ups."""
    if position_columns(views.comparison.problem) is None:
        return []
    found = planes(views.comparison.problem)
    return [orbit for plane in found for orbit in _plane(views, plane, planet_radius, named=len(found) > 1)]


def _plane(views: Views, columns: tuple[int, int], planet_radius: float | None, *, named: bool) -> list[Orbit]:
    """The paths and a close-up about the truth (else the first estimate) in one plane."""
    (i, j), model, thin = columns, views.comparison.problem.model, views.thin
    unit = unit_of(model.unit(model.names[c]) for c in columns)
    reference = views.truth if views.truth is not None else views.estimates[0].mean
    limits = _limits(reference[:, [i, j]], planet_radius)
    far, near, spread = [], [], []
    if views.truth is not None:
        zero = np.zeros(len(views.times))
        x, y = (thin.at_places(views.truth[:, c]) for c in columns)
        far.append(Track(x, y, "truth"))
        near.append(Track(zero, zero, "truth"))
    for key, (legend, e) in enumerate(zip(views.keys, views.estimates, strict=True)):
        sigma = sigmas_of(e)
        with np.errstate(divide="ignore", invalid="ignore"):
            rho = np.nan_to_num(e.covariance[:, i, j] / (sigma[:, i] * sigma[:, j]), nan=0.0, posinf=0.0, neginf=0.0)
        ellipse = [thin.at_places(v) for v in (sigma[:, i], sigma[:, j], np.clip(rho, -1, 1))]
        x, y = (thin.at_places(e.mean[:, c]) for c in columns)
        dx, dy = (thin.at_places(e.mean[:, c] - reference[:, c]) for c in columns)
        far.append(Track(x, y, legend.label, key, *ellipse))
        near.append(Track(dx, dy, legend.label, key, *ellipse))
        spread.append(float(np.nanmedian(sigma[:, [i, j]])) if np.isfinite(sigma[:, [i, j]]).any() else 0.0)
    names = (model.names[i], model.names[j])
    show, close = display_of(unit, [float(np.abs(limits).max())]), display_of(unit, [3 * s for s in spread])
    about = "truth" if views.truth is not None else views.keys[0].label
    plane = f", {names[0]} and {names[1]}" if named else ""
    labels = (f"{names[0]} - {about}", f"{names[1]} - {about}")
    position = model.group_indices["position"]
    stood = stands(views.comparison.problem, views.comparison.tracking)
    sites = [
        (name, station_colour(n), place[:, position.index(i)], place[:, position.index(j)])
        for n, (name, place) in enumerate(stood.items())
    ]
    path = f"{'Orbit' if planet_radius else 'Path'}{plane}"
    title = f"Close-up about {'the truth' if views.truth is not None else about}{plane}"
    return [
        Orbit(path, far, names, show, limits, planet_radius, note=_left_out(views), sites=sites),
        Orbit(title, near, labels, close, close=True),
    ]


def _left_out(views: Views) -> str:
    return "" if views.thin.size == 1 else f"{len(views.times):,} of {views.thin.count:,} epochs are drawn."


def _limits(path: Array, planet_radius: float | None) -> tuple[float, float, float, float]:
    """Left, right, bottom and top of what must be seen: the path without its wildest hundredth, and the planet."""
    good = path[np.isfinite(path).all(axis=1)]
    low, high = np.quantile(good, [0.005, 0.995], axis=0) if len(good) else (np.array([-1.0, -1.0]), np.array([1.0, 1.0]))
    radius = planet_radius or 0.0
    if radius:
        low, high = np.minimum(low, -radius), np.maximum(high, radius)
    margin = 0.08 * float((high - low).max()) or 0.1 * float(np.abs(high).max()) or 1.0
    return (float(low[0] - margin), float(high[0] + margin), float(low[1] - margin), float(high[1] + margin))
