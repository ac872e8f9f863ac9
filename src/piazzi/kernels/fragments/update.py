"""One measurement of a belief, in place."""

from piazzi.kernels.vocabulary import *  # noqa: F403


@entry
def update_once(
    s: int,
    t: float,
    z: Array,
    sensor: Indices,
    numbers: Array,
    R: Array,
    correlated: Indices,
    p: Array,
    mean: Array,
    covariance: Array,
    innovation: Array,
    innovation_covariance: Array,
) -> None:
    nu, H, work = scratch(M), scratch(MN), scratch(WORK)
    x = load_vector(mean, 0, N)
    P = load_matrix(covariance, 0, N, N)
    innovate(sensor[s], t, x, p, numbers, s * NUMBERS, z, 0, nu, H, 0)
    record(0, nu, H, P, R, s * M * M, innovation, innovation_covariance)
    d, P_new = absorb(unit(-1, N), P, nu, H, R, s * M * M, correlated[s], work)
    store(mean, 0, x + d)
    store(covariance, 0, symmetric(P_new))
