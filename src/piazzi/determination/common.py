"""Errors that the rows of a pass of a laser have in common, as unknowns beside the orbit.

A station's bias changes from pass to pass by more than its normal points scatter.  Rows that share it know less together than
as many that do not, and where nothing stands for it good passes look like outliers.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from piazzi.arrays import distinct, median
from piazzi.determination.analysis import Analysis, analysed
from piazzi.determination.departures import LEAST
from piazzi.determination.instruments import station_of
from piazzi.determination.passes import pass_of_rows
from piazzi.determination.sensing import Measured
from piazzi.determination.setup import Setup, renewed, scale_of
from piazzi.determination.unknowns import PASS, Asked, Estimated
from piazzi.estimate.chi_square import quantile
from piazzi.evaluate.information import NEGLIGIBLE
from piazzi.problem import Gaussian
from piazzi.problem.checks import Array

SURE = 0.999
FEWEST = 3  # rows of a pass that say something together
FAR = 5.0  # sigmas of a row from the median of its pass, beyond which it is an outlier
MEDIAN = np.pi / 2  # times the variance of a mean of normal values is that of their median
# m: short-term stability of 2 cm and long-term of 1 cm, which the ILRS asks of its stations (Pearlman et al. 2002, Adv. Space
# Res. 30, 135, and its performance report cards)
LASER = 0.022
MOST = 10.0 * LASER  # m: of the sigma of a bias, not of a fault
BISECTIONS = 40
BIASES = (
    f"a bias of each pass of a laser is estimated, before the measurements 0 +- {LASER:g} m "
    "(the stability that the ILRS asks of its stations, 2 cm from pass to pass and 1 cm in the long term)"
)


def pass_biases(seen: Measured, wanted: Sequence[Asked]) -> list[Asked]:
    """A bias for each pass of each laser whose ranges the user says nothing of.

    Residuals do not tell whether there are some: an arc of a few passes takes them up into the orbit, and what is left looks
    like noise.  So they are there before any residual is.
    """
    laser = np.array([segment.wavelength is not None for segment in seen.observations.segments], dtype=np.bool_)
    first = seen.rows[:, 0]
    own = (first >= 0) & laser[seen.observations.segment[np.maximum(first, 0)]]
    said = {named.casefold() for one in wanted if (named := station_of(one, "range")) is not None}
    labels = sorted({seen.labels[name] for name in seen.tracking.row_stations[own].tolist()})
    left = [label for label in labels if said.isdisjoint(("", label.casefold()))]
    return [Asked(Estimated(f"bias.range.{label}", PASS, LASER), "estimated", "--estimate") for label in left]


def with_wider_biases(given: Setup) -> Setup:
    """The set-up with wider priors for biases of stations that contradict the usual sigma: not all keep to it."""
    if BIASES not in given.assumed or not np.isfinite(given.states).all():
        return given
    seen = given.measured
    usual = [name for name, (_, prior) in seen.parameters.items() if name.startswith("range_bias") and _is_usual(prior)]
    wider = _wider(given, biases := _of_stations(seen, usual))
    if not wider:
        return given
    known = {name: wider[label] for label, names in biases.items() if label in wider for name in names}
    parameters = {**seen.parameters, **{name: ("estimated", Gaussian(0.0, sigma**2)) for name, sigma in known.items()}}
    told = ", ".join(f"{sigma:.2g} m at {label}" for label, sigma in wider.items())
    text = f"{BIASES}; +- {told}, where they are larger than that allows"
    found = renewed(given, replace(seen, parameters=parameters), given.chosen)
    return replace(found, assumed=tuple(text if one == BIASES else one for one in given.assumed))


def _is_usual(prior: Gaussian) -> bool:
    """Whether a bias has the sigma of `pass_biases`, and no user's."""
    return float(np.ravel(prior.covariance)[0]) == LASER**2


def _of_stations(seen: Measured, names: Sequence[str]) -> dict[str, list[str]]:
    """The biases of each station, by the label that people know it by."""
    out: dict[str, list[str]] = {}
    for name in names:
        label = next(seen.labels[s.name] for s in seen.stations if dict(s.numbers).get(f"is_{name}") == 1.0)
        out.setdefault(label, []).append(name)
    return out


def _wider(given: Setup, stations: Mapping[str, Sequence[str]]) -> dict[str, float]:
    """Sigmas (m) of the biases of those stations that show larger ones than `LASER`, by labels.

    Along the principal axes of what the measurements say of a station's biases they are independent, b of variance s: with a
    prior of variance v, b^2 / (s + v) is one on average, which gives v.  Larger ones than `MOST` are faults, not biases.
    """
    analysis, scale = analysed(given, given.states), scale_of(given, given.states[0])
    rows, names = _near_their_pass(given, analysis), given.problem.model.names
    root = analysis.information(rows, scale)
    size = np.abs(np.diag(root))
    if not size.min() > NEGLIGIBLE * size.max():
        return {}
    step, _ = analysis.toward(rows, root, scale)
    half = np.linalg.solve(root.T, np.diag(scale)).T  # P = half half^T
    out = {}
    for label, own in stations.items():
        at = [names.index(name) for name in own]
        off = (given.states[0] + scale * step)[at] / LASER
        share, axes = np.linalg.eigh(np.eye(len(at)) - (half[at] @ half[at].T) / LASER**2)
        told = share > LEAST
        squares, share = (axes.T @ off)[told] ** 2, share[told]
        if not told.any() or np.sum(squares / share) <= quantile(1.0 - (1.0 - SURE) / len(stations), int(told.sum())):
            continue
        b, s = squares / share**2, 1.0 / share - 1.0
        low, high = 1.0, (MOST / LASER) ** 2
        if np.mean(b / (s + high)) > 1.0:
            continue
        for _ in range(BISECTIONS):
            v = float(np.sqrt(low * high))
            low, high = (v, high) if np.mean(b / (s + v)) > 1.0 else (low, v)
        out[label] = LASER * float(np.sqrt(high))
    return out


def _near_their_pass(given: Setup, analysis: Analysis) -> Array:
    """Rows (J,) that are not far from the others of their pass, of passes long enough to tell."""
    passes = pass_of_rows(given.measured, given.tracking, given.rows)
    near = np.zeros(len(passes), dtype=np.bool_)
    for one in distinct(passes[passes > 0]):
        own = np.flatnonzero(passes == one)
        known = analysis.whitened[own]
        known = known[:, np.isfinite(known).sum(axis=0) >= FEWEST]
        if known.size:
            near[own] = (np.abs(known - np.nanmedian(known, axis=0)) < FAR).any(axis=1)
    return near


def together(given: Setup, analysis: Analysis, rows: Array) -> tuple[float, int] | None:
    """Sum of squares of what residuals of passes have in common, in sigma, and how many; None for no pass long enough.

    It is their median, so that outliers count as one row each.
    """
    passes = pass_of_rows(given.measured, given.tracking, given.rows)
    squares = []
    for one in distinct(passes[rows & (passes > 0)]):
        own = analysis.whitened[rows & (passes == one)]
        for column in own.T:
            known = column[np.isfinite(column)]
            if len(known) >= FEWEST:
                squares.append(median(known) ** 2 * len(known) / MEDIAN)
    return (float(np.sum(squares)), len(squares)) if squares else None
