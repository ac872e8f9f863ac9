"""Kepler's ellipse in the plane: the closed form of two-body motion."""

import numpy as np


def period(state: np.ndarray, mu: float) -> float:
    """Time of one revolution of [x, y, vx, vy]."""
    a = 1.0 / (2.0 / np.hypot(*state[:2]) - (state[2] ** 2 + state[3] ** 2) / mu)
    return float(2 * np.pi * np.sqrt(a**3 / mu))


def propagate(state: np.ndarray, dt: float, mu: float) -> np.ndarray:
    """[x, y, vx, vy] of an elliptic orbit `dt` seconds later, by Kepler's equation and the f and g functions."""
    position, velocity = state[:2], state[2:]
    r0 = np.hypot(*position)
    a = 1.0 / (2.0 / r0 - velocity @ velocity / mu)
    n = np.sqrt(mu / a**3)
    e_cos, e_sin = 1 - r0 / a, position @ velocity / np.sqrt(mu * a)  # e cos E0, e sin E0
    dE = n * dt
    for _ in range(60):  # Newton on the difference form of Kepler's equation
        residual = dE - e_cos * np.sin(dE) + e_sin * (1 - np.cos(dE)) - n * dt
        dE -= residual / (1 - e_cos * np.cos(dE) + e_sin * np.sin(dE))
    r = a * (1 - e_cos * np.cos(dE) + e_sin * np.sin(dE))
    f, g = 1 - a / r0 * (1 - np.cos(dE)), dt - (dE - np.sin(dE)) / n
    f_dot, g_dot = -np.sqrt(mu * a) / (r * r0) * np.sin(dE), 1 - a / r * (1 - np.cos(dE))
    return np.concatenate([f * position + g * velocity, f_dot * position + g_dot * velocity])


def energy(state: np.ndarray, mu: float) -> float:
    """Specific energy."""
    return float((state[2] ** 2 + state[3] ** 2) / 2 - mu / np.hypot(*state[:2]))


def angular_momentum(state: np.ndarray) -> float:
    """Specific angular momentum, out of the plane."""
    return float(state[0] * state[3] - state[1] * state[2])
