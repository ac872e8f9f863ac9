"""The full graph with its first state and its constants beside the chain."""

from piazzi.kernels.vocabulary import *  # noqa: F403


@entry
def border_solve(
    K: int,
    C: int,
    scale: Array,
    first_row: Indices,
    Q: Array,
    Q_all: Array,
    start: Array,
    root: Array,
    offset: Array,
    sigma: Array,
    defect: Array,
    A: Array,
    B: Array,
    nu: Array,
    H: Array,
    G: Array,
    damping: float,
    tether: Array,
    R: Array,
    y: Array,
    S: Array,
    row: Array,
    inverse: Array,
    W: Array,
    own: Array,
    b: Array,
    d_pred: Array,
    P_pred: Array,
    report: Array,
) -> None:
    size = N + C
    begin_border(C, root, R, y, S)
    d = load_vector(start, 0, N)
    P = 0.0 * Q_matrix(Q)
    widest = 0.0
    for k in range(K):
        if k > 0:
            F = load_matrix(A, (k - 1) * N * N, N, N)
            P = symmetric(F @ P @ F.T + noise_at(k, scale[k], Q_matrix(Q), Q_all))
            d = advance_border(k, C, F, d, load_vector(defect, k * N, N), B, offset, sigma, S)
        invert_upper(R, inverse, size)
        record_belief(k, C, d, P, offset, sigma, y, S, inverse, row, W, own, d_pred, P_pred)
        for c in range(first_row[k] * M, first_row[k + 1] * M):
            if not isnan(nu[c]):
                width = width_of_row(load_vector(H, c * N, N), G, c * C, C, P, sigma, S, inverse, row, size)
                widest = inf if isnan(width) else maximum(widest, width)
        for c in range(first_row[k] * M, first_row[k + 1] * M):
            if not isnan(nu[c]):
                h = load_vector(H, c * N, N)
                d, P = absorb_row(h, G, c * C, nu[c], C, d, P, offset, sigma, R, y, S, row, size)
        if damping > 0.0:
            for i in range(N):
                h = sqrt(damping) * load_vector(tether, i * N, N)
                d, P = absorb_row(h, G, 0, 0.0, 0, d, P, offset, sigma, R, y, S, row, size)
    if damping > 0.0:
        for i in range(C):
            for j in range(size):
                row[j] = sqrt(damping) if j == N + i else 0.0
            rotate(R, y, row, -sqrt(damping) * offset[i] / sigma[i] if sigma[i] > 0.0 else 0.0, size)
    invert_upper(R, inverse, size)
    for i in range(size):
        s = 0.0
        for j in range(i, size):
            s += inverse[i * size + j] * y[j]
        b[i] = s
    report[8] = widest


@entry
def border_sensitivities(
    K: int,
    C: int,
    scale: Array,
    first_row: Indices,
    Q: Array,
    Q_all: Array,
    root: Array,
    sigma: Array,
    A: Array,
    B: Array,
    nu: Array,
    H: Array,
    G: Array,
    zero: Array,
    f: Array,
    change: Array,
    tether: Array,
    d_pred: Array,
    P_pred: Array,
    gains: Array,
    multiplier: Array,
    out: Array,
) -> None:
    """Derivative of every smoothed state by each unknown: the chain solved with that unknown as its only cause."""
    none = load_vector(zero, 0, N)
    P0 = 0.0 * Q_matrix(Q)
    for j in range(N + C):
        c = j - N
        for k in range(K):
            store(f, k * N, sigma[c] * load_vector(B, (k * C + c) * N, N) if c >= 0 and k + 1 < K else none)
            for i in range(first_row[k] * M, first_row[k + 1] * M):
                change[i] = nan if isnan(nu[i]) else (-sigma[c] * G[i * C + c] if c >= 0 else 0.0)
        first = load_vector(root, j * N, N) if c < 0 else none
        forward(0, K, zero, scale, first_row, Q_matrix(Q), Q_all, f, A, change, H, first, P0, 0.0, tether, d_pred, P_pred)
        backward(0, K, first_row, A, change, H, 0.0, tether, d_pred, P_pred, gains, multiplier, d_pred)
        for i in range(K * N):
            out[j * K * N + i] = d_pred[i]
