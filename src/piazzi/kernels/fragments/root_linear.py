"""A root carried and measured by Jacobians: the extended Kalman filter."""

from piazzi.kernels.fragments.semidefinite import root_of
from piazzi.kernels.fragments.triangle import keep_root, triangularize_rows
from piazzi.kernels.vocabulary import *  # noqa: F403


@inline
def unknowns():
    """Unit variances that the measurements of an epoch depend on: those of the state."""
    return N


@inline
def advance_root(t, dt, count, x, U, p, Q, scale, points, rows, settings):
    """The next state; its root, in place: of Phi P Phi^T + Q."""
    x, Phi, Q_step = advance(t, dt, count, x, p, Q, scale)
    for i in range(N):
        store(rows, i * N, Phi @ load_vector(U, i * N, N))
    root_of(Q_step, rows, N * N)
    triangularize_rows(rows, 2 * N)
    keep_root(rows, U)
    return x


@inline
def sense(s, t, x, U, p, z, row, sensor, numbers, nu, H, G, seen, settings):
    """Innovation `nu` of a row, and how it depends on the unknowns, H r_i, into the rows of `G`."""
    innovate(sensor[s], t, x, p, numbers, s * NUMBERS, z, row * M, nu, H, 0)
    for c in range(M):
        for i in range(N):
            G[c * N + i] = load_vector(H, c * N, N) @ load_vector(U, i * N, N)
