"""Which rows are believed: tested by what the others say of them, decided anew until nothing changes.

A row's residual is compared with what it should be like: R - H P H^T of a row that was used, whose residual the fit has made
smaller, R + H P H^T of one that was not (Carpino, Milani and Chesley 2003, Icarus 166, 248).  Of right rows one in fifty lies
beyond a chi-square of 8, and an orbit without them errs by more than its covariance says, a seventh of the squares.  So
the gate is wider where so few rows are beyond it that chance explains them: at most one in twenty of those that are left out
is right (Benjamini and Hochberg 1995, J. R. Stat. Soc. B 57, 289).
"""

from __future__ import annotations

from math import exp

import numpy as np

from piazzi.arrays import median
from piazzi.determination.analysis import Analysis
from piazzi.determination.faults import CORRELATED, DUPLICATE, OUTLIER, STATION
from piazzi.determination.passes import labels_of, passes
from piazzi.determination.setup import Setup, scale_of
from piazzi.estimate.chi_square import cdf, quantile
from piazzi.problem.checks import Array

OUT, BACK = exp(-4.0), exp(0.5)  # probability beyond a chi-square of 8 with two degrees of freedom; and times that beyond 7
GATES = OUT * 0.5 ** np.arange(31)
CHANCE = 0.05  # of the rows beyond the gate, that may be right
SPARE = 8  # values beyond the unknowns, below which nothing is left out
ROUNDS = 20
MOST = 0.2  # of the rows: so many are not left out
FLOOR = 1e-6  # of a variance: a row that alone determines something has no residual
FEW = 1.0 / 3.0  # of the passes: so many may be left out as a whole


def edited(given: Setup, analysis: Analysis, keep: Array | None = None) -> tuple[Array, Array]:
    """Which rows (J,) to keep, and why not the others, "" for those that are kept.

    Parameters
    ----------
    given, analysis : the set-up, and residuals with derivatives near the answer
    keep : those that were kept so far; default all but duplicates
    """
    reasons = np.full(len(given.rows), "", dtype=np.object_)
    there = np.isfinite(analysis.whitened)
    some = there.any(axis=1)
    twice = duplicates(given)
    repeated = twice if given.spare is None else twice | given.spare
    keep = ~repeated if keep is None else keep & ~repeated
    if given.problem.is_noise_free and there[keep].sum() >= given.problem.model.n + SPARE:
        keep = _settled(given, analysis, keep, repeated, there)
    labels = labels_of(given)
    reasons[some & ~keep] = OUTLIER
    for label in dict.fromkeys(labels[some & ~keep].tolist()):
        own = (labels == label) & some & ~repeated
        if not keep[own].any() and own.sum() > 1:
            reasons[own] = STATION
    reasons[repeated] = CORRELATED
    reasons[twice] = DUPLICATE
    odd = reasons == OUTLIER
    every = passes(given, some & ~repeated)
    whole = [rows for rows in every if len(rows) > 1 and odd[rows].all()]
    single = odd.copy()
    if len(whole) <= FEW * len(every):  # a pass is one mistake, not as many as it has rows
        single[[row for rows in whole for row in rows]] = False
    if single.sum() > MOST * (some & ~repeated).sum():  # so many are no outliers: the model does not hold, as the verdict says
        keep = keep | odd
        reasons[odd] = ""
    return keep, reasons


def _settled(given: Setup, analysis: Analysis, keep: Array, repeated: Array, there: Array) -> Array:
    """The rows that are kept when nothing changes any more, or after `ROUNDS`."""
    unit = scale_of(given, given.states[0])
    degrees = there.sum(axis=1)
    wide = np.inf
    for _ in range(ROUNDS):
        squared = _squared(analysis, keep, unit, there)
        own = squared[keep & (degrees > 0)] / degrees[keep & (degrees > 0)]
        middle = median(own) / 0.4549 if own.size else 1.0  # of a chi-square with one degree of freedom
        wide = min(wide, max(1.0, middle))
        usual = min(1.0, median((squared / _beyond(0.5, degrees))[keep & (degrees > 0)])) if own.size else 1.0
        gate = _gate(squared[~repeated] / wide, degrees[~repeated], usual)
        out, back = (_beyond(p, degrees) * wide for p in (gate, BACK * gate))
        new = np.where(keep, squared <= out, squared < back) & ~repeated
        if (new == keep).all() or there[new].sum() < given.problem.model.n + SPARE:
            break
        keep = new
    return keep


def _gate(squared: Array, degrees: Array, usual: float) -> float:
    """The probability at the gate: the largest at which chance puts few of the rows beyond it there.

    Chance is of residuals as large as the `usual` ones are, in units of their sigmas squared: where sigmas are cautious, a row
    beyond the gate is hardly there by chance.
    """
    sizes, counts = np.unique(degrees[degrees > 0], return_counts=True)
    for gate in map(float, GATES):
        edges = [quantile(1.0 - gate, int(m)) / usual for m in sizes]
        chance = sum(n * (1.0 - cdf(edge, int(m))) for n, m, edge in zip(counts.tolist(), sizes, edges, strict=True))
        if np.sum(squared > _beyond(gate, degrees)) * CHANCE >= chance:
            return gate
    return float(GATES[-1])


def _beyond(probability: float, degrees: Array) -> Array:
    """The chi-square that is exceeded with it, of each number of degrees of freedom."""
    return np.array([np.inf] + [quantile(1.0 - probability, m) for m in range(1, int(degrees.max(initial=0)) + 1)])[degrees]


def _squared(analysis: Analysis, keep: Array, unit: Array, there: Array) -> Array:
    """Squares (J,) of residuals after a fit of the rows to keep, in units of what they should be like."""
    _, m, n = analysis.rows.shape
    rows = np.nan_to_num(analysis.rows) * unit
    w = np.nan_to_num(analysis.whitened)
    A = np.vstack([rows[keep].reshape(-1, n), analysis.prior * unit])
    b = np.concatenate([w[keep].reshape(-1), analysis.prior_miss])
    step = np.linalg.lstsq(A, b, rcond=None)[0]
    left = w - rows @ step
    root: Array = np.asarray(np.linalg.qr(A, mode="r"))
    if np.abs(np.diag(root)).min() <= 1e-12 * np.abs(np.diag(root)).max():
        return np.asarray((left**2).sum(axis=1))
    spread = analysis.leverage(root, unit)
    expected = np.eye(m) + np.where(keep[:, None, None], -spread, spread)
    values, vectors = np.linalg.eigh(np.where(there[:, :, None] & there[:, None, :], expected, np.eye(m)))
    turned = np.einsum("jik,ji->jk", vectors, np.where(there, left, 0.0))
    return np.asarray((turned**2 / np.maximum(values, FLOOR)).sum(axis=1))


def duplicates(given: Setup) -> Array:
    """(J,) rows that say the same as one before: of the same time, station and values."""
    tracking = given.tracking
    which = given.tracking.stations_of(given.problem)
    labels = [given.measured.labels[given.problem.stations[s].name] for s in which]
    seen: set[tuple[object, ...]] = set()
    out = np.zeros(len(given.rows), dtype=np.bool_)
    sensors = [given.problem.stations[s].sensor for s in which]
    values = np.nan_to_num(tracking.values, nan=-1.25e300)
    for i, t in enumerate(tracking.row_times.tolist()):
        key = (t, labels[i], sensors[i], *values[i].tolist())
        out[i] = key in seen and bool((given.rows[i] >= 0).any())
        seen.add(key)
    return out
