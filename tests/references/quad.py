"""Maximum a posteriori trajectories in 50 digits, by the normal equations.  Nothing here uses Piazzi.

With that many digits the worst method is exact for every purpose, so it is the simplest one.
"""

from collections.abc import Callable
from typing import NamedTuple

import mpmath
import numpy as np

DIGITS = 50


class Exact(NamedTuple):
    """Means (K, n), covariances (K, n, n) and Cov(x[k], x[k+1]) (K - 1, n, n), rounded once."""

    mean: np.ndarray
    covariance: np.ndarray
    cross: np.ndarray


def exact(a) -> np.ndarray:
    """The same numbers as an object array of mpmath floats."""
    return np.vectorize(lambda v: mpmath.mpf(float(v)), otypes=[object])(np.asarray(a, dtype=float))


def rounded(a: np.ndarray) -> np.ndarray:
    """The nearest doubles."""
    return np.vectorize(float, otypes=[float])(a)


def lower_inverse(A: np.ndarray) -> np.ndarray:
    """L^-1 of the symmetric positive definite A = L L^T, so that A^-1 = L^-T L^-1."""
    n = len(A)
    work, inverse = A.copy(), exact(np.eye(n))
    for j in range(n):
        pivot = mpmath.sqrt(work[j, j])
        row, own = work[j, j:] / pivot, inverse[j, : j + 1] / pivot
        work[j, j:], inverse[j, : j + 1] = row, own
        for i in range(j + 1, n):
            factor = row[i - j]
            work[i, i:] = work[i, i:] - factor * row[i - j :]
            inverse[i, : j + 1] = inverse[i, : j + 1] - factor * own
    return inverse


def inverse(A: np.ndarray) -> np.ndarray:
    """A^-1 of the symmetric positive definite A."""
    root = lower_inverse(A)
    return root.T.dot(root)


def founding_step(x: np.ndarray, h, mu, substeps: int) -> tuple[np.ndarray, np.ndarray]:
    """The founding text's step, x + h v + h^2/2 a and v + h a, repeated; and its Jacobian."""
    Phi = exact(np.eye(4))
    for _ in range(substeps):
        px, py, vx, vy = x
        r2 = px * px + py * py
        r3 = r2 * mpmath.sqrt(r2)
        ax, ay = -mu * px / r3, -mu * py / r3
        r5 = r3 * r2
        A = (
            np.array(
                [[mu * (2 * px * px - py * py), 3 * mu * px * py], [3 * mu * px * py, mu * (2 * py * py - px * px)]],
                dtype=object,
            )
            / r5
        )
        G = exact(np.eye(4))
        G[:2, :2] += h * h / 2 * A
        G[2:, :2] = h * A
        G[0, 2] = G[1, 3] = h
        x = np.array([px + h * vx + h * h / 2 * ax, py + h * vy + h * h / 2 * ay, vx + h * ax, vy + h * ay], dtype=object)
        Phi = G.dot(Phi)
    return x, Phi


def bearing(x: np.ndarray) -> tuple[object, np.ndarray]:
    """atan2(y, x), and its Jacobian."""
    r2 = x[0] * x[0] + x[1] * x[1]
    zero = mpmath.mpf(0)
    return mpmath.atan2(x[1], x[0]), np.array([-x[1] / r2, x[0] / r2, zero, zero], dtype=object)


def bearings_only(mean, covariance, noise, variance, bearings, dt, substeps, mu, start) -> Exact:
    """The satellite-bearing problem, by Gauss-Newton on block-tridiagonal normal equations; NaN is a missing bearing."""
    with mpmath.workdps(DIGITS):
        x, m = exact(start), exact(mean)
        z = [None if np.isnan(v) else mpmath.mpf(float(v)) for v in np.ravel(bearings)]
        P_inverse, Q_inverse = (inverse(exact(a)) for a in (covariance, noise))
        R, h, mu = mpmath.mpf(float(variance)), mpmath.mpf(float(dt)) / substeps, mpmath.mpf(float(mu))
        for _ in range(60):
            own, right, between = _normal_equations(
                x, m, P_inverse, Q_inverse, z, R, lambda s: founding_step(s, h, mu, substeps)
            )
            step, marginal, cross = _solve_tridiagonal(own, between, right)
            x = x + step
            if max(abs(v) for v in step.ravel()) < mpmath.mpf(10) ** -18:
                return Exact(rounded(x), rounded(marginal), rounded(cross))
    raise ArithmeticError("the reference did not converge")


def _normal_equations(x, m, P_inverse, Q_inverse, z, R, step: Callable) -> tuple[list, list, list]:
    """Hessian of Gauss and Newton, by blocks: of each state, minus the gradient, and of each state with the next."""
    K = len(x)
    own, right = [exact(np.zeros((4, 4))) for _ in range(K)], [exact(np.zeros(4)) for _ in range(K)]
    own[0], right[0] = P_inverse, P_inverse.dot(m - x[0])
    between = []
    for k in range(K):
        if z[k] is not None:
            value, H = bearing(x[k])
            nu = z[k] - value
            nu -= 2 * mpmath.pi * mpmath.nint(nu / (2 * mpmath.pi))
            own[k], right[k] = own[k] + np.outer(H, H) / R, right[k] + H * nu / R
        if k + 1 < K:
            f, Phi = step(x[k])
            pull = Q_inverse.dot(x[k + 1] - f)
            own[k], right[k] = own[k] + Phi.T.dot(Q_inverse).dot(Phi), right[k] + Phi.T.dot(pull)
            own[k + 1], right[k + 1] = own[k + 1] + Q_inverse, right[k + 1] - pull
            between.append(-Phi.T.dot(Q_inverse))
    return own, right, between


def _solve_tridiagonal(own, between, right) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Solution, diagonal blocks of the inverse, and the blocks beside them."""
    pivots, rights = [inverse(own[0])], [right[0]]
    for k, B in enumerate(between):
        pivots.append(inverse(own[k + 1] - B.T.dot(pivots[k]).dot(B)))
        rights.append(right[k + 1] - B.T.dot(pivots[k]).dot(rights[k]))
    x, blocks, cross = [pivots[-1].dot(rights[-1])], [pivots[-1]], []
    for k in range(len(between) - 1, -1, -1):
        gain = pivots[k].dot(between[k])
        x.append(pivots[k].dot(rights[k]) - gain.dot(x[-1]))
        cross.append(-gain.dot(blocks[-1]))
        blocks.append(pivots[k] - cross[-1].dot(gain.T))
    return np.array(x[::-1]), np.array(blocks[::-1]), np.array(cross[::-1])


def smooth(m, P, transitions, noises, seen) -> Exact:
    """Linear-Gaussian trajectory as in `references.dense`, for a positive definite P.

    The unknowns are the unit noises of prior and steps; `noises` are given as their roots, S with Q = S S^T.
    """
    with mpmath.workdps(DIGITS):
        K, n = len(seen), len(m)
        first = _inverse_of_lower(lower_inverse(exact(P)))
        drive = [first, *(exact(S) for S in noises)]
        ends = np.cumsum([0] + [d.shape[1] for d in drive])
        mean, T = [exact(m)], [exact(np.zeros((n, ends[-1])))]
        T[0][:, : ends[1]] = first
        for k in range(1, K):
            F = exact(transitions[k - 1])
            mean.append(F.dot(mean[-1]))
            T.append(F.dot(T[-1]))
            T[-1][:, ends[k] : ends[k + 1]] = drive[k]
        A, b = exact(np.eye(ends[-1])), exact(np.zeros(ends[-1]))
        for k, s in enumerate(seen):
            there = ~np.isnan(s.z)
            W = inverse(exact(s.R[np.ix_(there, there)]))
            J = exact(s.H[there]).dot(T[k])
            A += J.T.dot(W).dot(J)
            b += J.T.dot(W).dot(exact(s.z[there]) - exact(s.H[there]).dot(mean[k]))
        root = lower_inverse(A)
        u = root.T.dot(root.dot(b))
        whole = np.concatenate(T)
        Y = whole.dot(root.T)
        x = np.concatenate(mean) + whole.dot(u)
        blocks = Y.reshape(K, n, -1)
        covariance = [rounded(block.dot(block.T)) for block in blocks]
        cross = [rounded(blocks[k].dot(blocks[k + 1].T)) for k in range(K - 1)]
        return Exact(rounded(x).reshape(K, n), np.array(covariance), np.array(cross).reshape(-1, n, n))


def _inverse_of_lower(L: np.ndarray) -> np.ndarray:
    n = len(L)
    out = exact(np.eye(n))
    for i in range(n):
        out[i] = (out[i] - L[i, :i].dot(out[:i])) / L[i, i] if i else out[i] / L[i, i]
    return out
