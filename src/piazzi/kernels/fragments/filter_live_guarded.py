"""The measurements of an epoch so far, taken together, with an innovation gate and iterated updates."""

from piazzi.kernels.vocabulary import *  # noqa: F403


@entry
@sizes(widest="1")
def live_update_guarded(
    run: Run,
    p: Given,
    measured: Measured,
    gate: Gate,
    predicted: Belief,
    now: Belief,
    innovations: Innovations,
    widest: Array,
) -> None:
    x, P = load_vector(predicted.mean, 0, N), load_matrix(predicted.covariance, 0, N, N)
    x, P = update_epoch_guarded(run, 0, x, P, p, measured, gate, innovations)
    for row in range(run.first_row[1]):
        if gate.rejected[row] != 1:
            record_variance_ratio(row, measured, innovations, widest)
    store(now.mean, 0, x)
    store(now.covariance, 0, symmetric(P))
