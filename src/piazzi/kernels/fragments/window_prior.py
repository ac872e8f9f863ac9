"""Sliding window: what a state that leaves it says about the next one, which is then the oldest."""

from piazzi.kernels.vocabulary import *  # noqa: F403


@inline
def retire(a, base, t, count, scale, first_row, p, Q, x, nu, H, dx, m, P):
    """Prior of state a + 1 from the prior of state a; `base` is the state where the last linearisation begins."""
    last_step = load_vector(dx, (a - base) * N, N)
    linearized_at = load_vector(x, a * N, N) - last_step
    first = (first_row[a] - first_row[base]) * M
    d, P, _ = absorb_epoch(first, (first_row[a + 1] - first_row[base]) * M, m - linearized_at, P, nu, H)
    y, F, Q_step = advance(t[a], t[a + 1] - t[a], count[a + 1], load_vector(x, a * N, N), p, Q, scale[a + 1])
    return y + F @ (d - last_step), symmetric(F @ P @ F.T + Q_step)
