"""The fixed-interval smoother as Rauch, Tung and Striebel (1965) wrote it: explicit inverses, no Joseph form, plain NumPy.

Nothing here uses Piazzi.  An epoch's measurements are one vector z = H x + v, v ~ N(0, R), with NaN where missing.
"""

from typing import NamedTuple

import numpy as np


class Smoothed(NamedTuple):
    mean: np.ndarray
    covariance: np.ndarray
    cross: np.ndarray


def rauch_tung_striebel(m, P, transitions, noises, seen) -> Smoothed:
    """Means, covariances and Cov(x[k], x[k+1]) of all states given all measurements."""
    n = len(m)
    predicted, updated = [], []
    x = m
    for k, s in enumerate(seen):
        if k > 0:
            F, Q = transitions[k - 1], noises[k - 1]
            x, P = F @ x, F @ P @ F.T + Q
        predicted.append((x, P))
        if s is not None:
            there = ~np.isnan(s.z)
            H, R = s.H[there], s.R[np.ix_(there, there)]
            G = P @ H.T @ np.linalg.inv(H @ P @ H.T + R)
            x, P = x + G @ (s.z[there] - H @ x), P - G @ H @ P
        updated.append((x, P))
    means, covariances, cross = [x], [P], []
    for k in range(len(seen) - 2, -1, -1):
        (x_next, P_next), (x_f, P_f) = predicted[k + 1], updated[k]
        J = P_f @ transitions[k].T @ np.linalg.inv(P_next)
        cross.append(J @ covariances[-1])
        means.append(x_f + J @ (means[-1] - x_next))
        covariances.append(P_f + J @ (covariances[-1] - P_next) @ J.T)
    return Smoothed(np.array(means[::-1]), np.array(covariances[::-1]), np.array(cross[::-1]).reshape(-1, n, n))
