"""What measurements say about the first state: a filter that is told the first state, and its derivative by that state.

Started without any uncertainty, a filter has innovations that are white and depend on the first state through W = dx/dx[0].
Their whitened derivatives, one below the other, are a square root of the Fisher information of the first state: no prior is
needed, process noise may be singular, and without it the rows are H Phi in units of the noise.  (The augmented filter of
Rosenberg, Annals of Economic and Social Measurement 2, 1973, and de Jong, Annals of Statistics 19, 1991.)
"""

from piazzi.kernels.vocabulary import *  # noqa: F403


@entry
def observe(run: Run, p: Given, measured: Measured, follow: int, seen: Observation) -> None:
    own = Row(scratch(M), scratch(MN), scratch(WORK))
    Q = load_matrix(run.Q, 0, N, N)
    y = load_vector(seen.states, 0, N)
    W = identity(N)
    P = 0.0 * W
    for k in range(run.epochs):
        if k > 0:
            x = load_vector(seen.states, (k - 1) * N, N)
            y, Phi, Q_step = advance(run.t[k - 1], run.t[k] - run.t[k - 1], run.count[k], x, p, Q, run.scale[k])
            P = symmetric(Phi @ P @ Phi.T + Q_step)
            W = Phi @ W
        if not follow:
            y = load_vector(seen.states, k * N, N)
        d = unit(-1, N)
        for row in range(run.first_row[k], run.first_row[k + 1]):
            whiten_row(measured, row, run.t[k], y, p, own)
            for i in range(M):
                at = row * M + i
                seen.innovations[at] = nan
                store(seen.rows, at * N, unit(-1, N))
                if not isnan(own.nu[i]):
                    h = load_vector(own.H, i * N, N)
                    Ph = h @ P
                    S = h @ Ph + 1.0
                    g = h @ W
                    e = own.nu[i] - h @ d
                    gain = (1.0 / S) * Ph
                    seen.innovations[at] = e / sqrt(S)
                    store(seen.rows, at * N, (1.0 / sqrt(S)) * g)
                    d = d + e * gain
                    B = P - outer(Ph, gain)
                    P = B + outer(gain, gain - h @ B)
                    W = W - outer(gain, g)
        if follow:
            store(seen.states, k * N, y + d)
