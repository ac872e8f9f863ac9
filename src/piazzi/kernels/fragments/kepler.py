"""Two-body motion by universal functions, on any conic: plain numbers in, plain numbers out.

With s the universal anomaly (ds = dt / r), beta = 2 mu / r0 - v0^2 and U_n the functions with U_n' = U_(n-1), U_0' = -beta U_1,

    dt = r0 U1 + sigma0 U2 + mu U3,   r = r0 U0 + sigma0 U1 + mu U2,   sigma0 = r0 . v0,

and the new state is F r0 + G v0, F' r0 + G' v0 (Goodyear, Astronomical Journal 70, 1965; Shepperd, Celestial Mechanics 35,
1985).  The transition matrix follows by differentiating these four numbers by r0, sigma0, beta and mu; B_n is dU_n/dbeta at
fixed s.
"""

from piazzi.kernels.vocabulary import *  # noqa: F403


@inline
def stumpff_tail(psi):
    """c4 and c5, c_k = 1/k! - psi/(k+2)! + psi^2/(k+4)! - ..., for |psi| <= 1."""
    c4 = 1.0
    c5 = 1.0
    for i in range(9):
        k = 22.0 - 2.0 * i
        c4 = 1.0 - psi / ((k - 1.0) * k) * c4
        c5 = 1.0 - psi / (k * (k + 1.0)) * c5
    return c4 / 24.0, c5 / 120.0


@inline
def universal(s, beta):
    """U0 ... U3 and B1 ... B3; near a parabola by series, elsewhere by circular or hyperbolic functions."""
    psi = beta * s * s
    if fabs(psi) <= 1.0:
        c4, c5 = stumpff_tail(psi)
        U5 = s * s * s * s * s * c5
        U4 = s * s * s * s * c4
        U3 = s * s * s * (1.0 / 6.0 - psi * c5)
        U2 = s * s * (0.5 - psi * c4)
        U1 = s - beta * U3
        return 1.0 - beta * U2, U1, U2, U3, 0.5 * (U3 - s * U2), 0.5 * (2.0 * U4 - s * U3), 0.5 * (3.0 * U5 - s * U4)
    root = sqrt(fabs(beta))
    if beta > 0.0:
        half = sin(0.5 * root * s)
        U0 = 1.0 - 2.0 * half * half
        U1 = sin(root * s) / root
        U2 = 2.0 * half * half / beta
    else:
        half = sinh(0.5 * root * s)
        U0 = 1.0 + 2.0 * half * half
        U1 = sinh(root * s) / root
        U2 = -2.0 * half * half / beta
    U3 = (s - U1) / beta
    twice = 0.5 / beta
    return U0, U1, U2, U3, twice * (s * U0 - U1), twice * (s * U1 - 2.0 * U2), twice * (s * U2 - 3.0 * U3)


@inline
def elapsed(s, r0, sigma0, beta, mu):
    """Time at the anomaly `s`, and the distance there."""
    U0, U1, U2, U3, _, _, _ = universal(s, beta)
    return r0 * U1 + sigma0 * U2 + mu * U3, r0 * U0 + sigma0 * U1 + mu * U2


@inline
def bracket(r0, sigma0, beta, mu, dt):
    """Two anomalies between which the one at time `dt` > 0 lies: time grows with it on every conic."""
    if beta > 0.0:
        turns = beta * sqrt(beta) * dt / mu  # the mean anomaly gained; the eccentric one differs by 2 e at most
        if turns > 0.5:
            return maximum(turns - 2.0, 0.0) / sqrt(beta), (turns + 2.0) / sqrt(beta)
    low = 0.0
    high = minimum(dt / r0, 1.0 / sqrt(maximum(fabs(beta), 1e-300)))
    for _ in range(2000):
        now, _ = elapsed(high, r0, sigma0, beta, mu)
        if not now < dt:
            break
        low = high
        high = 2.0 * high
    return low, high


@inline
def anomaly_forward(r0, sigma0, beta, mu, dt):
    """The universal anomaly after `dt` >= 0, by Newton's method kept in a bracket; NaN for NaN."""
    low, high = bracket(r0, sigma0, beta, mu, dt)
    s = 0.5 * (low + high)
    before = inf
    for _ in range(100):
        now, r = elapsed(s, r0, sigma0, beta, mu)
        if now > dt:
            high = s
        else:
            low = s
        step = (dt - now) / r
        size = fabs(step)
        if size <= 4e-16 * s or (size <= 1e-9 * s and size >= 0.5 * before):  # the rest is rounding
            return s + step
        before = size
        s = s + step
        if not low <= s <= high:
            s = 0.5 * (low + high)
            before = inf
    return s


@inline
def anomaly(r0, sigma0, beta, mu, dt):
    """The universal anomaly after `dt`; backwards it is that of the mirrored motion."""
    mirror = -1.0 if dt < 0.0 else 1.0
    return mirror * anomaly_forward(r0, mirror * sigma0, beta, mu, fabs(dt))


@inline
def kepler_motion(r0, sigma0, v2, mu, dt):
    """F, G, F', G' after `dt` from distance `r0`, r . v = `sigma0` and squared speed `v2`."""
    beta = 2.0 * mu / r0 - v2
    U0, U1, U2, _, _, _, _ = universal(anomaly(r0, sigma0, beta, mu, dt), beta)
    r = r0 * U0 + sigma0 * U1 + mu * U2
    return 1.0 - mu * U2 / r0, r0 * U1 + sigma0 * U2, -mu * U1 / (r * r0), 1.0 - mu * U2 / r


@inline
def kepler_partials(r0, sigma0, v2, mu, dt):
    """F, G, F', G', and the derivatives of each by (r0, sigma0, beta, mu)."""
    beta = 2.0 * mu / r0 - v2
    s = anomaly(r0, sigma0, beta, mu, dt)
    U0, U1, U2, U3, B1, B2, B3 = universal(s, beta)
    r = r0 * U0 + sigma0 * U1 + mu * U2
    sigma = sigma0 * U0 + (mu - beta * r0) * U1
    by_r0, by_beta, by_mu = unit(0, 4), unit(2, 4), unit(3, 4)
    ds = (-1.0 / r) * vector(U1, U2, r0 * B1 + sigma0 * B2 + mu * B3, U3)
    dr = sigma * ds + vector(U0, U1, -0.5 * s * U1 * r0 + sigma0 * B1 + mu * B2, U2)
    dU1 = U0 * ds + B1 * by_beta
    dU2 = U1 * ds + B2 * by_beta
    dU3 = U2 * ds + B3 * by_beta
    w = mu / (r * r0)
    dF = (-mu / r0) * dU2 + (mu * U2 / (r0 * r0)) * by_r0 - (U2 / r0) * by_mu
    dG = -mu * dU3 - U3 * by_mu
    dFt = -w * dU1 + (w * U1) * ((1.0 / r) * dr + (1.0 / r0) * by_r0) - (U1 / (r * r0)) * by_mu
    dGt = (-mu / r) * dU2 + (mu * U2 / (r * r)) * dr - (U2 / r) * by_mu
    return 1.0 - mu * U2 / r0, r0 * U1 + sigma0 * U2, -w * U1, 1.0 - mu * U2 / r, dF, dG, dFt, dGt
