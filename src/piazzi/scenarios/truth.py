"""The other half of a scenario: what really happens, where that differs from what the estimators assume."""

from __future__ import annotations

import numpy as np

from piazzi.expressions import check
from piazzi.problem import Gaussian, ProcessNoise, Truth
from piazzi.scenarios.equations import Physics
from piazzi.scenarios.faults import joined, shown
from piazzi.scenarios.integrators import read_integrator
from piazzi.scenarios.manoeuvres import read_manoeuvres
from piazzi.scenarios.quantities import read_noise
from piazzi.scenarios.table import Table
from piazzi.text import nearest
from piazzi.units import Units

MOST_TEXTS = 100


def read_truth(table: Table, physics: Physics, prior: Gaussian | None, units: Units) -> Truth | None:
    """What really happens, where it differs from what the estimators assume."""
    state = table.raw("state")
    mean = None
    if isinstance(state, str):
        table.text("state", choices=("drawn", "mean"))
        mean = prior.mean if state == "mean" and prior is not None else None
    elif state is not None:
        vector = table.vector("state", physics.states)
        mean = None if vector is None else vector * physics.factors(physics.states)
    parameters = _true_parameters(table.table("parameters"), physics)
    noise: ProcessNoise | None = None
    if isinstance(table.raw("process_noise"), bool):
        noise = None if table.raw("process_noise") else ProcessNoise(np.zeros(len(physics.states)), "step")
    elif "process_noise" in table:
        noise = read_noise(table.table("process_noise"), physics)
    integrator = read_integrator(table.table("integrator"), units)
    noisy = table.flag("measurement_noise", True)
    manoeuvres = read_manoeuvres(table, physics, units) if "manoeuvres" in table else None
    accept = read_texts(table, "accept")
    known = [*physics.units]
    for i, text in enumerate(accept):
        with table.faults.at(joined(table.at("accept"), i)):
            check(text, known)
    table.finish()
    return Truth(mean, parameters, noise, integrator, bool(noisy), manoeuvres, accept)


def read_texts(table: Table, key: str) -> tuple[str, ...]:
    """One text, or a list of them."""
    value = table.raw(key)
    texts = [] if value is None else value if isinstance(value, list) else [value]
    if not all(isinstance(text, str) for text in texts) or len(texts) > MOST_TEXTS:
        table.fault(key, f"must be text, or a list of at most {MOST_TEXTS} texts, not {shown(value)}")
        return ()
    return tuple(texts)


def _true_parameters(table: Table, physics: Physics) -> dict[str, float]:
    known = [name for name in physics.units if name not in (*physics.states, *physics.memory)]
    out: dict[str, float] = {}
    for name in table.data:
        if name not in known:
            table.fault(name, f"is no parameter{nearest(name[:60], known)}")
            continue
        value = table.number(name, physics.units[name].factor)
        out |= {} if value is None else {name: value}
    return out
