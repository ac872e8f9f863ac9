"""What the error of the steps does to a filter: a bias that every step adds to, and every measurement takes from."""

from piazzi.kernels.vocabulary import *  # noqa: F403


@entry
@sizes(finer="K")
def run_step_error(run: Run, finer: Indices, p: Given, measured: Measured, prior: Belief, beliefs: Beliefs) -> None:
    own = Row(scratch(M), scratch(MN), scratch(WORK))
    x = load_vector(prior.mean, 0, N)
    P = load_matrix(prior.covariance, 0, N, N)
    Q = load_matrix(run.Q, 0, N, N)
    bias = unit(-1, N)
    before = run.t_prior
    for k in range(run.epochs):
        if run.t[k] > before:
            dt = run.t[k] - before
            exact = propagate(before, dt, finer[k], x, p)
            x, Phi, Q_step = advance(before, dt, run.count[k], x, p, Q, run.scale[k])
            bias = Phi @ bias + (x - exact)
            P = Phi @ P @ Phi.T + Q_step
        before = run.t[k]
        d = unit(-1, N)
        P_new = P
        for row in range(run.first_row[k], run.first_row[k + 1]):
            s = measured.station[row]
            innovate_row(measured, row, run.t[k], x, p, own.nu, own.H, 0)
            for i in range(M):
                own.nu[i] = nan if isnan(own.nu[i]) else 0.0
            bias, _ = update_row(bias, P_new, s, measured, own)
            innovate_row(measured, row, run.t[k], x, p, own.nu, own.H, 0)
            d, P_new = update_row(d, P_new, s, measured, own)
        x = x + d
        P = symmetric(P_new)
        store(beliefs.mean, k * N, bias)
        store(beliefs.covariance, k * N * N, P)
