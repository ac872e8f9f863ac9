"""Two-body motion and what is asked of it, in 50 digits, by other formulas than the package's."""

from __future__ import annotations

import mpmath as mp
import numpy as np

DIGITS = 80  # of which 50 and more remain where an orbit passes close to the centre


def vector(values) -> mp.matrix:
    return mp.matrix([mp.mpf(float(x)) if not isinstance(x, mp.mpf) else x for x in values])


def dot(a, b):
    return sum(x * y for x, y in zip(a, b, strict=True))


def norm(a):
    return mp.sqrt(dot(a, a))


def cross(a, b):
    return mp.matrix([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


def stumpff(z):
    """C and S of Bate, Mueller and White."""
    if abs(z) < mp.mpf(10) ** -20:
        return mp.mpf(1) / 2 - z / 24 + z * z / 720, mp.mpf(1) / 6 - z / 120 + z * z / 5040
    if z > 0:
        s = mp.sqrt(z)
        return (1 - mp.cos(s)) / z, (s - mp.sin(s)) / s**3
    s = mp.sqrt(-z)
    return (mp.cosh(s) - 1) / -z, (mp.sinh(s) - s) / s**3


def propagate(r, v, mu, dt):
    """Position and velocity after `dt`, by universal variables; the unknown is found by a bracket."""
    r0, sigma = norm(r), dot(r, v) / mp.sqrt(mu)
    alpha = 2 / r0 - dot(v, v) / mu

    def late(chi):
        C, S = stumpff(alpha * chi**2)
        return sigma * chi**2 * C + (1 - alpha * r0) * chi**3 * S + r0 * chi - mp.sqrt(mu) * dt

    high = mp.sqrt(mu) * dt / r0
    step = abs(high) or mp.mpf(1)
    low, high = (mp.mpf(0), step) if dt >= 0 else (-step, mp.mpf(0))
    while late(high) < 0:
        low, high = high, 2 * high
    while late(low) > 0:
        low, high = 2 * low, low
    chi = (low + high) / 2
    for _ in range(2000):  # Newton's method kept in the bracket
        f = late(chi)
        low, high = (chi, high) if f < 0 else (low, chi)
        C, S = stumpff(alpha * chi**2)
        slope = chi**2 * C + sigma * chi * (1 - alpha * chi**2 * S) + r0 * (1 - alpha * chi**2 * C)
        new = chi - f / slope
        new = new if low <= new <= high else (low + high) / 2
        if abs(new - chi) <= abs(chi) * mp.mpf(10) ** (3 - mp.mp.dps):
            chi = new
            break
        chi = new
    C, S = stumpff(alpha * chi**2)
    f, g = 1 - chi**2 / r0 * C, dt - chi**3 * S / mp.sqrt(mu)
    new_r = f * r + g * v
    length = norm(new_r)
    gt = 1 - chi**2 / length * C
    ft = mp.sqrt(mu) / (length * r0) * chi * (alpha * chi**2 * S - 1)
    return new_r, ft * r + gt * v


def solve(equations, guess, iterations=60):
    """The root of n equations in n unknowns next to a guess that has most digits: Newton's method with differences."""
    x = vector(guess)
    n = len(x)
    for _ in range(iterations):
        y = equations(x)
        J = mp.matrix(n, n)
        for j in range(n):
            h = (abs(x[j]) + mp.mpf(10) ** -30) * mp.mpf(10) ** (-mp.mp.dps // 2)
            moved = x.copy()
            moved[j] += h
            up = equations(moved)
            for i in range(n):
                J[i, j] = (up[i] - y[i]) / h
        step = mp.lu_solve(J, -mp.matrix(y))
        x += step
        if all(abs(step[j]) <= abs(x[j]) * mp.mpf(10) ** -50 + mp.mpf(10) ** -60 for j in range(n)):
            return x
    raise AssertionError("the reference does not converge")


def lambert_velocity(r1, r2, dt, mu, guess):
    """Velocity at r1 of the orbit that leads to r2, next to `guess`: land there, to 40 digits and more."""
    with mp.workdps(DIGITS):
        a, b, t = vector(r1), vector(r2), mp.mpf(float(dt))
        found = solve(lambda v: list(propagate(a, v, mp.mpf(float(mu)), t)[0] - b), guess)
        return np.array([mp.nstr(x, 25) for x in found], dtype=float)
