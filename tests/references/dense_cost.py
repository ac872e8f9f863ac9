"""Residuals of a whole nonlinear trajectory in plain NumPy, and their derivative by differences.  Nothing here uses Piazzi."""

from collections.abc import Callable

import numpy as np

from tests.references.dense import root


def trajectory_residuals(states, mean, covariance, step, noise, measured) -> np.ndarray:
    """Prior, dynamics and measurement residuals (whitened) of the states (K, n), one vector.

    `step(x, k)` gives state k + 1, `noise(k)` its covariance (nonsingular), `measured(x, k)` the residuals of epoch k.
    """
    K = len(states)
    parts = [whiten(states[0] - mean, covariance)]
    parts += [whiten(states[k + 1] - step(states[k], k), noise(k)) for k in range(K - 1)]
    parts += [measured(states[k], k) for k in range(K)]
    return np.concatenate(parts)


def whiten(difference, covariance) -> np.ndarray:
    """The difference in independent units of one sigma."""
    return np.linalg.solve(np.linalg.cholesky(covariance), difference)


def scaled_gradient(residuals: Callable[[np.ndarray], np.ndarray], x: np.ndarray, steps: np.ndarray) -> np.ndarray:
    """Gradient of half the sum of squares by central differences, each entry in units of the root of its own curvature."""
    r = residuals(x)
    out = np.empty(len(x))
    for i, h in enumerate(steps):
        e = np.zeros(len(x))
        e[i] = h
        column = (residuals(x + e) - residuals(x - e)) / (2 * h)
        out[i] = column @ r / np.linalg.norm(column)
    return out


def driven_residuals(mean, covariance, step, noises, measured) -> tuple[Callable[[np.ndarray], np.ndarray], int]:
    """Residuals as a function of what drives the trajectory, and how many numbers that is.

    The independent unit noises of prior and steps are the unknowns, so that directions without noise hold exactly: where the
    gradient in them is zero, that of the Lagrangian is.  `step(x, k)` takes many states at once, (B, n).
    """
    first = root(covariance)
    drives = [root(Q) for Q in noises]
    ends = np.cumsum([first.shape[1], *(d.shape[1] for d in drives)])

    def residuals(u: np.ndarray) -> np.ndarray:
        u = np.atleast_2d(u)
        x = mean + u[:, : ends[0]] @ first.T
        parts = [u, measured(x, 0)]
        for k, drive in enumerate(drives):
            x = step(x, k) + u[:, ends[k] : ends[k + 1]] @ drive.T
            parts.append(measured(x, k + 1))
        return np.concatenate(parts, axis=1)

    return residuals, int(ends[-1])


def driving_noise(states, mean, covariance, step, noises) -> np.ndarray:
    """The unknowns of `driven_residuals` that make these states, by least squares."""
    u = [np.linalg.lstsq(root(covariance), states[0] - mean, rcond=None)[0]]
    for k, Q in enumerate(noises):
        drive = root(Q)
        u.append(
            np.linalg.lstsq(drive, states[k + 1] - step(states[k][None], k)[0], rcond=None)[0] if drive.size else np.zeros(0)
        )
    return np.concatenate(u)
