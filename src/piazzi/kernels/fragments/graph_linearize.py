"""The full factor graph, what depends on the model: linearisation with its cost, and innovations."""

from piazzi.kernels.vocabulary import *  # noqa: F403


@inline
def factor_noise(Q, factor):
    """Q = L D L^T with unit L; a direction without noise gets D = 0."""
    L, D = factor.L, factor.D
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
def weigh(defect, scale, factor, at, scaling, broken, largest, total):
    """Add the cost of a defect where there is noise; where there is none, keep it in `broken`, and the largest in sigmas."""
    y = scratch(N)
    store(y, 0, defect)
    for i in range(N):
        for k in range(i):
            y[i] = y[i] - factor.L[i * N + k] * y[k]
        variance = factor.D[i] * scale
        broken[at + i] = 0.0
        if variance > 0.0:
            total[0] += y[i] * y[i] / variance
        else:
            largest[0] = maximum(largest[0], fabs(y[i]) * scaling[i * N + i])
            broken[at + i] = fabs(y[i])


@inline
def weigh_dynamics(run, chain, broken, report):
    """The cost of all defects of the dynamics, and those without noise, into `broken`."""
    factor = Factor(scratch(NN), scratch(N))
    Q = Q_matrix(run.Q)
    report.dynamics[0] = 0.0
    factor_noise(Q, factor)
    for j in range(1, run.epochs):
        amount = run.scale[j]
        if noise_varies():
            factor_noise(noise_at(j, run.scale[j], Q, chain.Q_all), factor)
            amount = 1.0
        defect = load_vector(chain.x, j * N, N) - load_vector(chain.f, (j - 1) * N, N)
        weigh(defect, amount, factor, j * N, chain.scaling, broken, report.defect, report.dynamics)


@entry
@sizes(broken="K N")
def graph_linearize(run: Run, p: Given, measured: Measured, prior: Belief, chain: Chain, broken: Array, report: Report) -> None:
    factor = Factor(scratch(NN), scratch(N))
    report.prior[0] = 0.0
    report.defect[0] = 0.0
    linearize_dynamics(0, run.epochs, run, chain, p)
    report.measurement[0] = linearize_rows(0, run.epochs, run, chain, p, measured)
    factor_noise(load_matrix(prior.covariance, 0, N, N), factor)
    defect = load_vector(chain.x, 0, N) - load_vector(prior.mean, 0, N)
    weigh(defect, 1.0, factor, 0, chain.scaling, broken, report.defect, report.prior)
    weigh_dynamics(run, chain, broken, report)


@entry
@sizes(x="K N", d="D N", P="D N N")
def graph_innovations(
    run: Run, p: Given, measured: Measured, x: Array, d: Array, P: Array, step: int, innovations: Innovations
) -> None:
    for k in range(run.epochs):
        state, d_pred = load_vector(x, k * N, N), load_vector(d, k * step * N, N)
        P_pred = load_matrix(P, k * step * N * N, N, N)
        record_epoch(k, run, p, measured, state, d_pred, P_pred, innovations)
