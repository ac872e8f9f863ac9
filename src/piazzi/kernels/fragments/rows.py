"""Rows of measurements at given states: without noise, and whitened with their derivatives by the state of their own epoch."""

from piazzi.kernels.vocabulary import *  # noqa: F403


@inline
def whiten_row(measured, row, t, x, p, own):
    """Innovation and Jacobian of one row at a state, in units of its noise."""
    s = measured.station[row]
    innovate_row(measured, row, t, x, p, own.nu, own.H, 0)
    if measured.correlated[s]:
        decorrelate(own.nu, own.H, 0, measured.R, s * M * M, own.work)
    else:
        for i in range(M):
            weight = 1.0 / sqrt(measured.R[(s * M + i) * M + i])
            own.nu[i] = weight * own.nu[i]
            store(own.H, i * N, weight * load_vector(own.H, i * N, N))


@entry
def whiten_rows(run: Run, p: Given, measured: Measured, seen: Observation) -> None:
    own = Row(scratch(M), scratch(MN), scratch(WORK))
    for k in range(run.epochs):
        x = load_vector(seen.states, k * N, N)
        for row in range(run.first_row[k], run.first_row[k + 1]):
            whiten_row(measured, row, run.t[k], x, p, own)
            for i in range(M):
                at = row * M + i
                seen.innovations[at] = own.nu[i]
                store(seen.rows, at * N, unit(-1, N) if isnan(own.nu[i]) else load_vector(own.H, i * N, N))


@entry
def predict_rows(run: Run, p: Given, measured: Measured, noiseless: Noiseless) -> None:
    for k in range(run.epochs):
        x = load_vector(noiseless.states, k * N, N)
        for row in range(run.first_row[k], run.first_row[k + 1]):
            measure_row(measured, row, run.t[k], x, p, noiseless.z, row * M)
