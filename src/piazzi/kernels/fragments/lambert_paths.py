"""Lambert's problem between positions: its shape, the velocities at both ends, and whole arrays of them."""

from piazzi.kernels.fragments.lambert import lambert_fastest, lambert_x
from piazzi.kernels.vocabulary import *  # noqa: F403


@inline
def split(a):
    """Two numbers of half as many digits with that sum (Veltkamp)."""
    c = 134217729.0 * a
    high = c - (c - a)
    return high, a - high


@inline
def product_error(a, b, p):
    """a b - p where p is the rounded product (Dekker)."""
    a_high, a_low = split(a)
    b_high, b_low = split(b)
    return ((a_high * b_high - p) + a_high * b_low + a_low * b_high) + a_low * b_low


@inline
def exact_minor(a, b, c, d):
    """a b - c d to its last digit: close to half a turn, what is left of it is the plane."""
    p = a * b
    q = c * d
    return (p - q) + (product_error(a, b, p) - product_error(c, d, q))


@inline
def three(a, at):
    """Three numbers in a row."""
    return a[at], a[at + 1], a[at + 2]


@outlined
def lambert_shape(from_, to, about, back):
    """Distances, chord and half perimeter, lam, 1 - lam^2, sine of half the angle, and the normal of the motion.

    The motion is about `about`, or against it where `back` is positive; that is its plane too, on a line through the
    centre.
    """
    (a0, a1, a2), (b0, b1, b2), (n0, n1, n2) = from_, to, about
    ra = sqrt(a0 * a0 + a1 * a1 + a2 * a2)
    rb = sqrt(b0 * b0 + b1 * b1 + b2 * b2)
    u0, u1, u2 = a0 / ra, a1 / ra, a2 / ra
    w0, w1, w2 = b0 / rb, b1 / rb, b2 / rb
    d0, d1, d2 = b0 - a0, b1 - a1, b2 - a2
    c = sqrt(d0 * d0 + d1 * d1 + d2 * d2)
    s = 0.5 * (ra + rb + c)
    h0, h1, h2 = u0 + w0, u1 + w1, u2 + w2
    g0, g1, g2 = u0 - w0, u1 - w1, u2 - w2
    mean = sqrt(ra * rb)
    lam = 0.5 * mean * sqrt(h0 * h0 + h1 * h1 + h2 * h2) / s
    half = 0.5 * sqrt(g0 * g0 + g1 * g1 + g2 * g2)
    m0, m1, m2 = exact_minor(a1, b2, a2, b1), exact_minor(a2, b0, a0, b2), exact_minor(a0, b1, a1, b0)
    size = sqrt(m0 * m0 + m1 * m1 + m2 * m2)
    if size < 1e-14 * ra * rb:
        along = n0 * u0 + n1 * u1 + n2 * u2
        m0, m1, m2 = n0 - along * u0, n1 - along * u1, n2 - along * u2
        size = sqrt(m0 * m0 + m1 * m1 + m2 * m2)
    side = 1.0
    if m0 * n0 + m1 * n1 + m2 * n2 < 0.0:
        side = -1.0
    if back > 0.0:
        side = -side
    size = side * size
    return ra, rb, c, s, side * lam, c / s, half, m0 / size, m1 / size, m2 / size


@outlined
def lambert_velocities(from_, to, dt, about, which, mu):
    """Velocities at both ends, six numbers; NaN where there is no such path."""
    back, turns, late = which
    (a0, a1, a2), (b0, b1, b2) = from_, to
    ra, rb, c, s, lam, short, half, m0, m1, m2 = lambert_shape(from_, to, about, back)
    if not (c > 0.0 and dt > 0.0):
        return nan, nan, nan, nan, nan, nan
    x = lambert_x(lam, short, sqrt(2.0 * mu / s) / s * dt, turns, late)
    y = sqrt(short + lam * lam * x * x)
    both = y + lam * x
    if lam * x < 0.0:
        both = short / (y - lam * x)
    sums = lam * y + x
    differences = lam * y - x
    product = short * (lam * lam - x * x * (1.0 + lam * lam))
    if lam * x > 0.0:
        differences = product / sums
    if lam * x < 0.0:
        sums = product / differences
    speed = sqrt(0.5 * mu * s)
    rho = ((a0 - b0) * (a0 + b0) + (a1 - b1) * (a1 + b1) + (a2 - b2) * (a2 + b2)) / ((ra + rb) * c)
    across = speed * (2.0 * sqrt(ra * rb) * half / c) * both
    va = speed * (differences - rho * sums) / ra
    vb = -speed * (differences + rho * sums) / rb
    ta, tb = across / ra, across / rb
    u0, u1, u2 = a0 / ra, a1 / ra, a2 / ra
    w0, w1, w2 = b0 / rb, b1 / rb, b2 / rb
    return (
        va * u0 + ta * (m1 * u2 - m2 * u1),
        va * u1 + ta * (m2 * u0 - m0 * u2),
        va * u2 + ta * (m0 * u1 - m1 * u0),
        vb * w0 + tb * (m1 * w2 - m2 * w1),
        vb * w1 + tb * (m2 * w0 - m0 * w2),
        vb * w2 + tb * (m0 * w1 - m1 * w0),
    )


@entry
@sizes(r1="K 3", r2="K 3", dt="K", about="3", which="K 3", out="K 6", count="K")
def lambert(r1: Array, r2: Array, dt: Array, about: Array, which: Array, mu: float, out: Array, count: int) -> None:
    """Velocities (count, 6); `which` (count, 3) says backwards, turns and late."""
    for k in range(count):
        i = 3 * k
        v = lambert_velocities(three(r1, i), three(r2, i), dt[k], three(about, 0), three(which, i), mu)
        for j in range(6):
            out[6 * k + j] = v[j]


@entry
@sizes(r1="K 3", r2="K 3", dt="K", about="3", out="K", count="K")
def lambert_most(r1: Array, r2: Array, dt: Array, about: Array, back: float, mu: float, out: Array, count: int) -> None:
    """How many turns there is time for, (count,)."""
    for k in range(count):
        i = 3 * k
        _, _, _, s, lam, short, _, _, _, _ = lambert_shape(three(r1, i), three(r2, i), three(about, 0), back)
        T = sqrt(2.0 * mu / s) / s * dt[k]
        most = ceil(T / pi) - 1.0
        if most > 0.0:
            _, least, _ = lambert_fastest(lam, short, most)
            if not least * (1.0 - 4e-16) <= T:
                most = most - 1.0
        out[k] = most
