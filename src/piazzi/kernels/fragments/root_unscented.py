"""A root carried and measured by sigma points, x and x +- eta r_i: the unscented Kalman filter.

With o_i and s_i the odd and even parts of f(x +- eta r_i) - f(x), each over eta, and w = beta - alpha^2, the usual weights
(Julier and Uhlmann, Proc. IEEE 92, 2004; Wan and van der Merwe 2000) are, term by term,

    mean = f(x) + m,  m = sum of s_i / eta,     P = sum of o_i^T o_i + sum of s_i^T s_i + w m^T m,

which has no large weights of either sign to cancel.  The last two terms are the sum of q_i^T q_i, q_i = s_i + c sum of s_j,
where (1 + c N)^2 = 1 + w N / eta^2: a root, so P is semidefinite whatever the points gave.  Angles are differences from the
central point's, wrapped.  Points are drawn anew after process noise was added: those that were carried lack it.
"""

from piazzi.kernels.fragments.semidefinite import root_of
from piazzi.kernels.fragments.triangle import keep_root, triangularize_rows
from piazzi.kernels.vocabulary import *  # noqa: F403


@inline
def unknowns():
    """Unit variances that the measurements of an epoch depend on: those of the state, and as many for their curvature."""
    return 2 * N


@inline
def carry_points(t, dt, count, x, U, p, eta, points):
    """The sigma points around `x` after `dt` seconds, `LANES` at a time: x + eta r_i, then x - eta r_i."""
    for i in range(N):
        step = eta * load_vector(U, i * N, N)
        store(points, i * N, x + step)
        store(points, (N + i) * N, x - step)
    groups = (2 * N + LANES - 1) // LANES
    for i in range(2 * N, groups * LANES):
        store(points, i * N, x)
    for g in range(groups):
        at = g * LANES * N
        store_lanes(points, at, N, travel(t, dt, count, load_lanes(points, at, N, N, LANES), p))


@inline
def advance_root(t, dt, count, x, U, p, Q, scale, points, rows, settings):
    """The next mean; its root, in place, with the process noise along the central point."""
    eta = settings[0]
    centre, _, Q_step = advance(t, dt, count, x, p, Q, scale)
    carry_points(t, dt, count, x, U, p, eta, points)
    total = unit(-1, N)
    for i in range(N):
        plus = load_vector(points, i * N, N) - centre
        minus = load_vector(points, (N + i) * N, N) - centre
        even = (0.5 / eta) * (plus + minus)
        store(rows, i * N, (0.5 / eta) * (plus - minus))
        store(rows, (N + i) * N, even)
        total = total + even
    for i in range(N, 2 * N):
        store(rows, i * N, load_vector(rows, i * N, N) + settings[1] * total)
    root_of(Q_step, rows, 2 * N * N)
    triangularize_rows(rows, 3 * N)
    keep_root(rows, U)
    return centre + (1.0 / eta) * total


@inline
def difference(s, t, x, p, sensor, numbers, nu, H, seen):
    """h(x) less the central point's in `seen`, angles wrapped, into `nu` with the sign turned."""
    innovate(sensor[s], t, x, p, numbers, s * NUMBERS, seen, 0, nu, H, 0)


@inline
def sense(s, t, x, U, p, z, row, sensor, numbers, nu, H, G, seen, settings):
    """Innovation `nu` of a row, and how it depends on the unknowns, o_i and s_i + c sum of s_j, into the rows of `G`."""
    eta = settings[0]
    measure_into(sensor[s], t, x, p, numbers, s * NUMBERS, seen, 0)
    for i in range(N):
        step = eta * load_vector(U, i * N, N)
        difference(s, t, x + step, p, sensor, numbers, nu, H, seen)
        for c in range(M):
            G[c * 2 * N + i] = -nu[c]
        difference(s, t, x - step, p, sensor, numbers, nu, H, seen)
        for c in range(M):
            plus = G[c * 2 * N + i]
            G[c * 2 * N + i] = (0.5 / eta) * (plus + nu[c])
            G[c * 2 * N + N + i] = (0.5 / eta) * (plus - nu[c])
    for c in range(M):
        total = 0.0
        for i in range(N):
            total += G[c * 2 * N + N + i]
        for i in range(N):
            G[c * 2 * N + N + i] += settings[1] * total
        seen[M + c] = z[row * M + c] - total / eta
    innovate(sensor[s], t, x, p, numbers, s * NUMBERS, seen, M, nu, H, 0)
    for c in range(M):
        nu[c] = unless_missing(z[row * M + c], nu[c])
