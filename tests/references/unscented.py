"""The unscented Kalman filter as Wan and van der Merwe (2000) print it: explicit weights, Cholesky factors, an inverse.

Nothing here uses Piazzi.  Points are drawn anew from the predicted covariance, process noise included.  Angles are differences
from the central point's, by the arc tangent.  All rows of an epoch are one vector with a block-diagonal R.
"""

import numpy as np

from tests.references.textbook import Row, Run, wrap


def weights(n, alpha, beta, kappa):
    """Scaling lambda, and the weights of means and of covariances, (2 n + 1,)."""
    lam = alpha**2 * (n + kappa) - n
    w = np.full(2 * n + 1, 0.5 / (n + lam))
    w_mean, w_covariance = w.copy(), w.copy()
    w_mean[0] = lam / (n + lam)
    w_covariance[0] = lam / (n + lam) + 1 - alpha**2 + beta
    return lam, w_mean, w_covariance


def points(x, P, lam):
    L = np.linalg.cholesky((len(x) + lam) * P)
    return np.vstack([x, x + L.T, x - L.T])


def differences(values, angle):
    """Values of all points less the first one's."""
    out = values - values[0]
    for c in np.flatnonzero(angle):
        out[:, c] = [wrap(v) for v in out[:, c]]
    return out


def unscented_kalman_filter(x, P, times, rows, step, Q, alpha=1e-3, beta=2.0, kappa=0.0, start=None) -> Run:
    """Filtered estimates at `times`; `step(x, t, dt)` is the next state, `rows[k]` the measurements of epoch k (`Row`)."""
    means, covariances, innovations, spreads = [], [], [], []
    lam, w_mean, w = weights(len(x), alpha, beta, kappa)
    before = times[0] if start is None else start
    for t, epoch in zip(times, rows, strict=True):
        if t > before:
            y = np.array([step(p, before, t - before) for p in points(x, P, lam)])
            e = differences(y, np.zeros(len(x), dtype=bool))
            shift = w_mean @ e
            x = y[0] + shift
            P = (w * (e - shift).T) @ (e - shift) + Q(before, t - before)
        before = t
        X = points(x, P, lam)
        angle = np.concatenate([list(r.angle) or [False] * len(r.z) for r in epoch])
        h = np.array([np.concatenate([r.h(p) for r in epoch]) for p in X])
        e = differences(h, angle)
        shift = w_mean @ e
        nu = np.concatenate([r.z for r in epoch]) - (h[0] + shift)
        nu[angle] = [v if np.isnan(v) else wrap(v) for v in nu[angle]]
        S = (w * (e - shift).T) @ (e - shift) + block_diagonal(epoch)
        C = (w * (X - x).T) @ (e - shift)
        innovations.append(nu)
        spreads.append(S)
        there = np.flatnonzero(~np.isnan(nu))
        if there.size:
            K = C[:, there] @ np.linalg.inv(S[np.ix_(there, there)])
            x, P = x + K @ nu[there], P - K @ S[np.ix_(there, there)] @ K.T
        means.append(x)
        covariances.append(P)
    return Run(np.array(means), np.array(covariances), innovations, spreads)


def block_diagonal(epoch: list[Row]) -> np.ndarray:
    """R of all rows of an epoch."""
    sizes = np.cumsum([0] + [len(r.z) for r in epoch])
    out = np.zeros((sizes[-1], sizes[-1]))
    for a, b, r in zip(sizes[:-1], sizes[1:], epoch, strict=True):
        out[a:b, a:b] = r.R
    return out
