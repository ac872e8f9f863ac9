"""Kalman filters as a textbook writes them, in plain NumPy: explicit inverses, no Joseph form, derivatives by hand.

Nothing here uses Piazzi.  A `step(x, t, dt)` returns the next state and its transition matrix.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

MU = 3.986e14


class Row(NamedTuple):
    """One measurement: values, h and H as functions of the state, noise, and which components are angles."""

    z: np.ndarray
    h: Callable[[np.ndarray], np.ndarray]
    H: Callable[[np.ndarray], np.ndarray]
    R: np.ndarray
    angle: Sequence[bool] = ()


class Run(NamedTuple):
    mean: np.ndarray
    covariance: np.ndarray
    innovations: list[np.ndarray]
    innovation_covariances: list[np.ndarray]


def wrap(angle: float) -> float:
    """Principal value by the arc tangent."""
    return float(np.arctan2(np.sin(angle), np.cos(angle)))


def extended_kalman_filter(x, P, times, rows, step, Q, start=None) -> Run:
    """Filtered estimates at `times`; `rows[k]` are the measurements of epoch k, stacked into one; `Q(t, dt)` is per interval.

    Measurements of one epoch are one vector with a block-diagonal R: the textbook's joint update.
    """
    means, covariances, innovations, spreads = [], [], [], []
    before = times[0] if start is None else start
    for t, epoch in zip(times, rows, strict=True):
        if t > before:
            x, Phi = step(x, before, t - before)
            P = Phi @ P @ Phi.T + Q(before, t - before)
        before = t
        nu, H, R = stack(x, epoch)
        innovations.append(nu)
        spreads.append(H @ P @ H.T + R)
        seen = np.flatnonzero(~np.isnan(nu))
        if seen.size:
            H, R, S = H[seen], R[np.ix_(seen, seen)], spreads[-1][np.ix_(seen, seen)]
            K = P @ H.T @ np.linalg.inv(S)
            x = x + K @ nu[seen]
            P = (np.eye(len(x)) - K @ H) @ P
        means.append(x)
        covariances.append(P)
    return Run(np.array(means), np.array(covariances), innovations, spreads)


def stack(x, epoch):
    """Innovation, Jacobian and noise of all rows of an epoch as one measurement."""
    nu, H, R = [], [], []
    for row in epoch:
        difference = np.asarray(row.z, dtype=float) - row.h(x)
        angle = list(row.angle) or [False] * len(difference)
        nu.append(np.array([wrap(d) if a and not np.isnan(d) else d for d, a in zip(difference, angle, strict=True)]))
        H.append(row.H(x))
        R.append(row.R)
    sizes = np.cumsum([0] + [len(r) for r in R])
    noise = np.zeros((sizes[-1], sizes[-1]))
    for a, b, r in zip(sizes[:-1], sizes[1:], R, strict=True):
        noise[a:b, a:b] = r
    return np.concatenate(nu), np.vstack(H), noise


# ---- the founding problems, differentiated by hand -------------------------------------------------------------------


def gravity(x, mu):
    """dx/dt and its Jacobian for a point mass in the plane."""
    px, py, vx, vy = x
    r = np.hypot(px, py)
    f = np.array([vx, vy, -mu * px / r**3, -mu * py / r**3])
    F = np.zeros((4, 4))
    F[0, 2] = F[1, 3] = 1.0
    F[2, 0], F[3, 1] = mu * (2 * px**2 - py**2) / r**5, mu * (2 * py**2 - px**2) / r**5
    F[2, 1] = F[3, 0] = 3 * mu * px * py / r**5
    return f, F


def founding_step(x, dt, mu):
    """The founding text's discrete step and its Jacobian, as printed there."""
    px, py, _, _ = x
    r = np.hypot(px, py)
    T = np.eye(4) + dt * np.eye(4, k=2)
    nxt = T @ x - mu / r**3 * np.array([px * dt**2 / 2, py * dt**2 / 2, px * dt, py * dt])
    a, b, c = 2 * px**2 - py**2, 3 * px * py, 2 * py**2 - px**2
    D = np.array([[dt * a / 2, b * dt / 2, 0, 0], [b * dt / 2, dt * c / 2, 0, 0], [a, b, 0, 0], [b, c, 0, 0]])
    return nxt, T + mu * dt / r**5 * D


def taylor(mu, substeps):
    """A chain of founding steps."""

    def step(x, t, dt):
        Phi = np.eye(4)
        for _ in range(substeps):
            x, G = founding_step(x, dt / substeps, mu)
            Phi = G @ Phi
        return x, Phi

    return step


def runge_kutta(f_F, substeps):
    """Classical fourth-order steps of the augmented vector (x, Phi), one flat vector of n + n^2 as in the range notebook."""

    def rate(t, y, n):
        f, F = f_F(t, y[:n])
        return np.concatenate([f, (F @ y[n:].reshape(n, n)).ravel()])

    def step(x, t, dt):
        n = len(x)
        y, h = np.concatenate([x, np.eye(n).ravel()]), dt / substeps
        for i in range(substeps):
            s = t + i * h
            k1 = rate(s, y, n)
            k2 = rate(s + h / 2, y + h / 2 * k1, n)
            k3 = rate(s + h / 2, y + h / 2 * k2, n)
            k4 = rate(s + h, y + h * k3, n)
            y = y + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        return y[:n], y[n:].reshape(n, n)

    return step


def bearing(z, R) -> Row:
    """atan2(y, x) seen from the origin."""

    def H(x):
        r2 = x[0] ** 2 + x[1] ** 2
        return np.array([[-x[1] / r2, x[0] / r2, 0.0, 0.0]])

    return Row(np.atleast_1d(z), lambda x: np.array([np.arctan2(x[1], x[0])]), H, np.atleast_2d(R), [True])


def range_from(place, z, R) -> Row:
    """Distance from a place in the plane."""

    def H(x):
        d = x[:2] - place
        return np.array([[*(d / np.hypot(*d)), 0.0, 0.0]])

    return Row(np.atleast_1d(z), lambda x: np.array([np.hypot(*(x[:2] - place))]), H, np.atleast_2d(R))
