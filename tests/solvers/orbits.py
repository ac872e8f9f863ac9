"""Two-body problems in the plane and in space, and a disturbed one that depends on time."""

from functools import cache

import numpy as np

import piazzi as pz

MU = 3.986004418e14


@cache
def model(d: int, mu_role: str = "fixed", extra: bool = False) -> pz.Model:
    """Motion about a point mass in d dimensions; with a constant clock offset as a further state where wanted."""
    r, v = ["x", "y", "z"][:d], ["vx", "vy", "vz"][:d]
    distance = "sqrt(" + " + ".join(f"{s}**2" for s in r) + ")"
    dynamics = [*v, *(f"-mu*{s}/{distance}**3" for s in r)]
    states = [*r, *v, *(["clock"] if extra else [])]
    return pz.Model(
        states,
        dynamics + (["0"] if extra else []),
        [pz.Sensor("range", [distance])],
        [pz.Parameter("mu", mu_role)],
        groups={"position": r, "velocity": v},
    )


def orbit(d: int, integrator, mu_role: str = "fixed", extra: bool = False, **changes) -> pz.Problem:
    """The problem about a state in low orbit."""
    n = 2 * d + extra
    x = state(d, 0.01)
    numbers = {
        "prior": pz.Gaussian([*x, *([0.0] * extra)], np.eye(n)),
        "stations": [pz.Station("centre", "range", 100.0)],
        "parameters": {"mu": MU if mu_role == "fixed" else pz.Gaussian(MU, 1e8)},
        "integrator": integrator,
    }
    return pz.Problem(model(d, mu_role, extra), **(numbers | changes))


def state(d: int, e: float, nu: float = 0.7, periapsis: float = 7e6) -> np.ndarray:
    """State on a conic of eccentricity e (an ellipse below 1, a parabola at 1, a hyperbola above) at true anomaly nu."""
    p = periapsis * (1 + e)
    r = p / (1 + e * np.cos(nu))
    position = r * np.array([np.cos(nu), np.sin(nu), 0.0])
    velocity = np.sqrt(MU / p) * np.array([-np.sin(nu), e + np.cos(nu), 0.0])
    if d == 2:
        return np.concatenate([position[:2], velocity[:2]])
    tilt = np.array([[1, 0, 0], [0, np.cos(0.9), -np.sin(0.9)], [0, np.sin(0.9), np.cos(0.9)]])
    turn = np.array([[np.cos(2), -np.sin(2), 0], [np.sin(2), np.cos(2), 0], [0, 0, 1]])
    return np.concatenate([turn @ tilt @ position, turn @ tilt @ velocity])


def units(d: int) -> np.ndarray:
    """Typical size of each state, in which derivatives are compared."""
    return np.array([7e6] * d + [7.5e3] * d)


@cache
def driven_model() -> pz.Model:
    """A pendulum with friction whose pivot moves, and a constant that is estimated: everything that a step can depend on."""
    return pz.Model(
        ["q", "w"],
        ["w", "-k*sin(q) - c*w + exp(-t)*cos(3*t)"],
        [pz.Sensor("angle", ["q"])],
        [pz.Parameter("k"), pz.Parameter("c", "estimated")],
    )


def driven(integrator, **changes) -> pz.Problem:
    numbers = {
        "prior": pz.Gaussian([0.4, -0.3], [0.1, 0.1]),
        "stations": [pz.Station("eye", "angle", 0.01)],
        "parameters": {"k": 2.0, "c": pz.Gaussian(0.2, 0.01)},
        "integrator": integrator,
    }
    return pz.Problem(driven_model(), **(numbers | changes))
