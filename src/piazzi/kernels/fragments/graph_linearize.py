"""The full factor graph, what depends on the model: linearisation with its cost, and innovations."""

from piazzi.kernels.vocabulary import *  # noqa: F403


@inline
def factor_noise(Q, L, D):
    """Q = L D L^T with unit L; a direction without noise gets D = 0."""
    store(L, 0, Q)
    for j in range(N):
        whole = L[j * N + j]
        pivot = whole
        for k in range(j):
            pivot = pivot - L[j * N + k] * L[j * N + k] * D[k]
        D[j] = pivot if pivot > 1e-13 * whole else 0.0
        for i in range(j + 1, N):
            s = L[i * N + j]
            for k in range(j):
                s = s - L[i * N + k] * L[j * N + k] * D[k]
            L[i * N + j] = s / D[j] if D[j] > 0.0 else 0.0


@inline
def weigh(defect, scale, L, D, at, tether, y, broken, report, slot):
    """Add the cost of a defect where there is noise; where there is none, keep it in `broken`, and the largest in report[3]."""
    store(y, 0, defect)
    for i in range(N):
        for k in range(i):
            y[i] = y[i] - L[i * N + k] * y[k]
        variance = D[i] * scale
        broken[at + i] = 0.0
        if variance > 0.0:
            report[slot] += y[i] * y[i] / variance
        else:
            report[3] = maximum(report[3], fabs(y[i]) * tether[i * N + i])
            broken[at + i] = fabs(y[i])


@inline
def weigh_dynamics(K, scale, Q, x, f, Q_all, tether, L, D, y, broken, report):
    """The cost of all defects of the dynamics, into report[1], and those without noise, into `broken`."""
    report[1] = 0.0
    factor_noise(Q, L, D)
    for j in range(1, K):
        amount = scale[j]
        if noise_varies():
            factor_noise(noise_at(j, scale[j], Q, Q_all), L, D)
            amount = 1.0
        defect = load_vector(x, j * N, N) - load_vector(f, (j - 1) * N, N)
        weigh(defect, amount, L, D, j * N, tether, y, broken, report, 1)


@entry
def graph_linearize(
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
    m: Array,
    P0: Array,
    x: Array,
    f: Array,
    Phi: Array,
    Q_all: Array,
    nu: Array,
    H: Array,
    tether: Array,
    broken: Array,
    report: Array,
) -> None:
    work, L, D, y = scratch(WORK), scratch(NN), scratch(N), scratch(N)
    report[2] = 0.0
    report[3] = 0.0
    linearize_dynamics(0, K, t, count, scale, p, Q_matrix(Q), x, f, Phi, Q_all)
    report[0] = linearize_rows(0, K, t, x, first_row, z, station, sensor, numbers, R, correlated, p, nu, H, work)
    factor_noise(load_matrix(P0, 0, N, N), L, D)
    weigh(load_vector(x, 0, N) - load_vector(m, 0, N), 1.0, L, D, 0, tether, y, broken, report, 2)
    weigh_dynamics(K, scale, Q_matrix(Q), x, f, Q_all, tether, L, D, y, broken, report)


@entry
def graph_innovations(
    K: int,
    t: Array,
    first_row: Indices,
    z: Array,
    station: Indices,
    sensor: Indices,
    numbers: Array,
    R: Array,
    correlated: Indices,
    p: Array,
    x: Array,
    d_pred: Array,
    P_pred: Array,
    step: int,
    innovation: Array,
    innovation_covariance: Array,
) -> None:
    nu, H = scratch(M), scratch(MN)
    for k in range(K):
        record_epoch(
            k,
            t,
            first_row,
            z,
            station,
            sensor,
            numbers,
            R,
            p,
            load_vector(x, k * N, N),
            load_vector(d_pred, k * step * N, N),
            load_matrix(P_pred, k * step * N * N, N, N),
            nu,
            H,
            innovation,
            innovation_covariance,
        )
