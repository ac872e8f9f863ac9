"""The extended Kalman filter over a whole run, with an innovation gate and iterated updates."""

from piazzi.kernels.vocabulary import *  # noqa: F403


@entry
def run_guarded_filter(
    run: Run, p: Given, measured: Measured, prior: Belief, gate: Gate, beliefs: Beliefs, innovations: Innovations
) -> None:
    x = load_vector(prior.mean, 0, N)
    P = load_matrix(prior.covariance, 0, N, N)
    Q = load_matrix(run.Q, 0, N, N)
    before = run.t_prior
    for k in range(run.epochs):
        if run.t[k] > before:
            x, Phi, Q_step = advance(before, run.t[k] - before, run.count[k], x, p, Q, run.scale[k])
            P = Phi @ P @ Phi.T + Q_step
        before = run.t[k]
        x, P = update_epoch_guarded(run, k, x, P, p, measured, gate, innovations)
        store(beliefs.mean, k * N, x)
        P = symmetric(P)
        store(beliefs.covariance, k * N * N, P)
