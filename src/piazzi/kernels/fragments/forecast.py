"""A belief carried forward without measurements, to one time after the other, each in equal parts."""

from piazzi.kernels.vocabulary import *  # noqa: F403


@entry
def run_forecast(
    K: int,
    t: Array,
    t_start: float,
    parts: Indices,
    count: Indices,
    scale: Array,
    p: Array,
    Q: Array,
    x0: Array,
    P0: Array,
    mean: Array,
    covariance: Array,
) -> None:
    x = load_vector(x0, 0, N)
    P = load_matrix(P0, 0, N, N)
    Q_unit = load_matrix(Q, 0, N, N)
    before = t_start
    for k in range(K):
        if t[k] > before:
            h = (t[k] - before) / parts[k]
            for i in range(parts[k]):
                x, Phi, Q_step = advance(before + i * h, h, count[k], x, p, Q_unit, scale[k])
                P = symmetric(Phi @ P @ Phi.T + Q_step)
        before = t[k]
        store(mean, k * N, x)
        store(covariance, k * N * N, P)
