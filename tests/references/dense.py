"""Linear-Gaussian trajectories solved all at once, by one dense QR factorisation.

The unknowns are the independent unit noises that drive the trajectory, not the states: so singular and zero process noise
need no special case, and nothing is inverted but a triangle.  Nothing here uses Piazzi.
"""

from typing import NamedTuple

import numpy as np


class Seen(NamedTuple):
    """All that is measured at one epoch, as one vector: z = H x + v with v ~ N(0, R); NaN where missing."""

    z: np.ndarray
    H: np.ndarray
    R: np.ndarray


class Trajectory(NamedTuple):
    """Means (K, n) and the joint covariance (K, n, K, n) of all states."""

    mean: np.ndarray
    joint: np.ndarray

    @property
    def covariance(self) -> np.ndarray:
        """Covariance of each state, (K, n, n)."""
        return np.array([self.joint[k, :, k] for k in range(len(self.mean))])

    @property
    def cross(self) -> np.ndarray:
        """Cov(x[k], x[k+1]), (K - 1, n, n)."""
        n = self.mean.shape[1]
        return np.array([self.joint[k, :, k + 1] for k in range(len(self.mean) - 1)]).reshape(-1, n, n)


def root(covariance: np.ndarray) -> np.ndarray:
    """S with S S^T = covariance and a column for each direction that has any variance."""
    values, vectors = np.linalg.eigh(covariance)
    kept = values > 1e-12 * max(values.max(initial=0.0), 1e-300)
    return vectors[:, kept] * np.sqrt(values[kept])


def smooth(m, P, transitions, noises, seen) -> Trajectory:
    """All states given everything in `seen` (one `Seen` or None per epoch); `transitions` and `noises` are per interval."""
    K, n = len(seen), len(m)
    drive = [root(P), *(root(Q) for Q in noises)]
    ends = np.cumsum([0] + [d.shape[1] for d in drive])
    mean, T = np.zeros((K, n)), np.zeros((K, n, ends[-1]))
    for k in range(K):
        if k == 0:
            mean[0] = m
        else:
            mean[k], T[k] = transitions[k - 1] @ mean[k - 1], transitions[k - 1] @ T[k - 1]
        T[k, :, ends[k] : ends[k + 1]] = drive[k]
    rows, right = [np.eye(ends[-1])], [np.zeros(ends[-1])]
    for k, s in enumerate(seen):
        if s is not None:
            there = ~np.isnan(s.z)
            W = np.linalg.inv(np.linalg.cholesky(s.R[np.ix_(there, there)]))
            rows.append(W @ s.H[there] @ T[k])
            right.append(W @ (s.z[there] - s.H[there] @ mean[k]))
    q, r = np.linalg.qr(np.vstack(rows))
    u = np.linalg.solve(r, q.T @ np.concatenate(right))
    Y = np.linalg.solve(r.T, T.reshape(K * n, -1).T).T
    return Trajectory(mean + T @ u, (Y @ Y.T).reshape(K, n, K, n))


def fixed_lag(m, P, transitions, noises, seen, first) -> tuple[np.ndarray, np.ndarray]:
    """Each state as known when it left a window: state j given the epochs up to the last whose window holds it.

    `first[k]` is the oldest state in the window of epoch k.  Returns means (K, n) and covariances (K, n, n).
    """
    K = len(seen)
    means, covariances = [], []
    for j in range(K):
        last = max(k for k in range(K) if first[k] <= j <= k)
        known = smooth(m, P, transitions[:last], noises[:last], seen[: last + 1])
        means.append(known.mean[j])
        covariances.append(known.covariance[j])
    return np.array(means), np.array(covariances)
