"""Two-body orbits fitted to rows of tracking from many starts: Levenberg and Marquardt's method on an upper triangle.

Unknowns are position and velocity at time zero, and one constant that all rates share (a carrier that is off).  A row has
20 numbers: time, kind, place and velocity of the observer, what was measured (9), two standard deviations, and whether the
constant is in it.  Kinds: 1 a distance, 2 its rate, 3 a direction
(residuals along two unit vectors across it and along itself, so that what lies behind the observer counts as far off),
4 a position.  Light takes its time from the body to the observer.
"""

from piazzi.kernels.fragments.kepler import kepler_partials
from piazzi.kernels.vocabulary import *  # noqa: F403


@inline
def folded(w, T, at):
    """One row of 7 derivatives and a residual, at `at`, taken into the triangle at `T` (7 rows of 8) by Givens rotations."""
    for i in range(7):
        b = w[at + i]
        if b != 0.0:
            a = w[T + 8 * i + i]
            size = sqrt(a * a + b * b)
            c, s = a / size, b / size
            for k in range(i, 8):
                upper, lower = w[T + 8 * i + k], w[at + k]
                w[T + 8 * i + k] = c * upper + s * lower
                w[at + k] = c * lower - s * upper


@outlined
def fit_row(w, x, rows, at, mu, per_c):
    """Residual rows (observed - computed, derivatives of what is computed, in units of sigma) at 16, and how many."""
    x0, x1, x2, v0, v1, v2 = w[x], w[x + 1], w[x + 2], w[x + 3], w[x + 4], w[x + 5]
    r0 = sqrt(x0 * x0 + x1 * x1 + x2 * x2)
    sigma = x0 * v0 + x1 * v1 + x2 * v2
    square = v0 * v0 + v1 * v1 + v2 * v2
    kind = rows[at + 1]
    t = rows[at]
    if kind != 4.0 and per_c > 0.0:  # one step is enough: the range changes by v/c of what the time does
        F, G, _, _, _, _, _, _ = kepler_partials(r0, sigma, square, mu, t)
        d0 = F * x0 + G * v0 - rows[at + 2]
        d1 = F * x1 + G * v1 - rows[at + 3]
        d2 = F * x2 + G * v2 - rows[at + 4]
        t = t - per_c * sqrt(d0 * d0 + d1 * d1 + d2 * d2)
    F, G, Ft, Gt, dF, dG, dFt, dGt = kepler_partials(r0, sigma, square, mu, t)
    # position p and velocity q there; columns of their derivatives are made as they are wanted
    p0, p1, p2 = F * x0 + G * v0, F * x1 + G * v1, F * x2 + G * v2
    q0, q1, q2 = Ft * x0 + Gt * v0, Ft * x1 + Gt * v1, Ft * x2 + Gt * v2
    d0, d1, d2 = p0 - rows[at + 2], p1 - rows[at + 3], p2 - rows[at + 4]
    rho = sqrt(d0 * d0 + d1 * d1 + d2 * d2)
    u0, u1, u2 = d0 / rho, d1 / rho, d2 / rho
    e0, e1, e2 = q0 - rows[at + 5], q1 - rows[at + 6], q2 - rows[at + 7]
    rate = u0 * e0 + u1 * e1 + u2 * e2
    count = 1
    if kind >= 3.0:
        count = 3
    for k in range(count):
        # residual k is a function of position with gradient a and of velocity with gradient b
        a0, a1, a2, b0, b1, b2 = u0, u1, u2, 0.0, 0.0, 0.0
        s = rows[at + 17]
        off = rows[at + 8] - rho
        if kind == 2.0:
            a0, a1, a2 = (e0 - rate * u0) / rho, (e1 - rate * u1) / rho, (e2 - rate * u2) / rho
            b0, b1, b2 = u0, u1, u2
            off = rows[at + 8] - rate - rows[at + 19] * w[x + 6]
        elif kind == 3.0:
            n0, n1, n2 = rows[at + 8 + 3 * k], rows[at + 9 + 3 * k], rows[at + 10 + 3 * k]
            on = n0 * u0 + n1 * u1 + n2 * u2
            a0, a1, a2 = (n0 - on * u0) / rho, (n1 - on * u1) / rho, (n2 - on * u2) / rho
            off = -on
            if k == 1:
                s = rows[at + 18]
            elif k == 2:
                off = 1.0 - on
                s = maximum(s, rows[at + 18])
        elif kind == 4.0:
            a0, a1, a2 = 0.0, 0.0, 0.0
            if k == 0:
                a0, off = 1.0, rows[at + 8] - p0
            elif k == 1:
                a1, off = 1.0, rows[at + 9] - p1
            else:
                a2, off = 1.0, rows[at + 10] - p2
        # through p = F r + G v and q = F' r + G' v, whose coefficients depend on r0, sigma, beta
        ar = a0 * x0 + a1 * x1 + a2 * x2
        av = a0 * v0 + a1 * v1 + a2 * v2
        br = b0 * x0 + b1 * x1 + b2 * x2
        bv = b0 * v0 + b1 * v1 + b2 * v2
        by_r0 = ar * dF[0] + av * dG[0] + br * dFt[0] + bv * dGt[0]
        by_sigma = ar * dF[1] + av * dG[1] + br * dFt[1] + bv * dGt[1]
        by_beta = ar * dF[2] + av * dG[2] + br * dFt[2] + bv * dGt[2]
        on_r = by_r0 / r0 - 2.0 * mu / (r0 * r0 * r0) * by_beta
        to = 16 + 8 * k
        w[to] = (F * a0 + Ft * b0 + on_r * x0 + by_sigma * v0) / s
        w[to + 1] = (F * a1 + Ft * b1 + on_r * x1 + by_sigma * v1) / s
        w[to + 2] = (F * a2 + Ft * b2 + on_r * x2 + by_sigma * v2) / s
        w[to + 3] = (G * a0 + Gt * b0 + by_sigma * x0 - 2.0 * by_beta * v0) / s
        w[to + 4] = (G * a1 + Gt * b1 + by_sigma * x1 - 2.0 * by_beta * v1) / s
        w[to + 5] = (G * a2 + Gt * b2 + by_sigma * x2 - 2.0 * by_beta * v2) / s
        w[to + 6] = 0.0
        if kind == 2.0:
            w[to + 6] = rows[at + 19] / s
        w[to + 7] = off / s
    return count


@outlined
def fit_cost(w, x, rows, count, settings):
    """Sum of squares of all residuals."""
    total = 0.0
    if settings[2] > 0.0:
        total = w[x + 6] * w[x + 6] / (settings[2] * settings[2])
    for j in range(count):
        many = fit_row(w, x, rows, 20 * j, settings[0], settings[1])
        for k in range(many):
            total += w[23 + 8 * k] * w[23 + 8 * k]
    return total


@outlined
def fit_triangle(w, rows, count, settings):
    """The triangle of all residual rows about the unknowns, at 40, and the sum of squares."""
    total = 0.0
    for i in range(56):
        w[40 + i] = 0.0
    w[94] = 1.0  # a constant that is not estimated stays
    if settings[2] > 0.0:
        w[94] = 1.0 / settings[2]
        w[95] = -w[6] / settings[2]
        total = w[95] * w[95]
    for j in range(count):
        many = fit_row(w, 0, rows, 20 * j, settings[0], settings[1])
        for k in range(many):
            total += w[23 + 8 * k] * w[23 + 8 * k]
            if settings[2] <= 0.0:
                w[22 + 8 * k] = 0.0
            folded(w, 40, 16 + 8 * k)
    return total


@outlined
def fit_step(w, damping):
    """Where a step leads that lowers the sum, at 8: with rows of the triangle's own size, times `damping`, below it."""
    for i in range(56):
        w[96 + i] = w[40 + i]
    for i in range(7):
        size = 0.0
        for k in range(i + 1):
            size += w[40 + 8 * k + i] * w[40 + 8 * k + i]
        for k in range(8):
            w[16 + k] = 0.0
        w[16 + i] = sqrt(damping * size)
        folded(w, 96, 16)
    for back in range(7):
        i = 6 - back
        total = w[96 + 8 * i + 7]
        for k in range(i + 1, 7):
            total -= w[96 + 8 * i + k] * w[16 + k]
        w[16 + i] = total / w[96 + 8 * i + i]
    for i in range(7):
        w[8 + i] = w[i] + w[16 + i]


@entry
@sizes(starts="K 7", rows="J 20", settings="5", work="160", out="K", count="K", many="J")
def two_body_costs(starts: Array, rows: Array, settings: Array, work: Array, out: Array, count: int, many: int) -> None:
    """Sums of squares (count) of unknowns (count, 7); `settings`: mu, one over the speed of light, sigma of the constant."""
    for k in range(count):
        for i in range(7):
            work[i] = starts[7 * k + i]
        out[k] = fit_cost(work, 0, rows, many, settings)


@entry
@sizes(starts="K 7", rows="J 20", settings="5", work="160", out="K 65", count="K", many="J")
def two_body_fits(starts: Array, rows: Array, settings: Array, work: Array, out: Array, count: int, many: int) -> None:
    """From each start: unknowns (7), the sum of squares, steps taken, and the triangle (7, 8) there: (count, 65).

    `settings`: mu, one over the speed of light, sigma of the constant (0: it is none), most steps, the relative fall of the sum
    that ends.  `work`: unknowns, those tried at 8, residual rows at 16, the triangle at 40, the damped one at 96.
    """
    for k in range(count):
        for i in range(7):
            work[i] = starts[7 * k + i]
        cost = fit_triangle(work, rows, many, settings)
        damping, steps = 1e-3, 0.0
        while steps < settings[3] and cost < inf:
            steps += 1.0
            accepted = False
            fall = 0.0
            for _ in range(12):
                fit_step(work, damping)
                found = fit_cost(work, 8, rows, many, settings)
                if found < cost:
                    accepted = True
                    fall = cost - found
                    break
                damping = 10.0 * damping
            if not accepted:
                break
            for i in range(7):
                work[i] = work[8 + i]
            damping = maximum(0.1 * damping, 1e-12)
            cost = fit_triangle(work, rows, many, settings)
            if fall <= settings[4] * cost:
                break
        to = 65 * k
        for i in range(7):
            out[to + i] = work[i]
        out[to + 7] = cost
        out[to + 8] = steps
        for i in range(56):
            out[to + 9 + i] = work[40 + i]
