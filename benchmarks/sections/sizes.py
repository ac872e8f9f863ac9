"""Problems of 6 and 18 values with lanes and without: where several states at once pay, and where a row fills the registers."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from figures import Figure, rounds

import piazzi as pz

STATIONS = {"a": (6.3e6, 0.0, 0.0), "b": (0.0, 6.3e6, 0.0), "c": (0.0, 0.0, 6.3e6), "d": (-4.4e6, 0.0, 4.4e6)}
EPOCHS = 200


def figures() -> Iterator[Figure]:
    from piazzi.estimate import chain
    from piazzi.kernels.spec import lanes_for, machine_lanes
    from piazzi.problem.inputs import prepare

    many = max(machine_lanes(), 2)
    for estimated in (False, True):
        problem, tracking = case(estimated)
        chains = {}
        for lanes in (1, many):
            chain.lanes_for = lambda n, lanes=lanes: lanes  # type: ignore[assignment]
            chains[lanes] = chain.Chain(problem, prepare(problem, tracking))
            chains[lanes].x[:] = problem.mean
        chain.lanes_for = lanes_for
        seconds = rounds({lanes: c.linearize for lanes, c in chains.items()}, 15)
        n = problem.model.n
        yield Figure(f"linearize {n} values, one state at a time", seconds[1] / EPOCHS * 1e6, "us/state")
        apart = float(np.abs(chains[1].Phi[:-1] - chains[many].Phi[:-1]).max() / np.abs(chains[1].Phi[:-1]).max())
        note = f"{apart:.0e} relative apart; chosen for this size: {lanes_for(n)} lanes"
        value, ratio = seconds[many] / EPOCHS * 1e6, seconds[many] / seconds[1]
        yield Figure(f"  {many} states at a time", value, "us/state", ratio=ratio, to="one at a time", note=note)


def case(estimated: bool) -> tuple[pz.Problem, pz.Tracking]:
    """Ranges from four stations to a satellite in three dimensions, their positions known (6 values) or estimated (18)."""
    pull = "*mu/(x**2 + y**2 + z**2)**1.5"
    parameters = [pz.Parameter("mu")]
    values: dict[str, object] = {"mu": 3.986004418e14}
    sensors = []
    for name, place in STATIONS.items():
        for axis, value in zip("xyz", place, strict=True):
            parameters.append(pz.Parameter(f"{axis}{name}", "estimated" if estimated else "fixed"))
            values[f"{axis}{name}"] = pz.Gaussian(value, 1.0) if estimated else value
        sensors.append(pz.Sensor(name, [f"sqrt((x - x{name})**2 + (y - y{name})**2 + (z - z{name})**2)"]))
    model = pz.Model(
        ["x", "y", "z", "vx", "vy", "vz"], ["vx", "vy", "vz", *(f"-{q}{pull}" for q in "xyz")], sensors, parameters
    )
    problem = pz.Problem(
        model,
        pz.Gaussian.from_sigma([7e6, 0, 0, 0, 5e3, 5.5e3], [100.0] * 3 + [0.1] * 3),
        pz.ProcessNoise([0, 0, 0, 1e-6, 1e-6, 1e-6], per="step"),
        [pz.Station(name, sensor=name, noise=1.0) for name in STATIONS],
        values,
        pz.RungeKutta4(4),
    )
    return problem, pz.simulate(problem, np.arange(EPOCHS) * 30.0, np.random.default_rng(0))
