"""All measurements of one epoch."""

from piazzi.kernels.vocabulary import *  # noqa: F403


@inline
def record(row, nu, H, P, R, at, innovation, innovation_covariance):
    """Write z - h and S = H P H^T + R of one row, NaN where a component is missing."""
    for i in range(M):
        innovation[row * M + i] = nu[i]
        Ph = load_vector(H, i * N, N) @ P
        for j in range(M):
            s = Ph @ load_vector(H, j * N, N) + R[at + i * M + j]
            innovation_covariance[(row * M + i) * M + j] = nan if isnan(nu[i]) or isnan(nu[j]) else s


@inline
def note_width(row, R, at, innovation_covariance, widest):
    """Keep the largest predicted variance of a component that is there, in units of its noise."""
    for i in range(M):
        s = innovation_covariance[(row * M + i) * M + i]
        if not isnan(s):
            widest[0] = maximum(widest[0], s / R[at + i * M + i])


@inline
def update_epoch(
    first, last, t, x, P, p, z, station, sensor, numbers, R, correlated, nu, H, work, innovation, innovation_covariance
):
    """All rows of one epoch, linearised once, at the predicted state: so they commute."""
    P_pred = P
    d = unit(-1, N)
    for row in range(first, last):
        s = station[row]
        innovate(sensor[s], t, x, p, numbers, s * NUMBERS, z, row * M, nu, H, 0)
        record(row, nu, H, P_pred, R, s * M * M, innovation, innovation_covariance)
        d, P = absorb(d, P, nu, H, R, s * M * M, correlated[s], work)
    return x + d, P
