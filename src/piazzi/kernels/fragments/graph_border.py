"""The full graph with its first state and its constants beside the chain."""

from piazzi.kernels.vocabulary import *  # noqa: F403


@entry
@sizes(start="N", defect="K N")
def border_solve(run: Run, start: Array, defect: Array, chain: Chain, border: Border, whole: Whole, damping: float) -> None:
    C, size = border.constants, N + border.constants
    begin_border(border)
    d = load_vector(start, 0, N)
    P = 0.0 * Q_matrix(run.Q)
    widest = 0.0
    for k in range(run.epochs):
        rows = range(run.first_row[k] * M, run.first_row[k + 1] * M)
        if k > 0:
            F = load_matrix(border.A, (k - 1) * N * N, N, N)
            P = symmetric(F @ P @ F.T + noise_at(k, run.scale[k], Q_matrix(run.Q), chain.Q_all))
            d = advance_border(k, d, load_vector(defect, k * N, N), border)
        record_belief(k, d, P, border, whole)
        for c in rows:
            if not isnan(chain.nu[c]):
                width = width_of_row(load_vector(chain.H, c * N, N), c * C, P, border)
                widest = inf if isnan(width) else maximum(widest, width)
        for c in rows:
            if not isnan(chain.nu[c]):
                d, P = update_bordered(load_vector(chain.H, c * N, N), chain.nu[c], c * C, 1, d, P, border)
        if damping > 0.0:
            for i in range(N):
                d, P = update_bordered(sqrt(damping) * load_vector(chain.scaling, i * N, N), 0.0, 0, 0, d, P, border)
    if damping > 0.0:
        for i in range(C):
            for j in range(size):
                border.row[j] = sqrt(damping) if j == N + i else 0.0
            value = -sqrt(damping) * border.offset[i] / border.sigma[i] if border.sigma[i] > 0.0 else 0.0
            rotate(border.R, border.y, border.row, value, size)
    solve_triangle(border.R, border.y, border.inverse, whole.unknowns, size)
    whole.widest[0] = widest


@entry
@sizes(nu="J M", out="Z K N")
def border_sensitivities(run: Run, chain: Chain, border: Border, nu: Array, out: Array) -> None:
    """Derivative of every smoothed state by each unknown: the chain solved with that unknown as its only cause."""
    none = unit(-1, N)
    C, sigma = border.constants, border.sigma
    P0 = 0.0 * Q_matrix(run.Q)
    for j in range(N + C):
        c = j - N
        for k in range(run.epochs):
            moves = c >= 0 and k + 1 < run.epochs
            store(chain.f, k * N, sigma[c] * load_vector(border.B, (k * C + c) * N, N) if moves else none)
            for i in range(run.first_row[k] * M, run.first_row[k + 1] * M):
                chain.nu[i] = nan if isnan(nu[i]) else (-sigma[c] * border.G[i * C + c] if c >= 0 else 0.0)
        first = load_vector(border.root, j * N, N) if c < 0 else none
        forward(0, run.epochs, run, chain, first, P0, 0.0)
        backward(0, run.epochs, run, chain, 0.0)
        for i in range(run.epochs * N):
            out[j * run.epochs * N + i] = chain.dx[i]
