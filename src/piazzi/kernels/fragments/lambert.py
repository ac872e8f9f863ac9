"""Lambert's problem: velocities that lead from one position to another in a given time, on any conic, with any turns.

With the chord c, the half perimeter s and lam = +-sqrt(1 - c/s), negative for transfers of more than half a turn, the time
T = sqrt(2 mu / s^3) dt depends on one unknown x, cos(E) of the middle where the path is an ellipse (Lancaster and Blanchard
1969; Izzo, Celestial Mechanics and Dynamical Astronomy 121, 2015).  Below, eta = y - lam x, y^2 = 1 - lam^2 (1 - x^2), and
psi is half the difference of the eccentric anomalies, sin^2(psi/2) = S = (1 - lam - x eta) / 2; then

    T = eta^3 Q(S) / 2 + 2 lam eta + turns pi / (1 - x^2)^1.5,    Q(S) = (2 psi - sin 2 psi) / sin^3 psi.

Near S = 0 Q is a power series (Battin), which leaves no place where digits are lost.  Differences such as lam y - x are taken
from their products with the sums, for the same reason.
"""

from piazzi.kernels.vocabulary import *  # noqa: F403


@inline
def lambert_series(S):
    """Q and its first two derivatives by S, for |S| <= 0.08."""
    q0 = 1.0
    q1 = 0.0
    q2 = 0.0
    for i in range(18):
        k = 17.0 - i  # terms' ratio (3 + k) / (2.5 + k), by Horner's scheme from the last
        ratio = (3.0 + k) / (2.5 + k)
        q2 = ratio * (2.0 * q1 + S * q2)
        q1 = ratio * (q0 + S * q1)
        q0 = 1.0 + ratio * S * q0
    return 4.0 / 3.0 * q0, 4.0 / 3.0 * q1, 4.0 / 3.0 * q2


@outlined
def lambert_time(x, lam, short, turns):
    """T and its first two derivatives by x; `short` is 1 - lam^2 to its last digit."""
    y = sqrt(short + lam * lam * x * x)
    eta = y - lam * x
    if lam * x > 0.0:
        eta = short / (y + lam * x)
    less = 1.0 - lam
    if lam > 0.0:
        less = short / (1.0 + lam)
    S = 0.5 * (less - x * eta)
    off = (1.0 - x) * (1.0 + x)
    if fabs(S) <= 0.08:
        Q, dQ, ddQ = lambert_series(S)
        T = 0.5 * eta * eta * eta * Q + 2.0 * lam * eta
        dS = -0.5 * eta * eta / y
        A = eta * eta * eta / y
        B = A * eta * eta
        C = eta / y
        slope = lam * x / y * (lam / y)  # y' / y
        T1 = -1.5 * lam * A * Q - 0.25 * B * dQ - 2.0 * lam * lam * C
        dA = -A * (3.0 * lam / y + slope)
        dB = -B * (5.0 * lam / y + slope)
        dC = -C * (lam / y + slope)
        T2 = -1.5 * lam * (dA * Q + A * dQ * dS) - 0.25 * (dB * dQ + B * ddQ * dS) - 2.0 * lam * lam * dC
    else:
        root = sqrt(fabs(off))
        sine = eta * root
        cosine = 1.0 - 2.0 * S
        if off > 0.0:
            T = (atan2(sine, cosine) / root - (x * short - lam * eta)) / off
        else:
            T = (log(sine + cosine) / root - (x * short - lam * eta)) / off
        cube = lam * lam * lam
        T1 = (3.0 * T * x - 2.0 + 2.0 * cube * x / y) / off
        T2 = (3.0 * T + 5.0 * x * T1 + 2.0 * short * cube / (y * y * y)) / off
    if turns > 0.0:
        more = turns * pi / (off * sqrt(off))
        T = T + more
        T1 = T1 + 3.0 * x * more / off
        T2 = T2 + (3.0 + 15.0 * x * x / off) * more / off
    return T, T1, T2


@outlined
def lambert_fastest(lam, short, turns):
    """The x at which so many turns take the least time, and that time: Newton's method on the slope, within a bracket."""
    phase = 2.0 * atan2(sqrt(short), lam) / pi  # 0 to 2: the angle, where lam is its cosine's half (Gooding 1990)
    x = 4.0 / (3.0 * pi * (2.0 * turns + 1.0))
    x = x * pow(phase, 0.125) if phase < 1.0 else x * (2.0 - pow(2.0 - phase, 0.125))
    low = -1.0
    high = 1.0
    T, T1, T2 = lambert_time(x, lam, short, turns)
    for _ in range(60):
        if T1 < 0.0:
            low = x
        else:
            high = x
        new = x - T1 / T2
        if not low < new < high:
            new = 0.5 * (low + high)
        done = fabs(new - x) <= 1e-13
        x = new
        T, T1, T2 = lambert_time(x, lam, short, turns)
        if done:
            break
    return x, T, T2


@outlined
def lambert_root(x, low, high, middle, lam, short, turns, T):
    """The x between `low` and `high` that takes T, by Halley's method; time grows away from `middle`, -inf for none."""
    falling = x < middle or middle < -1.0
    for _ in range(100):
        found, T1, T2 = lambert_time(x, lam, short, turns)
        miss = found - T
        if (miss > 0.0) == falling:
            low = x
        else:
            high = x
        new = x - miss * T1 / (T1 * T1 - 0.5 * miss * T2)
        if isnan(new) or new <= low:
            new = 0.5 * (low + x)
        if new >= high:
            new = 0.5 * (x + high)
        room = minimum(1.0 + x, fabs(x - middle))
        done = fabs(new - x) <= 1e-7 * room or fabs(miss) <= 2e-16 * T
        x = new
        if done:
            break
    return x


@outlined
def lambert_x(lam, short, T, turns, late):
    """The unknown x for a time T; of two paths with as many turns the slower or (`late`) the faster start; NaN for none."""
    if turns > 0.0:
        middle, least, curvature = lambert_fastest(lam, short, turns)
        if not least <= T:
            return nan if not least * (1.0 - 4e-16) <= T else middle
        away = sqrt(2.0 * (T - least) / curvature)
        if late > 0.0:
            far = pow(8.0 * T / (turns * pi), 2.0 / 3.0)
            x = maximum((far - 1.0) / (far + 1.0), middle)
            if away < 0.1 * (1.0 - middle):
                x = middle + away
            if not middle < x < 1.0:
                x = 0.5 * (middle + 1.0)
            return lambert_root(x, middle, 1.0, middle, lam, short, turns, T)
        far = pow((turns + 1.0) * pi / (8.0 * T), 2.0 / 3.0)
        x = (far - 1.0) / (far + 1.0)
        if away < 0.1 * (1.0 + middle):
            x = middle - away
        if not -1.0 < x < middle:
            x = 0.5 * (middle - 1.0)
        return lambert_root(x, -1.0, middle, middle, lam, short, turns, T)
    less = 1.0 - lam
    if lam > 0.0:
        less = short / (1.0 + lam)
    circle = atan2(sqrt(short), lam) + lam * sqrt(short)
    parabola = 2.0 / 3.0 * less * (1.0 + lam + lam * lam)
    if circle <= T:
        x = pow(circle / T, 2.0 / 3.0) - 1.0
    elif parabola >= T:
        fifth = less * (1.0 + lam * (1.0 + lam * (1.0 + lam * (1.0 + lam))))
        x = 2.5 * parabola * (parabola - T) / (T * fifth) + 1.0
    else:
        x = pow(T / circle, log(2.0) / log(parabola / circle)) - 1.0
    return lambert_root(x, -1.0, inf, -inf, lam, short, 0.0, T)


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


@outlined
def lambert_shape(a0, a1, a2, b0, b1, b2, n0, n1, n2, back):
    """Distances, chord and half perimeter, lam, 1 - lam^2, sine of half the angle, and the normal of the motion.

    The motion is about (n0, n1, n2), or against it where `back` is positive; that is its plane too, on a line through the
    centre.
    """
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
def lambert_velocities(a0, a1, a2, b0, b1, b2, dt, n0, n1, n2, back, turns, late, mu):
    """Velocities at both ends, six numbers; NaN where there is no such path."""
    ra, rb, c, s, lam, short, half, m0, m1, m2 = lambert_shape(a0, a1, a2, b0, b1, b2, n0, n1, n2, back)
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
def lambert(r1: Array, r2: Array, dt: Array, about: Array, which: Array, mu: float, out: Array, count: int) -> None:
    """Velocities (count, 6); `which` (count, 3) says backwards, turns and late."""
    for k in range(count):
        i = 3 * k
        v = lambert_velocities(
            r1[i], r1[i + 1], r1[i + 2], r2[i], r2[i + 1], r2[i + 2], dt[k], about[0], about[1], about[2],
            which[i], which[i + 1], which[i + 2], mu,
        )  # fmt: skip
        for j in range(6):
            out[6 * k + j] = v[j]


@entry
def lambert_most(r1: Array, r2: Array, dt: Array, about: Array, back: float, mu: float, out: Array, count: int) -> None:
    """How many turns there is time for, (count,)."""
    for k in range(count):
        i = 3 * k
        _, _, _, s, lam, short, _, _, _, _ = lambert_shape(
            r1[i], r1[i + 1], r1[i + 2], r2[i], r2[i + 1], r2[i + 2], about[0], about[1], about[2], back
        )
        T = sqrt(2.0 * mu / s) / s * dt[k]
        most = ceil(T / pi) - 1.0
        if most > 0.0:
            _, least, _ = lambert_fastest(lam, short, most)
            if not least * (1.0 - 4e-16) <= T:
                most = most - 1.0
        out[k] = most


@entry
def kepler_arcs(r: Array, v: Array, dt: Array, mu: float, out: Array, count: int) -> None:
    """Position and velocity (count, 6) on two-body motion."""
    for k in range(count):
        i = 3 * k
        r0 = sqrt(r[i] * r[i] + r[i + 1] * r[i + 1] + r[i + 2] * r[i + 2])
        sigma = r[i] * v[i] + r[i + 1] * v[i + 1] + r[i + 2] * v[i + 2]
        v2 = v[i] * v[i] + v[i + 1] * v[i + 1] + v[i + 2] * v[i + 2]
        F, G, Ft, Gt = kepler_motion(r0, sigma, v2, mu, dt[k])
        for j in range(3):
            out[6 * k + j] = F * r[i + j] + G * v[i + j]
            out[6 * k + 3 + j] = Ft * r[i + j] + Gt * v[i + j]
