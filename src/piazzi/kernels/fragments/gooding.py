"""Three directions: the ranges at both ends for which Lambert's orbit between them passes through the middle one.

The unknowns are the logarithms of both ranges; Newton's method with differences, halved steps where it does not come nearer
(Gooding, Celestial Mechanics and Dynamical Astronomy 66, 1997).  `given` holds the three directions, two unit
vectors across the
middle one, the three observers, the axis that motion is about, and the times from the first observation to the others.
"""

from piazzi.kernels.fragments.kepler import kepler_motion
from piazzi.kernels.fragments.lambert_paths import lambert_velocities
from piazzi.kernels.vocabulary import *  # noqa: F403


@outlined
def gooding_miss(p, q, given, back, turns, late, mu):
    """How far the direction at the middle is off along the two unit vectors, and its component along the observed one."""
    rho = exp(p)
    far = exp(q)
    a0, a1, a2 = given[15] + rho * given[0], given[16] + rho * given[1], given[17] + rho * given[2]
    b0, b1, b2 = given[21] + far * given[6], given[22] + far * given[7], given[23] + far * given[8]
    v0, v1, v2, _, _, _ = lambert_velocities(
        (a0, a1, a2), (b0, b1, b2), given[28], (given[24], given[25], given[26]), (back, turns, late), mu
    )
    distance = sqrt(a0 * a0 + a1 * a1 + a2 * a2)
    F, G, _, _ = kepler_motion(distance, a0 * v0 + a1 * v1 + a2 * v2, v0 * v0 + v1 * v1 + v2 * v2, mu, given[27])
    d0 = F * a0 + G * v0 - given[18]
    d1 = F * a1 + G * v1 - given[19]
    d2 = F * a2 + G * v2 - given[20]
    size = sqrt(d0 * d0 + d1 * d1 + d2 * d2)
    first = (d0 * given[9] + d1 * given[10] + d2 * given[11]) / size
    second = (d0 * given[12] + d1 * given[13] + d2 * given[14]) / size
    along = (d0 * given[3] + d1 * given[4] + d2 * given[5]) / size
    return first, second, along, size


@outlined
def gooding_solve(p, q, given, back, turns, late, mu):
    """The unknowns from a start, the square of what is left, and the middle range; infinite where there is nothing."""
    f, g, along, size = gooding_miss(p, q, given, back, turns, late, mu)
    square = f * f + g * g
    if isnan(square):
        return p, q, inf, size
    for _ in range(40):
        h = 1e-6
        f1, g1, _, _ = gooding_miss(p + h, q, given, back, turns, late, mu)
        f2, g2, _, _ = gooding_miss(p - h, q, given, back, turns, late, mu)
        f3, g3, _, _ = gooding_miss(p, q + h, given, back, turns, late, mu)
        f4, g4, _, _ = gooding_miss(p, q - h, given, back, turns, late, mu)
        a, b, c, d = (f1 - f2) / (2.0 * h), (f3 - f4) / (2.0 * h), (g1 - g2) / (2.0 * h), (g3 - g4) / (2.0 * h)
        whole = a * d - b * c
        dp = -(d * f - b * g) / whole
        dq = -(a * g - c * f) / whole
        longest = maximum(fabs(dp), fabs(dq))
        if isnan(longest):
            break
        share = minimum(1.0, 0.7 / longest)
        better = False
        for _ in range(8):
            f1, g1, along1, size1 = gooding_miss(p + share * dp, q + share * dq, given, back, turns, late, mu)
            if f1 * f1 + g1 * g1 < square:
                better = True
                break
            share = 0.5 * share
        if not better:
            break
        p, q = p + share * dp, q + share * dq
        f, g, along, size, square = f1, g1, along1, size1, f1 * f1 + g1 * g1
        if longest < 1e-14:
            break
    if along <= 0.0:
        square = inf
    return p, q, square, size


@entry
@sizes(starts="K 2", given="29", which="3", out="K 4", count="K")
def gooding(starts: Array, given: Array, which: Array, mu: float, out: Array, count: int) -> None:
    """From each pair of starts (count, 2): the three ranges and the square of the miss, (count, 4)."""
    for k in range(count):
        p, q, square, size = gooding_solve(starts[2 * k], starts[2 * k + 1], given, which[0], which[1], which[2], mu)
        out[4 * k] = exp(p)
        out[4 * k + 1] = size
        out[4 * k + 2] = exp(q)
        out[4 * k + 3] = square
