"""Linearised, whitened measurements of a stretch of states."""

from piazzi.kernels.vocabulary import *  # noqa: F403


@inline
def linearize_rows(a, W, run, chain, p, measured):
    """Innovations and Jacobians of all rows of states a ... a + W - 1 in units of their noise, stored from position 0.

    Returns the sum of squares, NaN where a measurement that is there has no prediction.
    """
    L = scratch(WORK)
    nu, H = chain.nu, chain.H
    base = run.first_row[a]
    cost = 0.0
    for k in range(a, a + W):
        state = load_vector(chain.x, k * N, N)
        for row in range(run.first_row[k], run.first_row[k + 1]):
            s = measured.station[row]
            out = (row - base) * M
            innovate_row(measured, row, run.t[k], state, p, nu, H, out)
            if measured.correlated[s]:
                decorrelate(nu, H, out, measured.R, s * M * M, L)
            else:
                for i in range(M):
                    weight = 1.0 / sqrt(measured.R[(s * M + i) * M + i])
                    nu[out + i] = weight * nu[out + i]
                    store(H, (out + i) * N, weight * load_vector(H, (out + i) * N, N))
            for i in range(M):
                cost += 0.0 if isnan(measured.z[row * M + i]) else nu[out + i] * nu[out + i]
    return cost
