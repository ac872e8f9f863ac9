"""Draw a truth and its measurements: process noise is fed back into the state that is propagated and measured."""

from piazzi.kernels.vocabulary import *  # noqa: F403


@inline
def factor_in_place(L):
    """Lower Cholesky factor of the semidefinite matrix in `L`; a direction without noise gets a zero column."""
    for j in range(N):
        variance = L[j * N + j]
        pivot = variance
        for k in range(j):
            pivot = pivot - L[j * N + k] * L[j * N + k]
        pivot = sqrt(pivot) if pivot > 1e-13 * variance else 0.0
        L[j * N + j] = pivot
        for i in range(j + 1, N):
            s = L[i * N + j]
            for k in range(j):
                s = s - L[i * N + k] * L[j * N + k]
            L[i * N + j] = s / pivot if pivot > 0.0 else 0.0
            L[j * N + i] = 0.0


@entry
@sizes(first="N", w="K N", L="N N", truth="K N")
def run_simulation(run: Run, p: Given, measured: Measured, first: Array, w: Array, L: Array, truth: Array) -> None:
    x = load_vector(first, 0, N)
    Q = load_matrix(run.Q, 0, N, N)
    before = run.t_prior
    for k in range(run.epochs):
        if run.t[k] > before:
            start = x
            x = propagate(before, run.t[k] - before, run.count[k], start, p)
            _, _, Q_step = advance(before, run.t[k] - before, run.count[k], start, p, Q, run.scale[k])
            store(L, 0, Q_step)
            factor_in_place(L)
            x = x + load_matrix(L, 0, N, N) @ load_vector(w, k * N, N)
        before = run.t[k]
        store(truth, k * N, x)
        for row in range(run.first_row[k], run.first_row[k + 1]):
            measure_row(measured, row, run.t[k], x, p, measured.z, row * M)
