"""Tables of a scenario file -> Scenario: one pass that reads, checks and converts, and collects every fault on its way."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from piazzi.problem import Problem
from piazzi.problem.checks import Array
from piazzi.scenarios.equations import read_physics
from piazzi.scenarios.faults import Faults
from piazzi.scenarios.gauss_markov import read_gauss_markov
from piazzi.scenarios.integrators import read_integrator
from piazzi.scenarios.manoeuvres import read_manoeuvres
from piazzi.scenarios.quantities import read_noise, read_parameters, read_prior, read_stations
from piazzi.scenarios.scenario import Picture, Scenario
from piazzi.scenarios.studies import read_plan
from piazzi.scenarios.table import Table
from piazzi.scenarios.times import read_times
from piazzi.scenarios.truth import read_truth
from piazzi.units import Units

SECTIONS = (
    "title", "units", "states", "memory", "groups", "definitions", "dynamics", "step", "parameters", "sensors", "stations",
    "prior", "process_noise", "gauss_markov", "integrator", "manoeuvres", "times", "truth", "picture", "study",
)  # fmt: skip
MAX_STEPS = 10**10
MAX_ROWS = 2 * 10**7


def read_scenario(data: Mapping[str, Any], name: str, faults: Faults) -> Scenario | None:
    """The scenario that the tables of a file describe, or None after noting every fault."""
    file = Table(data, "", faults)
    title, units = file.text("title", name), _units(file)
    with np.errstate(all="ignore"):
        times = read_times(file.table("times"), units)
        of_times = list(faults)
        problem = read_problem(file, name, units, None if times is None else float(times[0]))
        faults[:] = [*faults[len(of_times) :], *of_times]  # those of the equations and numbers first
        picture = Picture(file.table("picture").number("planet_radius", units.length(), positive=True))
        file.table("picture").finish(("planet_radius",))
        plan = read_plan(file.table("study"))
        file.finish(SECTIONS)
        if problem is not None and times is not None:
            _check_size(problem, times, faults)
    if faults or problem is None or times is None:
        return None
    return Scenario(name, title or name, problem, times, picture, plan)


def read_problem(file: Table, name: str, units: Units, start: float | None = None) -> Problem | None:
    """The problem, or None after noting every fault; its prior is at `start` unless the file says otherwise."""
    before = len(file.faults)
    physics = read_physics(file, units)
    parameters = read_parameters(file.table("parameters"), physics, physics.model)
    integrator = read_integrator(file.table("integrator"), units)
    if "stations" not in file:
        file.fault("stations", "is missing: write [[stations]] with name, sensor and noise")
    if not physics.states:
        return None
    stations = read_stations(file, physics)
    prior, prior_time = read_prior(file.table("prior"), physics, file.table("truth"), units, start)
    noise = read_noise(file.table("process_noise"), physics) if "process_noise" in file else None
    wandering = read_gauss_markov(file.table("gauss_markov"), physics, units) if "gauss_markov" in file else None
    manoeuvres = read_manoeuvres(file, physics, units)
    truth = read_truth(file.table("truth"), physics, prior, units) if "truth" in file else None
    if len(file.faults) > before or physics.model is None or prior is None:
        return None
    with file.faults.at(""):
        places = [s for s in stations if s is not None]
        problem = Problem(physics.model, prior, noise, places, parameters, integrator, prior_time, truth, name, manoeuvres)
        with file.faults.at("gauss_markov"):
            return problem if wandering is None else wandering.added_to(problem)
    return None


def _units(file: Table) -> Units:
    text = file.text("units")
    if text is not None:
        with file.faults.at("units"):
            return Units.parse(text)
    return Units()


def _check_size(problem: Problem, times: Array, faults: Faults) -> None:
    """Note a scenario that would take hours or all memory."""
    rows = len(times) * len(problem.stations)
    if rows > MAX_ROWS:
        faults.add("times", f"makes {rows:g} measurements; at most {MAX_ROWS:g} are allowed")
    start = problem.prior_start(times)
    for m in problem.manoeuvres:
        if m.time <= start:
            faults.add("manoeuvres", f"the one at {m.time:g} s is not after the prior at {start:g} s")
    if faults:
        return
    with faults.at("prior.time" if start != times[0] else "integrator"):
        if start > times[0]:
            raise ValueError(f"is {start:g} s, after the first measurement at {times[0]:g} s: simulation begins at the prior")
        steps = problem.intervals(times)[1].sum(dtype=float)
        if steps > MAX_STEPS:
            raise ValueError(f"makes {steps:g} steps in all; at most {MAX_STEPS:g} are allowed")
