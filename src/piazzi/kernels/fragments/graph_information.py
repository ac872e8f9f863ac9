"""The full graph solved in square-root information form."""

from piazzi.kernels.vocabulary import *  # noqa: F403


@entry
def graph_solve_information(
    K: int,
    scale: Array,
    first_row: Indices,
    Q: Array,
    m: Array,
    root: Array,
    x: Array,
    f: Array,
    Phi: Array,
    Q_all: Array,
    nu: Array,
    H: Array,
    tether: Array,
    damping: float,
    R: Array,
    y: Array,
    row: Array,
    F: Array,
    order: Array,
    G: Array,
    c: Array,
    L: Array,
    D: Array,
    A: Array,
    B: Array,
    work: Array,
    W: Array,
    V: Array,
    U: Array,
    d_pred: Array,
    P_pred: Array,
    multiplier: Array,
    dx: Array,
    covariance: Array,
    keep_cross: int,
    cross: Array,
    report: Array,
) -> None:
    fit = 0.0
    store(R, 0, 0.0 * identity(N))
    store(y, 0, unit(-1, N))
    start = load_matrix(root, 0, N, N)
    store(A, 0, start)
    store(B, 0, start @ (load_vector(m, 0, N) - load_vector(x, 0, N)))
    for i in range(N):
        store(row, 0, load_vector(A, i * N, N))
        rest = rotate_in(R, y, row, B[i])
        fit += rest * rest
    for k in range(K):
        if k > 0:
            noise_root(noise_at(k, scale[k], Q_matrix(Q), Q_all), L, D, G)
            store(c, 0, load_vector(f, (k - 1) * N, N) - load_vector(x, k * N, N))
            transposed_lu(Phi, k - 1, F, order, 1)
            step_information(R, y, F, order, G, c, A, B, work, W, V, U, k - 1)
        belief(R, y, A, d_pred, P_pred, k)
        for i in range(first_row[k] * M, first_row[k + 1] * M):
            if not isnan(nu[i]):
                store(row, 0, load_vector(H, i * N, N))
                rest = rotate_in(R, y, row, nu[i])
                fit += rest * rest
        if damping > 0.0:
            for i in range(N):
                store(row, 0, sqrt(damping) * load_vector(tether, i * N, N))
                rest = rotate_in(R, y, row, 0.0)
                fit += rest * rest
    invert_triangle(R, A)
    inverse = load_matrix(A, 0, N, N)
    delta = inverse @ load_vector(y, 0, N)
    P = symmetric(inverse @ inverse.T)
    lam = unit(-1, N)
    for b in range(K):
        k = K - 1 - b
        if b > 0:
            noise_root(noise_at(k + 1, scale[k + 1], Q_matrix(Q), Q_all), L, D, G)
            store(c, 0, load_vector(f, k * N, N) - load_vector(x, (k + 1) * N, N))
            delta, P, between = back_information(k, Phi, F, order, G, c, W, V, U, work, B, delta, P)
            lam = lam @ load_matrix(Phi, k * N * N, N, N)
            if keep_cross:
                store(cross, k * N * N, between)
        for i in range(first_row[k] * M, first_row[k + 1] * M):
            if not isnan(nu[i]):
                h = load_vector(H, i * N, N)
                lam = lam - (nu[i] - h @ delta) * h
        store(multiplier, k * N, lam)
        store(dx, k * N, delta)
        store(covariance, k * N * N, P)
    report[5] = fit
    largest = 0.0
    gradient = 0.0
    for k in range(K):
        for i in range(N):
            sigma2 = covariance[(k * N + i) * N + i]
            step = dx[k * N + i] * dx[k * N + i]
            largest = inf if isnan(step) else maximum(largest, step / sigma2 if sigma2 > 0.0 else 0.0)
        for i in range(first_row[k] * M, first_row[k + 1] * M):
            if not isnan(nu[i]):
                change = load_vector(H, i * N, N) @ load_vector(dx, k * N, N)
                gradient += change * change
    report[4] = gradient
    report[6] = sqrt(largest)
    report[7] = report[6]
