"""Transition matrix and process noise of a linear system, by Van Loan's matrix exponential in 40 digits.

C. F. Van Loan, Computing integrals involving the matrix exponential, IEEE Trans. Automatic Control 23 (1978).
"""

import mpmath
import numpy as np


def discretize(A: np.ndarray, Q: np.ndarray, dt: float) -> tuple[np.ndarray, np.ndarray]:
    """exp(A dt), and the integral over [0, dt] of exp(A s) Q exp(A s)^T."""
    n = len(A)
    block = np.block([[-A, Q], [np.zeros((n, n)), A.T]])
    with mpmath.workdps(40):
        E = mpmath.expm(mpmath.matrix(block.tolist()) * mpmath.mpf(dt))
        Phi = E[n:, n:].T
        noise = Phi * E[:n, n:]
        return tuple(np.array(m.tolist(), dtype=float).reshape(n, n) for m in (Phi, noise))
