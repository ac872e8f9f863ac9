"""What measurements say about the first state: a filter that is told the first state, and its derivative by that state.

Started without any uncertainty, a filter has innovations that are white and depend on the first state through W = dx/dx[0].
Their whitened derivatives, one below the other, are a square root of the Fisher information of the first state: no prior is
needed, process noise may be singular, and without it the rows are H Phi in units of the noise.  (The augmented filter of
Rosenberg, Annals of Economic and Social Measurement 2, 1973, and de Jong, Annals of Statistics 19, 1991.)
"""

from piazzi.kernels.vocabulary import *  # noqa: F403


@inline
def whiten_row(row, s, t, x, z, sensor, numbers, R, correlated, p, nu, H, L):
    """Innovation and Jacobian of one row at a state, in units of its noise."""
    innovate(sensor[s], t, x, p, numbers, s * NUMBERS, z, row * M, nu, H, 0)
    if correlated[s]:
        decorrelate(nu, H, 0, R, s * M * M, L)
    else:
        for i in range(M):
            weight = 1.0 / sqrt(R[(s * M + i) * M + i])
            nu[i] = weight * nu[i]
            store(H, i * N, weight * load_vector(H, i * N, N))


@entry
def observe(
    K: int,
    t: Array,
    count: Indices,
    scale: Array,
    first_row: Indices,
    z: Array,
    station: Indices,
    sensor: Indices,
    numbers: Array,
    R: Array,
    correlated: Indices,
    p: Array,
    Q: Array,
    follow: int,
    x: Array,
    innovation: Array,
    root: Array,
) -> None:
    nu, H, L = scratch(M), scratch(MN), scratch(WORK)
    Q_unit = load_matrix(Q, 0, N, N)
    y = load_vector(x, 0, N)
    W = identity(N)
    P = 0.0 * W
    for k in range(K):
        if k > 0:
            y, Phi, Q_step = advance(t[k - 1], t[k] - t[k - 1], count[k], load_vector(x, (k - 1) * N, N), p, Q_unit, scale[k])
            P = symmetric(Phi @ P @ Phi.T + Q_step)
            W = Phi @ W
        if not follow:
            y = load_vector(x, k * N, N)
        d = unit(-1, N)
        for row in range(first_row[k], first_row[k + 1]):
            whiten_row(row, station[row], t[k], y, z, sensor, numbers, R, correlated, p, nu, H, L)
            for i in range(M):
                at = row * M + i
                innovation[at] = nan
                store(root, at * N, unit(-1, N))
                if not isnan(nu[i]):
                    h = load_vector(H, i * N, N)
                    Ph = h @ P
                    S = h @ Ph + 1.0
                    g = h @ W
                    e = nu[i] - h @ d
                    gain = (1.0 / S) * Ph
                    innovation[at] = e / sqrt(S)
                    store(root, at * N, (1.0 / sqrt(S)) * g)
                    d = d + e * gain
                    B = P - outer(Ph, gain)
                    P = B + outer(gain, gain - h @ B)
                    W = W - outer(gain, g)
        if follow:
            store(x, k * N, y + d)


@entry
def predict_rows(
    K: int,
    t: Array,
    first_row: Indices,
    station: Indices,
    sensor: Indices,
    numbers: Array,
    p: Array,
    x: Array,
    z: Array,
) -> None:
    for k in range(K):
        state = load_vector(x, k * N, N)
        for row in range(first_row[k], first_row[k + 1]):
            s = station[row]
            measure_into(sensor[s], t[k], state, p, numbers, s * NUMBERS, z, row * M)
