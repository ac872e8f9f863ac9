"""All measurements of one epoch."""

from piazzi.kernels.vocabulary import *  # noqa: F403


@inline
def record(row, P, measured, own, innovations):
    """Write z - h and S = H P H^T + R of one row, NaN where a component is missing."""
    at = measured.station[row] * M * M
    for i in range(M):
        innovations.nu[row * M + i] = own.nu[i]
        Ph = load_vector(own.H, i * N, N) @ P
        for j in range(M):
            s = Ph @ load_vector(own.H, j * N, N) + measured.R[at + i * M + j]
            innovations.S[(row * M + i) * M + j] = nan if isnan(own.nu[i]) or isnan(own.nu[j]) else s


@inline
def record_variance_ratio(row, measured, innovations, widest):
    """Keep the largest predicted variance of a component that is there, in units of its noise."""
    for i in range(M):
        s = innovations.S[(row * M + i) * M + i]
        if not isnan(s):
            widest[0] = maximum(widest[0], s / measured.R[(measured.station[row] * M + i) * M + i])


@inline
def update_epoch(run, k, x, P, p, measured, innovations):
    """All rows of epoch k, linearised once, at the predicted state: so they commute."""
    own = Row(scratch(M), scratch(MN), scratch(WORK))
    P_pred = P
    d = unit(-1, N)
    for row in range(run.first_row[k], run.first_row[k + 1]):
        innovate_row(measured, row, run.t[k], x, p, own.nu, own.H, 0)
        record(row, P_pred, measured, own, innovations)
        d, P = update_row(d, P, measured.station[row], measured, own)
    return x + d, P
