"""Tests of consistency on arrays: does a covariance admit the errors, are innovations white and without bias.

Every function takes plain arrays, so that one run, many runs and studies use the same ones.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from piazzi.estimate.chi_square import quantile
from piazzi.problem.checks import Array

PROBABILITY = 0.95  # of a matched run to pass a test
LAGS = 10  # of the whiteness test, fewer in short runs
_SHORTEST = 10  # values below which a series says nothing about its whiteness


@dataclass(frozen=True)
class Check:
    """One test: a statistic, and the bounds within which a matched run keeps it with probability 0.95.

    Attributes
    ----------
    statistic : float
    low, high : float, the bounds; `low` is zero where only large values speak against the model
    effective : how many independent values the statistic is worth
    """

    statistic: float
    low: float
    high: float
    effective: float

    @property
    def passed(self) -> bool:
        """Whether the statistic is within its bounds; False where it is not finite."""
        return bool(self.low <= self.statistic <= self.high)


def chi_square_check(total: float, mean: float, variance: float, count: float) -> Check:
    """Two-sided test of a sum of `count` correlated chi-square values by its average.

    The sum is taken as a chi-square variable times a factor, with the mean and the variance that the sum has where the model
    holds (Satterthwaite, Biometrics Bulletin 2, 1946); exact for independent values.
    """
    factor, freedom = variance / (2 * mean), 2 * mean**2 / variance
    tail = 0.5 * (1 - PROBABILITY)
    low, high = (factor * quantile(p, freedom) / count for p in (tail, 1 - tail))
    return Check(total / count, low, high, count * 2 * mean / variance)


def nees_check(value: Array, rank: Array, correlation: Array) -> Check | None:
    """Test of the mean NEES of one run, None where no error is known.

    Parameters
    ----------
    value, rank : (K,), NEES of every epoch and how many directions it sums over, zero where it is not known
    correlation : (K - 1, n, n)
        Correlation R of each epoch's whitened error with the next, as the model implies it; errors of a chain of states form a
        Markov chain, so that those of epochs j < k correlate as R[j] ... R[k-1], and their NEES covary as twice its square.
    """
    known = rank > 0
    if not known.any():
        return None
    mean = float(rank.sum())
    variance = 2 * (mean + 2 * paired(correlation, known.astype(float)))
    return chi_square_check(float(value[known].sum()), mean, variance, int(known.sum()))


def nis_check(whitened: Array, rows: int) -> Check | None:
    """Test of the mean NIS per row; innovations of different epochs are independent where the model holds.

    Parameters
    ----------
    whitened : standardised innovations of any shape, NaN where missing
    rows : number of rows of measurements that they come from
    """
    there = whitened[~np.isnan(whitened)]
    if not there.size or not rows:
        return None
    return chi_square_check(float(there @ there), there.size, 2.0 * there.size, rows)


def whiteness_check(series: Sequence[Array]) -> Check | None:
    """Test that standardised innovations of one epoch do not tell those of the next, up to `LAGS` of them.

    Ljung and Box, Biometrika 65(2), 1978, summed over series (one for each component of each station); the mean is taken as
    zero, which innovations have, and missing values are left out pair by pair.  None where no series is long enough.

    Parameters
    ----------
    series : arrays (N,), NaN where missing
    """
    total, freedom = 0.0, 0
    for w in series:
        found, count = _ljung_box(w)
        total, freedom = total + found, freedom + count
    return Check(total, 0.0, quantile(PROBABILITY, freedom), freedom) if freedom else None


def _ljung_box(w: Array) -> tuple[float, int]:
    """The statistic and its degrees of freedom, zero for a series that is too short."""
    there = ~np.isnan(w)
    N = int(there.sum())
    if N < _SHORTEST:
        return 0.0, 0
    w = np.where(there, w, 0.0)
    power, total, freedom = float(w @ w) / N, 0.0, 0
    for lag in range(1, min(LAGS, N // 5) + 1):
        pairs = int((there[lag:] & there[:-lag]).sum())
        if pairs >= _SHORTEST // 2 and power > 0:
            r = float(w[lag:] @ w[:-lag]) / (pairs * power)
            total += (N + 2) / N * pairs * r * r
            freedom += 1
    return total, freedom


def bias_check(series: Sequence[Array]) -> Check | None:
    """Test that standardised innovations have mean zero, whatever their size: the sum of N mean^2 / power over series."""
    total, freedom = 0.0, 0
    for w in series:
        there = w[~np.isnan(w)]
        power = float(there @ there)
        if len(there) >= _SHORTEST and power > 0:
            total += float(there.sum()) ** 2 / power
            freedom += 1
    return Check(total, 0.0, quantile(PROBABILITY, freedom), freedom) if freedom else None


def epoch_bounds(rank: Array, runs: int = 1, probability: float = PROBABILITY) -> tuple[Array, Array]:
    """Bounds of NEES or NIS at single epochs, averaged over so many independent runs: two arrays of the shape of `rank`.

    NaN where `rank`, the number of directions, is zero.  These hold epoch by epoch; across epochs of one run they are not
    independent.
    """
    low, high = np.full(rank.shape, np.nan), np.full(rank.shape, np.nan)
    tail = 0.5 * (1 - probability)
    for n in np.unique(rank[rank > 0]).tolist():
        low[rank == n], high[rank == n] = (quantile(p, runs * n) / runs for p in (tail, 1 - tail))
    return low, high


def paired(R: Array, weight: Array) -> float:
    """Sum over pairs j < k of weight[j] weight[k] |R[j] ... R[k-1]|^2 (Frobenius).

    B[k] = sum over j < k of (R[j] ... R[k-1])^T (R[j] ... R[k-1]) obeys B[k+1] = R[k]^T (B[k] + w[k] I) R[k].  Such maps
    combine, so that neighbours are put together, all at once, until one is left: (M, C, S, c) takes B to M^T B M + C and adds
    tr(S B) + c to the sum.
    """
    total = _Stretch.empty(R.shape[1] if R.ndim == 3 else 1)
    for start in range(0, len(R), _BLOCK):
        part = slice(start, start + _BLOCK)
        total = total.then(_together(R[part], weight[:-1][part], weight[1:][part]))
    return float(total.c[0])


_BLOCK = 1 << 13


@dataclass(frozen=True, eq=False)
class _Stretch:
    """Stretches of epochs, side by side: M, C, S (m, n, n) and c (m,) of `paired`."""

    M: Array
    C: Array
    S: Array
    c: Array

    @classmethod
    def empty(cls, n: int) -> _Stretch:
        return cls(np.eye(n)[None], np.zeros((1, n, n)), np.zeros((1, n, n)), np.zeros(1))

    def then(self, later: _Stretch) -> _Stretch:
        """Each stretch with the later one that follows it."""
        M, Mt, N, Nt = self.M, np.swapaxes(self.M, 1, 2), later.M, np.swapaxes(later.M, 1, 2)
        c = self.c + later.c + np.einsum("mij,mji->m", later.S, self.C)
        return _Stretch(M @ N, Nt @ self.C @ N + later.C, self.S + M @ later.S @ Mt, c)

    def at(self, which: slice) -> _Stretch:
        return _Stretch(self.M[which], self.C[which], self.S[which], self.c[which])

    def with_one_more(self) -> _Stretch:
        """An empty stretch behind the others."""
        none = _Stretch.empty(self.M.shape[1])
        return _Stretch(
            np.concatenate([self.M, none.M]),
            np.concatenate([self.C, none.C]),
            np.concatenate([self.S, none.S]),
            np.append(self.c, 0.0),
        )


def _together(R: Array, before: Array, after: Array) -> _Stretch:
    """One stretch of all these epochs, whose weights at both ends are given."""
    Rt = np.swapaxes(R, 1, 2)
    C = before[:, None, None] * (Rt @ R)
    S = after[:, None, None] * (R @ Rt)
    found = _Stretch(R, C, S, after * np.einsum("mii->m", C))
    while len(found.c) > 1:
        if len(found.c) % 2:
            found = found.with_one_more()
        found = found.at(slice(0, None, 2)).then(found.at(slice(1, None, 2)))
    return found
