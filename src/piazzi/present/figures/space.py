"""The path in space."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from itertools import combinations
from typing import TYPE_CHECKING, Any

import numpy as np

from piazzi.estimate.estimator import Estimate
from piazzi.evaluate.metrics import known_truth
from piazzi.evaluate.quantities import Display, display_of, unit_of
from piazzi.present.colours import station_colour
from piazzi.present.figures.style import PLANET, TRUTH, drawn, label_of, line_of, plain, shade_of
from piazzi.present.stands import stands
from piazzi.problem import Problem
from piazzi.problem.checks import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.patches import Ellipse

SIGMAS = 3.0
LONG = 5.0  # usual steps of time without an epoch
MARKS = "osD^vP*X"
_TURN = np.linspace(0.0, 2 * np.pi, 181)
UNIT_CIRCLE = np.column_stack([np.cos(_TURN), np.sin(_TURN)])


def position_columns(problem: Problem) -> tuple[int, int] | None:
    """Columns of the first two components of the group "position", None where there are not two."""
    found = problem.model.group_indices.get("position", ())
    return (found[0], found[1]) if len(found) > 1 else None


def planes(problem: Problem) -> list[tuple[int, int]]:
    """Pairs of columns of the group "position" that together show it: one in a plane, three in space."""
    found = problem.model.group_indices.get("position", ())[:3]
    return list(combinations(found, 2))


def orbit(
    ax: Axes,
    estimate: Estimate,
    *,
    name: str = "estimate",
    planet_radius: float | None = None,
    ellipses: int = 9,
    plane: tuple[int, int] | None = None,
) -> Axes:
    """Estimated path and truth in a plane, the planet to scale, the stations, and 3-sigma ellipses.

    Seen from outside: in space, what is behind the planet is dotted.

    Parameters
    ----------
    plane : two columns of the state; else the first two components of position

    Raises
    ------
    ValueError
        Where the model has no group "position" with two states.
    """
    from matplotlib.patches import Circle

    i, j = plane or _columns(estimate.problem)
    truth, path = known_truth(estimate), estimate.mean[:, [i, j]]
    show = _unit(estimate.problem, path if truth is None else truth[:, [i, j]])
    if planet_radius:
        disc = Circle((0, 0), planet_radius * show.factor, color=PLANET, lw=0, zorder=0.5, label="central body, to scale")
        ax.add_patch(disc)
    part, cut = drawn(len(path)), _cut(estimate.times)
    hidden = _behind(estimate, (i, j), planet_radius)
    for dots, alpha in ((":", 0.5), ("-", 1.0)) if hidden.any() else (("-", 1.0),):
        seen = cut(np.where((hidden == (dots == ":"))[:, None], path, np.nan)[part])
        label = label_of(name, estimate.view) if dots == "-" else None
        ax.plot(*(seen.T * show.factor), **line_of(name, "") | {"linestyle": dots}, lw=1.8, alpha=alpha, label=label, zorder=2)
    if truth is not None:  # thin, on top: two lines that coincide are both seen
        ax.plot(*(cut(truth[part][:, [i, j]]).T * show.factor), color=TRUTH, lw=0.8, ls=(0, (4, 3)), label="truth", zorder=3)
    _stations(ax, estimate, (i, j), show)
    reference = path if truth is None else truth[:, [i, j]]
    extent = _extent(reference, planet_radius) * show.factor
    drawn_ellipses = _ellipses(estimate, (i, j), show, ellipses, largest=float(np.max(extent[1] - extent[0])))
    for n, patch in enumerate(drawn_ellipses):
        patch.set(
            facecolor=(*_rgb(name), 0.13), edgecolor=_rgb(name), lw=0.9, zorder=2.5, label="3-sigma ellipse" if not n else None
        )
        ax.add_patch(patch)
    _frame(ax, extent, drawn_ellipses)
    return _labelled(ax, estimate.problem, (i, j), show)


def _cut(times: Array) -> Callable[[Array], Array]:
    """What leaves a gap in a path where there were no epochs for long, as between passes: a chord would be no path."""
    steps = np.diff(times[drawn(len(times))])
    ends: Array = np.flatnonzero(steps > LONG * np.median(steps)) + 1 if len(steps) else np.array([], dtype=int)

    def cut(path: Array) -> Array:
        return np.insert(path, ends, np.nan, axis=0)

    return cut


def _behind(estimate: Estimate, plane: tuple[int, int], radius: float | None) -> Array:
    """Which epochs are behind the planet, seen in a plane with its two axes to the right and up."""
    found = estimate.problem.model.group_indices.get("position", ())[:3]
    if not radius or len(found) < 3:
        return np.zeros(len(estimate.mean), dtype=bool)
    (third,) = {*found} - {*plane}
    towards = -1.0 if plane == (found[0], found[2]) else 1.0  # the axes are right-handed
    across, deep = np.hypot(*estimate.mean[:, list(plane)].T), towards * estimate.mean[:, third]
    return np.asarray((across < radius) & (deep < 0.0))


def _stations(ax: Axes, estimate: Estimate, plane: tuple[int, int], show: Display) -> None:
    """Stations where they stand; those that turn with the Earth where they measured."""
    found = stands(estimate.problem, estimate.tracking)
    at = [estimate.problem.model.group_indices["position"].index(c) for c in plane]
    for n, (name, place) in enumerate(found.items()):
        x, y = place[:, at].T * show.factor
        label = f"{'stations' if len(found) > 1 else f'station {plain(name)}'}{', where they measured' if len(x) > 1 else ''}"
        style: dict[str, Any] = {"color": station_colour(n), "zorder": 4, "label": label if not n else None}
        if len(x) == 1:
            ax.plot(x, y, "^", ms=7, mec="white", mew=0.8, **style)
        else:
            ax.plot(x, y, ".", ms=3, **style)


def path_beside_truth(ax: Axes, path: Array, truth: Array, *, name: str = "estimate", unit: str = "m") -> Axes:
    """A path (K, 2) and the true one in the plane, of whatever origin: the founding paper's two figures of accuracy."""
    show = display_of(unit, [float(np.nanmax(np.abs(truth), initial=0.0))])
    part = drawn(len(path))
    ax.plot(*(path[part].T * show.factor), color=shade_of(name), lw=1.4, label=f"estimate, {plain(name)}")
    ax.plot(*(truth[part].T * show.factor), color=TRUTH, ls="--", lw=1.2, label="truth")
    extent = _extent(np.concatenate([path, truth]), None) * show.factor
    _frame(ax, extent, [])
    ax.set_xlabel(show.label("x"))
    ax.set_ylabel(show.label("y"))
    return ax


def position_at(ax: Axes, estimates: Mapping[tuple[str, str], Estimate]) -> Axes:
    """Where each estimator puts the object at the last epoch, from the truth (else the first of them), with 3-sigma ellipses.

    Parameters
    ----------
    estimates : mapping of (name, view) to Estimate
    """
    found = {key: e for key, e in estimates.items() if np.isfinite(e.mean[-1]).all() and np.isfinite(e.covariance[-1]).all()}
    first = next(iter(estimates.values()))
    i, j = _columns(first.problem)
    truth = known_truth(first)
    known = truth is not None and bool(np.isfinite(truth[-1, [i, j]]).all())
    origin = truth[-1, [i, j]] if truth is not None and known else next(iter(found.values()), first).mean[-1, [i, j]]
    sigma = [SIGMAS * np.sqrt(np.diagonal(e.covariance[-1])[[i, j]].max()) for e in found.values()]
    show = display_of(_unit_name(first.problem), sigma)
    names = tuple(name for name, _ in found)
    for n, ((name, view), e) in enumerate(found.items()):
        style = line_of(name, view, names)
        turns = (6 * n, (6, 6 * len(found) - 6)) if len(found) > 1 else "-"  # lines that coincide take turns
        patch = _ellipse(e.mean[-1, [i, j]] - origin, e.covariance[-1][np.ix_([i, j], [i, j])], show)
        patch.set(fill=False, edgecolor=style["color"], linestyle=turns, lw=2.0)
        ax.add_patch(patch)
        ax.plot(*patch.get_patch_transform().transform(UNIT_CIRCLE).T, color=style["color"], lw=0.6)
        mark = {"marker": MARKS[n % len(MARKS)], "mfc": "none", "mew": 1.4, "ms": 7, "color": style["color"]}
        ax.plot(*((e.mean[-1, [i, j]] - origin) * show.factor), **mark, ls="none")
        ax.plot([], [], **(style | mark), lw=1.6, label=label_of(name, view))
    if known:
        ax.plot(0, 0, "+", ms=12, mew=2, color=TRUTH, label="truth", zorder=4)
    ax.autoscale_view()
    ax.margins(0.12)
    ax.set_aspect("equal", adjustable="datalim")
    names_of_states = first.names
    against = "truth" if known else "first estimate"
    ax.set_xlabel(show.label(plain(f"{names_of_states[i]} - {against}")))
    ax.set_ylabel(show.label(plain(f"{names_of_states[j]} - {against}")))
    when = f"t = {first.times[-1]:g} s" if first.epoch is None else (first.epoch + float(first.times[-1])).rounded(0)
    ax.set_title(f"3-sigma ellipses at {when}")
    return ax


def _columns(problem: Problem) -> tuple[int, int]:
    found = position_columns(problem)
    if found is None:
        raise ValueError('an orbit needs a group "position" of two states or more: Model(groups={"position": ["x", "y"]})')
    return found


def _unit_name(problem: Problem) -> str:
    return unit_of(problem.model.unit(problem.model.names[c]) for c in _columns(problem))


def _unit(problem: Problem, path: Array) -> Display:
    return display_of(
        _unit_name(problem), [float(v) for v in np.abs(path[np.isfinite(path)]).max(initial=0.0, keepdims=True).ravel()]
    )


def _rgb(name: str) -> tuple[float, float, float]:
    from matplotlib.colors import to_rgb

    return to_rgb(line_of(name, "")["color"])


def _extent(path: Array, planet_radius: float | None) -> Array:
    """Lower and upper corner of what must be seen: the path, without its wildest hundredth, and the planet."""
    good = path[np.isfinite(path).all(axis=1)]
    corners = np.quantile(good, [0.005, 0.995], axis=0) if len(good) else np.array([[-1.0, -1.0], [1.0, 1.0]])
    radius = planet_radius or 0.0
    return np.array([np.minimum(corners[0], -radius), np.maximum(corners[1], radius)]) if radius else corners


def path_shape(estimate: Estimate, planet_radius: float | None) -> float:
    """Width of a path in its plane over its height, no more than a factor of 2.5 either way."""
    columns, truth = list(_columns(estimate.problem)), known_truth(estimate)
    low, high = _extent((estimate.mean if truth is None else truth)[:, columns], planet_radius)
    wide, tall = np.maximum(high - low, 1e-12)
    return float(np.clip(wide / tall, 0.4, 2.5))


def _ellipses(estimate: Estimate, columns: tuple[int, int], show: Display, count: int, largest: float) -> list[Ellipse]:
    """Ellipses at evenly spaced epochs, the first and last included; those larger than the whole picture say nothing."""
    K = len(estimate.mean)
    out = []
    for k in dict.fromkeys(np.linspace(0, K - 1, min(count, K)).astype(int).tolist()):
        mean, P = estimate.mean[k, list(columns)], estimate.covariance[k][np.ix_(columns, columns)]
        if np.isfinite(mean).all() and np.isfinite(P).all():
            patch = _ellipse(mean, P, show)
            if max(patch.width, patch.height) <= max(largest, 1e-300):
                out.append(patch)
    return out


def _ellipse(mean: Array, P: Array, show: Display) -> Ellipse:
    from matplotlib.patches import Ellipse

    values, vectors = np.linalg.eigh(P)
    axes = 2 * SIGMAS * np.sqrt(np.maximum(values, 0.0)) * show.factor
    return Ellipse(
        tuple(mean * show.factor), axes[1], axes[0], angle=float(np.degrees(np.arctan2(vectors[1, 1], vectors[0, 1])))
    )


def _frame(ax: Axes, extent: Array, patches: list[Ellipse]) -> None:
    """Limits that hold the path and every ellipse whole."""
    low, high = extent.copy()
    for patch in patches:
        corners = patch.get_path().transformed(patch.get_patch_transform()).get_extents()
        low, high = np.minimum(low, corners.min), np.maximum(high, corners.max)
    margin = 0.05 * np.maximum(high - low, 1e-12 + 1e-6 * np.abs(high)).max()
    ax.set_xlim(low[0] - margin, high[0] + margin)
    ax.set_ylim(low[1] - margin, high[1] + margin)
    ax.set_aspect("equal", adjustable="box")


def _labelled(ax: Axes, problem: Problem, columns: tuple[int, int], show: Display) -> Axes:
    from matplotlib.ticker import MaxNLocator

    ax.xaxis.set_major_locator(MaxNLocator(5))
    ax.set_xlabel(show.label(plain(problem.model.names[columns[0]])))
    ax.set_ylabel(show.label(plain(problem.model.names[columns[1]])))
    return ax
