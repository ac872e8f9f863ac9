"""`linearize_rows` of `linearize`, with each row weighted as a loss wants.

Work space `L` is longer than elsewhere: behind the M (M + N) numbers of a factorisation come the kind of the loss, the squares
of its constant for rows of 0 ... M components, and the weight of every row.
"""

from piazzi.kernels.vocabulary import *  # noqa: F403


@inline
def loss_weight(kind, square, s):
    """Weight of a row whose squared residual is s: Huber's (1), Cauchy's (2) or Tukey's (3) loss; see estimate/losses.py.

    A prediction that failed keeps its weight, so that it shows.
    """
    inside = maximum(1.0 - s / square, 0.0)
    huber = sqrt(square / maximum(s, square))
    w = huber if kind == 1.0 else 1.0 / (1.0 + s / square) if kind == 2.0 else inside * inside
    return w if s < inf else 1.0


@inline
def whiten_row(row, out, k, t, state, z, station, sensor, numbers, R, correlated, p, nu, H, L):
    """Innovation and Jacobian of one row in units of its noise, stored from position `out`."""
    s = station[row]
    innovate(sensor[s], t[k], state, p, numbers, s * NUMBERS, z, row * M, nu, H, out)
    if correlated[s]:
        decorrelate(nu, H, out, R, s * M * M, L)
    else:
        for i in range(M):
            weight = 1.0 / sqrt(R[(s * M + i) * M + i])
            nu[out + i] = weight * nu[out + i]
            store(H, (out + i) * N, weight * load_vector(H, (out + i) * N, N))


@inline
def weigh_row(row, out, squared, present, nu, H, L):
    """Scale a row by the root of the weight for a squared residual over that many components, and note the weight."""
    at = M * (M + N)
    weight = loss_weight(L[at], L[at + 1 + present], squared)
    L[at + 2 + M + row] = weight
    root = sqrt(weight)
    for i in range(M):
        nu[out + i] = root * nu[out + i]
        store(H, (out + i) * N, root * load_vector(H, (out + i) * N, N))


@inline
def linearize_rows(a, W, t, x, first_row, z, station, sensor, numbers, R, correlated, p, nu, H, L):
    """Innovations and Jacobians of all rows of states a ... a + W - 1, whitened and weighted, stored from position 0."""
    base = first_row[a]
    for k in range(a, a + W):
        state = load_vector(x, k * N, N)
        for row in range(first_row[k], first_row[k + 1]):
            out = (row - base) * M
            whiten_row(row, out, k, t, state, z, station, sensor, numbers, R, correlated, p, nu, H, L)
            squared = 0.0
            present = 0
            for i in range(M):
                if not isnan(z[row * M + i]):
                    squared += nu[out + i] * nu[out + i]
                    present += 1
            weigh_row(row, out, squared, present, nu, H, L)
