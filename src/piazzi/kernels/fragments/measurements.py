"""What all stations measure along given states, without noise."""

from piazzi.kernels.vocabulary import *  # noqa: F403


@entry
@sizes(states="K N")
def run_measurements(run: Run, p: Given, measured: Measured, states: Array) -> None:
    for k in range(run.epochs):
        x = load_vector(states, k * N, N)
        for row in range(run.first_row[k], run.first_row[k + 1]):
            measure_row(measured, row, run.t[k], x, p, measured.z, row * M)
