"""Problems that the laws are tried on: the founding two with their numbers from the design, and random linear ones."""

from functools import cache

import numpy as np

import piazzi as pz

MU_EARTH = 3.986e14
DEGREE = np.pi / 180


@cache
def satellite_model() -> pz.Model:
    return pz.Model(
        ["x", "y", "vx", "vy"],
        ["vx", "vy", "-mu*x/sqrt(x**2 + y**2)**3", "-mu*y/sqrt(x**2 + y**2)**3"],
        [pz.Sensor("bearing", ["atan2(y, x)"], angles=["bearing"])],
        ["mu"],
        groups={"position": ["x", "y"], "velocity": ["vx", "vy"]},
    )


def satellite(integrator=None, method="scaled", **changes) -> pz.Problem:
    """The satellite-bearing problem: 15 s, 15 Taylor substeps, Q dt, a 0.2 degree bearing."""
    numbers = {
        "prior": pz.Gaussian([0.0, 2e7, 4500.0, 0.0], [1e12, 9e12, 640000.0, 640000.0]),
        "process_noise": pz.ProcessNoise([0.01, 0.01, 0.0025, 0.0025], "second", method),
        "stations": [pz.Station("earth", "bearing", (0.2 * DEGREE) ** 2)],
        "parameters": {"mu": MU_EARTH},
        "integrator": integrator or pz.Taylor(15),
    }
    return pz.Problem(satellite_model(), **(numbers | changes))


@cache
def b612_model() -> pz.Model:
    return pz.Model(
        ["x", "y", "vx", "vy"],
        ["vx", "vy", "-mu*x/hypot(x, y)**3", "-mu*y/hypot(x, y)**3"],
        [pz.Sensor("range", ["sqrt((x - mx)**2 + (y - my)**2)"])],
        ["mu"],
        groups={"position": ["x", "y"], "velocity": ["vx", "vy"]},
    )


def b612(Q=(0.0, 0.0, 0.01, 0.01), **changes) -> pz.Problem:
    """The range-only problem about a planet of 10 m."""
    numbers = {
        "prior": pz.Gaussian([12.0, 0.0, 0.0, 9.0], np.eye(4)),
        "process_noise": pz.ProcessNoise(Q, "step"),
        "stations": [pz.Station("radar", "range", 0.01, {"mx": 10.0, "my": 0.0})],
        "parameters": {"mu": 1000.0},
        "integrator": pz.RungeKutta4(10),
        "truth": pz.Truth(state=[11.0, 0.0, 0.0, 10.0], process_noise=pz.ProcessNoise([0.0] * 4, "step")),
    }
    return pz.Problem(b612_model(), **(numbers | changes))


@cache
def linear_model(n: int, widths: tuple[int, ...], discrete: bool, angles: bool = False) -> pz.Model:
    """x' = A x (or x[k+1] = A x) and a sensor z = H x of each width, whose coefficients are parameters and station numbers."""
    states = [f"x{i}" for i in range(n)]
    rows = [" + ".join(f"a{i}_{j}*x{j}" for j in range(n)) for i in range(n)]
    sensors = []
    for s, m in enumerate(widths):
        equations = {f"z{s}_{i}": " + ".join(f"h{i}_{j}*x{j}" for j in range(n)) for i in range(m)}
        sensors.append(pz.Sensor(f"sensor{s}", equations, angles=list(equations) if angles else []))
    return pz.Model(states, rows, sensors, [f"a{i}_{j}" for i in range(n) for j in range(n)], discrete=discrete)


def linear(A, H, R, Q, prior, *, discrete=True, angles=False, per="step", method="integral", **changes) -> pz.Problem:
    """The linear problem with these matrices; H and R are lists, one entry per station, each with a sensor of its own."""
    n = len(A)
    model = linear_model(n, tuple(len(h) for h in H), discrete, angles)
    stations = [
        pz.Station(f"station{s}", f"sensor{s}", r, {f"h{i}_{j}": h[i, j] for i in range(len(h)) for j in range(n)})
        for s, (h, r) in enumerate(zip(H, R, strict=True))
    ]
    parameters = {f"a{i}_{j}": A[i, j] for i in range(n) for j in range(n)}
    return pz.Problem(model, prior, pz.ProcessNoise(Q, per, method), stations, parameters, **changes)


def random_covariance(rng, n: int, rank: int | None = None) -> np.ndarray:
    """Symmetric and semidefinite, of full rank unless told otherwise."""
    a = rng.standard_normal((n, n if rank is None else rank))
    return a @ a.T / max(a.shape[1], 1) + (0.1 * np.eye(n) if rank is None else 0.0)


def random_stable(rng, n: int) -> np.ndarray:
    """A matrix whose powers stay bounded."""
    a = rng.standard_normal((n, n))
    return 0.95 * a / np.linalg.norm(a, 2)


def sigma(estimate) -> np.ndarray:
    """Standard deviations (K, n) of an estimate, the unit in which two estimates are compared."""
    return np.sqrt(np.diagonal(estimate.covariance, axis1=1, axis2=2))


def assert_same_estimate(a, b, tolerance: float, *, unit=None) -> None:
    """Means within `tolerance` standard deviations, covariances within `tolerance` of the product of two of them."""
    s = sigma(b) if unit is None else unit
    s = np.where(s > 0, s, 1.0)
    difference = np.abs(a.mean - b.mean) / s
    assert difference.max() <= tolerance, f"means differ by {difference.max():.3g} sigma"
    spread = np.abs(a.covariance - b.covariance) / (s[:, :, None] * s[:, None, :])
    assert spread.max() <= tolerance, f"covariances differ by {spread.max():.3g} of sigma^2"


@cache
def tracking_model() -> pz.Model:
    """Two-body motion seen by sensors of one, two and three components, with numbers of their own and angles among them."""
    dx, dy, range_ = "(x - mx)", "(y - my)", "hypot(x - mx, y - my)"
    rate = f"({dx}*vx + {dy}*vy)/{range_}"
    return pz.Model(
        ["x", "y", "vx", "vy"],
        ["vx", "vy", "-mu*x/hypot(x, y)**3", "-mu*y/hypot(x, y)**3"],
        [
            pz.Sensor("range", [range_]),
            pz.Sensor("radar", {"distance": range_, "azimuth": f"atan2({dy}, {dx})"}, angles=["azimuth"]),
            pz.Sensor("doppler", {"direction": f"atan2({dy}, {dx})", "rate": rate, "far": range_}, angles=["direction"]),
        ],
        ["mu"],
        groups={"position": ["x", "y"], "velocity": ["vx", "vy"]},
    )


def network(rng, **changes) -> pz.Problem:
    """Four stations on a unit planet (mu = 1), with full R of random correlations, and an orbit near radius 2."""
    widths = {"north": ("radar", 2), "south": ("doppler", 3), "east": ("range", 1), "west": ("radar", 2)}
    places = {"north": (0.0, 1.0), "south": (0.0, -1.0), "east": (1.0, 0.0), "west": (-1.0, 0.0)}
    stations = [
        pz.Station(name, sensor, 1e-4 * random_covariance(rng, m), dict(zip(("mx", "my"), places[name], strict=True)))
        for name, (sensor, m) in widths.items()
    ]
    numbers = {
        "prior": pz.Gaussian([2.0, 0.1, 0.0, 0.7], np.diag([0.01, 0.01, 0.001, 0.001])),
        "process_noise": pz.ProcessNoise([0.0, 0.0, 1e-5, 1e-5]),
        "stations": stations,
        "parameters": {"mu": 1.0},
        "integrator": pz.RungeKutta4(4),
    }
    return pz.Problem(tracking_model(), **(numbers | changes))
