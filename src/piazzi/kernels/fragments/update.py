"""One measurement of a belief, in place."""

from piazzi.kernels.vocabulary import *  # noqa: F403


@entry
def update_once(t: float, p: Given, measured: Measured, belief: Belief, innovations: Innovations) -> None:
    own = Row(scratch(M), scratch(MN), scratch(WORK))
    x = load_vector(belief.mean, 0, N)
    P = load_matrix(belief.covariance, 0, N, N)
    innovate_row(measured, 0, t, x, p, own.nu, own.H, 0)
    record(0, P, measured, own, innovations)
    d, P_new = update_row(unit(-1, N), P, measured.station[0], measured, own)
    store(belief.mean, 0, x + d)
    store(belief.covariance, 0, symmetric(P_new))
