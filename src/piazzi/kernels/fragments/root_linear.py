"""A root carried and measured by Jacobians: the extended Kalman filter."""

from piazzi.kernels.fragments.semidefinite import root_of
from piazzi.kernels.fragments.triangle import keep_root, triangularize_rows
from piazzi.kernels.vocabulary import *  # noqa: F403


@inline
def unknowns():
    """Unit variances that the measurements of an epoch depend on: those of the state."""
    return N


@inline
def advance_root(run, k, before, x, p, Q, root):
    """The state at epoch k; its root, in place: of Phi P Phi^T + Q."""
    x, Phi, Q_step = advance(before, run.t[k] - before, run.count[k], x, p, Q, run.scale[k])
    for i in range(N):
        store(root.rows, i * N, Phi @ load_vector(root.U, i * N, N))
    root_of(Q_step, root.rows, N * N)
    triangularize_rows(root.rows, 2 * N)
    keep_root(root.rows, root.U)
    return x


@inline
def innovate_root(measured, row, t, x, p, root, own, joint):
    """Innovation of a row, and how it depends on the unknowns, H r_i, into the rows of `joint.G`."""
    innovate_row(measured, row, t, x, p, own.nu, own.H, 0)
    for c in range(M):
        for i in range(N):
            joint.G[c * N + i] = load_vector(own.H, c * N, N) @ load_vector(root.U, i * N, N)
