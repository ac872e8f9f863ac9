"""Two-body motion of whole arrays of states."""

from piazzi.kernels.fragments.kepler import kepler_motion
from piazzi.kernels.vocabulary import *  # noqa: F403


@entry
@sizes(r="K 3", v="K 3", dt="K", out="K 6", count="K")
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
