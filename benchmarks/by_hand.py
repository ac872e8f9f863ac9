"""The bearing-only satellite in plain Python, as users of other libraries write it."""

from __future__ import annotations

from math import atan2, pi, sqrt

import numpy as np

MU = 3.986e14  # m^3/s^2


def step(x: np.ndarray, dt: float, substeps: int) -> tuple[np.ndarray, np.ndarray]:
    """The state `dt` seconds later by second-order Taylor substeps, and its derivative Phi (4, 4)."""
    h = dt / substeps
    px, py, vx, vy = map(float, x)
    Phi = np.eye(4)
    G = np.eye(4)
    for _ in range(substeps):
        r2 = px * px + py * py
        r3 = r2 * sqrt(r2)
        ax, ay = -MU * px / r3, -MU * py / r3
        three = 3 * MU / (r2 * r3)
        xx, xy, yy = three * px * px - MU / r3, three * px * py, three * py * py - MU / r3
        half = 0.5 * h * h
        G[:] = (
            (1 + half * xx, half * xy, h, 0.0),
            (half * xy, 1 + half * yy, 0.0, h),
            (h * xx, h * xy, 1.0, 0.0),
            (h * xy, h * yy, 0.0, 1.0),
        )
        Phi = G @ Phi
        px, py, vx, vy = px + h * vx + half * ax, py + h * vy + half * ay, vx + h * ax, vy + h * ay
    return np.array([px, py, vx, vy]), Phi


def bearing(x: np.ndarray) -> np.ndarray:
    return np.array([atan2(x[1], x[0])])


def bearing_jacobian(x: np.ndarray) -> np.ndarray:
    r2 = x[0] * x[0] + x[1] * x[1]
    return np.array([[-x[1] / r2, x[0] / r2, 0.0, 0.0]])


def bearing_residual(z: np.ndarray, h: np.ndarray) -> np.ndarray:
    """z - h, wrapped into [-pi, pi)."""
    return (z - h + pi) % (2 * pi) - pi
