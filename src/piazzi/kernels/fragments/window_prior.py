"""Sliding window: what a state that leaves it says about the next one, which is then the oldest."""

from piazzi.kernels.vocabulary import *  # noqa: F403


@inline
def marginalize_oldest(a, base, window, run, p, chain):
    """Prior of state a + 1 from the prior of state a; `base` is the state where the last linearisation begins."""
    m, P = load_vector(window.m, 0, N), load_matrix(window.P, 0, N, N)
    x = load_vector(chain.x, a * N, N)
    last_step = load_vector(chain.dx, (a - base) * N, N)
    first = (run.first_row[a] - run.first_row[base]) * M
    d, P, _ = update_deviation(first, (run.first_row[a + 1] - run.first_row[base]) * M, m - (x - last_step), P, chain)
    dt = run.t[a + 1] - run.t[a]
    y, F, Q_step = advance(run.t[a], dt, run.count[a + 1], x, p, Q_matrix(run.Q), run.scale[a + 1])
    store(window.m, 0, y + F @ (d - last_step))
    store(window.P, 0, symmetric(F @ P @ F.T + Q_step))
