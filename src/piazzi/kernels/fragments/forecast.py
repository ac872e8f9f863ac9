"""A belief carried forward without measurements, to one time after the other, each in equal parts."""

from piazzi.kernels.vocabulary import *  # noqa: F403


@entry
@sizes(parts="K")
def run_forecast(run: Run, parts: Indices, p: Given, last: Belief, beliefs: Beliefs) -> None:
    x = load_vector(last.mean, 0, N)
    P = load_matrix(last.covariance, 0, N, N)
    Q = load_matrix(run.Q, 0, N, N)
    before = run.t_prior
    for k in range(run.epochs):
        if run.t[k] > before:
            h = (run.t[k] - before) / parts[k]
            for i in range(parts[k]):
                x, Phi, Q_step = advance(before + i * h, h, run.count[k], x, p, Q, run.scale[k])
                P = symmetric(Phi @ P @ Phi.T + Q_step)
        before = run.t[k]
        store(beliefs.mean, k * N, x)
        store(beliefs.covariance, k * N * N, P)
