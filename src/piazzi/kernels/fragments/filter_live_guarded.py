"""The measurements of an epoch so far, taken together, with an innovation gate and iterated updates."""

from piazzi.kernels.vocabulary import *  # noqa: F403


@entry
def live_update_guarded(
    rows: int,
    clock: Array,
    z: Array,
    station: Indices,
    sensor: Indices,
    numbers: Array,
    R: Array,
    correlated: Indices,
    p: Array,
    iterations: int,
    gate: Array,
    rejected: Indices,
    x_pred: Array,
    P_pred: Array,
    mean: Array,
    covariance: Array,
    innovation: Array,
    innovation_covariance: Array,
    widest: Array,
) -> None:
    nu, H, work = scratch(M), scratch(MN), scratch(WORK)
    x, P = update_epoch_guarded(
        0,
        rows,
        clock[3],
        load_vector(x_pred, 0, N),
        load_matrix(P_pred, 0, N, N),
        p,
        z,
        station,
        sensor,
        numbers,
        R,
        correlated,
        nu,
        H,
        work,
        iterations,
        gate,
        rejected,
        innovation,
        innovation_covariance,
    )
    for row in range(rows):
        if rejected[row] == 0:
            note_width(row, R, station[row] * M * M, innovation_covariance, widest)
    store(mean, 0, x)
    store(covariance, 0, symmetric(P))
