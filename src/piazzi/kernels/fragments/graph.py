"""The full factor graph, what depends on sizes only: solution of the linearised chain, covariances.

Python decides about steps in between.
"""

from piazzi.kernels.vocabulary import *  # noqa: F403


@entry
@sizes(P_last="N N")
def graph_solve(run: Run, prior: Belief, chain: Chain, P_last: Array, report: Report, damping: float) -> None:
    K = run.epochs
    m, P_first = load_vector(prior.mean, 0, N), load_matrix(prior.covariance, 0, N, N)
    _, P, fit = forward(0, K, run, chain, m, P_first, damping)
    store(P_last, 0, P)
    report.fit[0] = fit
    backward(0, K, run, chain, damping)
    gradient = 0.0
    for k in range(K):
        for c in range(run.first_row[k] * M, run.first_row[k + 1] * M):
            if not isnan(chain.nu[c]):
                change = load_vector(chain.H, c * N, N) @ load_vector(chain.dx, k * N, N)
                gradient += change * change
    report.gradient[0] = gradient
    largest = 0.0
    for j in range(K):
        for i in range(N):
            sigma2 = chain.P_pred[(j * N + i) * N + i]
            step = chain.dx[j * N + i] * chain.dx[j * N + i]
            if sigma2 > 0.0:
                largest = maximum(largest, step / sigma2)
            elif step > 0.0:
                largest = inf
            if isnan(step):
                largest = inf
    report.step[0] = sqrt(largest)


@entry
@sizes(P_last="N N")
def graph_marginals(run: Run, chain: Chain, P_last: Array, smoothed: Smoothed, report: Report) -> None:
    K, covariance = run.epochs, smoothed.covariance
    last = load_matrix(P_last, 0, N, N)
    marginal_covariances(0, K, run, chain, last, smoothed.keep_cross, covariance, smoothed.cross)
    largest = 0.0
    for j in range(K):
        for i in range(N):
            sigma2 = covariance[(j * N + i) * N + i]
            if sigma2 > 0.0:
                largest = maximum(largest, chain.dx[j * N + i] * chain.dx[j * N + i] / sigma2)
    report.step_smoothed[0] = sqrt(largest)


@entry
def graph_probe(run: Run, chain: Chain, report: Report) -> None:
    widest = 0.0
    for k in range(run.epochs):
        P = load_matrix(chain.P_pred, k * N * N, N, N)
        for i in range(run.first_row[k] * M, run.first_row[k + 1] * M):
            if not isnan(chain.nu[i]):
                h = load_vector(chain.H, i * N, N)
                S = h @ (h @ P)
                widest = inf if isnan(S) else maximum(widest, S)
    report.widest[0] = widest
