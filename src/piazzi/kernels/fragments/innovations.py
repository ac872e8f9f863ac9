"""What each measurement added: its difference from the prediction by all others before it, and the variance of that."""

from piazzi.kernels.vocabulary import *  # noqa: F403


@inline
def record_epoch(k, t, first_row, z, station, sensor, numbers, R, p, x, d, P, nu, H, innovation, innovation_covariance):
    """z - h(x) - H d and H P H^T + R of all rows of epoch k, for predicted deviation d from x."""
    for row in range(first_row[k], first_row[k + 1]):
        s = station[row]
        innovate(sensor[s], t[k], x, p, numbers, s * NUMBERS, z, row * M, nu, H, 0)
        for i in range(M):
            nu[i] = nu[i] - load_vector(H, i * N, N) @ d
        record(row, nu, H, P, R, s * M * M, innovation, innovation_covariance)
