"""`linearize_rows` of `linearize`, with each row weighted as a loss wants.

`chain.loss` is the kind of the loss, then the squares of its constant for rows of 0 ... M components.
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
def whiten_row(row, out, t, x, p, measured, chain):
    """Innovation and Jacobian of one row in units of its noise, stored from position `out`."""
    s = measured.station[row]
    nu, H = chain.nu, chain.H
    innovate_row(measured, row, t, x, p, nu, H, out)
    if measured.correlated[s]:
        decorrelate(nu, H, out, measured.R, s * M * M, scratch(WORK))
    else:
        for i in range(M):
            weight = 1.0 / sqrt(measured.R[(s * M + i) * M + i])
            nu[out + i] = weight * nu[out + i]
            store(H, (out + i) * N, weight * load_vector(H, (out + i) * N, N))


@inline
def weigh_row(row, out, squared, present, chain):
    """Scale a row by the root of the weight for a squared residual over that many components, and note the weight."""
    weight = loss_weight(chain.loss[0], chain.loss[1 + present], squared)
    chain.weights[row] = weight
    root = sqrt(weight)
    for i in range(M):
        chain.nu[out + i] = root * chain.nu[out + i]
        store(chain.H, (out + i) * N, root * load_vector(chain.H, (out + i) * N, N))


@inline
def linearize_rows(a, W, run, chain, p, measured):
    """Innovations and Jacobians of all rows of states a ... a + W - 1, whitened and weighted, stored from position 0."""
    base = run.first_row[a]
    for k in range(a, a + W):
        state = load_vector(chain.x, k * N, N)
        for row in range(run.first_row[k], run.first_row[k + 1]):
            out = (row - base) * M
            whiten_row(row, out, run.t[k], state, p, measured, chain)
            squared = 0.0
            present = 0
            for i in range(M):
                if not isnan(measured.z[row * M + i]):
                    squared += chain.nu[out + i] * chain.nu[out + i]
                    present += 1
            weigh_row(row, out, squared, present, chain)
