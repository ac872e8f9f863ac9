"""Sliding window over a whole run."""

from piazzi.kernels.vocabulary import *  # noqa: F403


@entry
@sizes(begin="K")
def run_window(
    begin: Indices,
    window: Window,
    run: Run,
    p: Given,
    measured: Measured,
    chain: Chain,
    beliefs: Beliefs,
    innovations: Innovations,
) -> None:
    t, x = run.t, chain.x
    if t[0] > run.t_prior:
        m, P = load_vector(window.m, 0, N), load_matrix(window.P, 0, N, N)
        m, F, Q_step = advance(run.t_prior, t[0] - run.t_prior, run.count[0], m, p, Q_matrix(run.Q), run.scale[0])
        store(window.m, 0, m)
        store(window.P, 0, symmetric(F @ P @ F.T + Q_step))
    store(x, 0, load_vector(window.m, 0, N))
    a = 0
    for k in range(run.epochs):
        if k > 0:
            store(x, k * N, propagate(t[k - 1], t[k] - t[k - 1], run.count[k], load_vector(x, (k - 1) * N, N), p))
            base = a
            while a < begin[k]:
                marginalize_oldest(a, base, window, run, p, chain)
                a += 1
        P = solve_window(a, k, window, run, p, measured, chain, innovations)
        store(beliefs.mean, k * N, load_vector(x, k * N, N))
        store(beliefs.covariance, k * N * N, P)
        if k + 1 == run.epochs or begin[k + 1] > a + 1:
            marginal_covariances(a, k - a + 1, run, chain, P, 0, window.delayed, window.delayed)
