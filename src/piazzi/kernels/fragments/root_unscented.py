"""A root carried and measured by sigma points, x and x +- eta r_i: the unscented Kalman filter.

With o_i and s_i the odd and even parts of f(x +- eta r_i) - f(x), each over eta, and w = beta - alpha^2, the usual weights
(Julier and Uhlmann, Proc. IEEE 92, 2004; Wan and van der Merwe 2000) are, term by term,

    mean = f(x) + m,  m = sum of s_i / eta,     P = sum of o_i^T o_i + sum of s_i^T s_i + w m^T m,

which has no large weights of either sign to cancel.  The last two terms are the sum of q_i^T q_i, q_i = s_i + c sum of s_j,
where (1 + c N)^2 = 1 + w N / eta^2: a root, so P is semidefinite whatever the points gave.  Angles are differences from the
central point's, wrapped.  Points are drawn anew after process noise was added: those that were carried lack it.
"""

from piazzi.kernels.fragments.semidefinite import root_of
from piazzi.kernels.fragments.step_lanes import propagate_lanes
from piazzi.kernels.fragments.triangle import keep_root, triangularize_rows
from piazzi.kernels.vocabulary import *  # noqa: F403


@inline
def unknowns():
    """Unit variances that the measurements of an epoch depend on: those of the state, and as many for their curvature."""
    return 2 * N


@inline
def propagate_points(run, k, before, x, p, root):
    """The sigma points around `x` at epoch k, `LANES` at a time: x + eta r_i, then x - eta r_i."""
    points = root.points
    for i in range(N):
        step = root.eta * load_vector(root.U, i * N, N)
        store(points, i * N, x + step)
        store(points, (N + i) * N, x - step)
    groups = (2 * N + LANES - 1) // LANES
    for i in range(2 * N, groups * LANES):
        store(points, i * N, x)
    dt, count = run.t[k] - before, run.count[k]
    for g in range(groups):
        at = g * LANES * N
        store_lanes(points, at, N, propagate_lanes(before, dt, count, load_lanes(points, at, N, N, LANES), p))


@inline
def advance_root(run, k, before, x, p, Q, root):
    """The mean at epoch k; its root, in place, with the process noise along the central point."""
    eta, points, rows = root.eta, root.points, root.rows
    centre, _, Q_step = advance(before, run.t[k] - before, run.count[k], x, p, Q, run.scale[k])
    propagate_points(run, k, before, x, p, root)
    total = unit(-1, N)
    for i in range(N):
        plus = load_vector(points, i * N, N) - centre
        minus = load_vector(points, (N + i) * N, N) - centre
        even = (0.5 / eta) * (plus + minus)
        store(rows, i * N, (0.5 / eta) * (plus - minus))
        store(rows, (N + i) * N, even)
        total = total + even
    for i in range(N, 2 * N):
        store(rows, i * N, fused(root.share, total, load_vector(rows, i * N, N)))
    root_of(Q_step, rows, 2 * N * N)
    triangularize_rows(rows, 3 * N)
    keep_root(rows, root.U)
    return centre + (1.0 / eta) * total


@inline
def innovate_from(z, s, t, x, p, measured, own):
    """`z` less h(x) of station s, angles wrapped, into `own.nu`."""
    innovate(measured.sensor[s], t, x, p, measured.numbers, s * NUMBERS, z, 0, own.nu, own.H, 0)


@inline
def innovate_root(measured, row, t, x, p, root, own, joint):
    """Innovation of a row, and how it depends on the unknowns, o_i and s_i + c sum of s_j, into the rows of `joint.G`."""
    eta, nu, G, s = root.eta, own.nu, joint.G, measured.station[row]
    measure_row(measured, row, t, x, p, joint.centre, 0)
    for i in range(N):
        step = eta * load_vector(root.U, i * N, N)
        innovate_from(joint.centre, s, t, x + step, p, measured, own)
        for c in range(M):
            G[c * 2 * N + i] = -nu[c]
        innovate_from(joint.centre, s, t, x - step, p, measured, own)
        for c in range(M):
            plus = G[c * 2 * N + i]
            G[c * 2 * N + i] = (0.5 / eta) * (plus + nu[c])
            G[c * 2 * N + N + i] = (0.5 / eta) * (plus - nu[c])
    for c in range(M):
        total = 0.0
        for i in range(N):
            total += G[c * 2 * N + N + i]
        for i in range(N):
            G[c * 2 * N + N + i] = fused(root.share, total, G[c * 2 * N + N + i])
        joint.shifted[c] = measured.z[row * M + c] - total / eta
    innovate_from(joint.shifted, s, t, x, p, measured, own)
    for c in range(M):
        nu[c] = unless_missing(measured.z[row * M + c], nu[c])
