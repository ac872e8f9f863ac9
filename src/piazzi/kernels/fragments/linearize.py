"""Linearised, whitened measurements of a stretch of states."""

from piazzi.kernels.vocabulary import *  # noqa: F403


@inline
def linearize_rows(a, W, t, x, first_row, z, station, sensor, numbers, R, correlated, p, nu, H, L):
    """Innovations and Jacobians of all rows of states a ... a + W - 1 in units of their noise, stored from position 0.

    Returns the sum of squares, NaN where a measurement that is there has no prediction.
    """
    base = first_row[a]
    cost = 0.0
    for k in range(a, a + W):
        state = load_vector(x, k * N, N)
        for row in range(first_row[k], first_row[k + 1]):
            s = station[row]
            out = (row - base) * M
            innovate(sensor[s], t[k], state, p, numbers, s * NUMBERS, z, row * M, nu, H, out)
            if correlated[s]:
                decorrelate(nu, H, out, R, s * M * M, L)
            else:
                for i in range(M):
                    weight = 1.0 / sqrt(R[(s * M + i) * M + i])
                    nu[out + i] = weight * nu[out + i]
                    store(H, (out + i) * N, weight * load_vector(H, (out + i) * N, N))
            for i in range(M):
                cost += 0.0 if isnan(z[row * M + i]) else nu[out + i] * nu[out + i]
    return cost
