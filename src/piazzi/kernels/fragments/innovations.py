"""What each measurement added: its difference from the prediction by all others before it, and the variance of that."""

from piazzi.kernels.vocabulary import *  # noqa: F403


@inline
def record_epoch(k, run, p, measured, x, d, P, innovations):
    """z - h(x) - H d and H P H^T + R of all rows of epoch k, for predicted deviation d from x."""
    own = Row(scratch(M), scratch(MN), scratch(WORK))
    for row in range(run.first_row[k], run.first_row[k + 1]):
        innovate_row(measured, row, run.t[k], x, p, own.nu, own.H, 0)
        for i in range(M):
            own.nu[i] = own.nu[i] - load_vector(own.H, i * N, N) @ d
        record(row, P, measured, own, innovations)
