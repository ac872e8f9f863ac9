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
