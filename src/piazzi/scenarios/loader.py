"""Scenario files by name or path -> Scenario: one pass that reads, checks and converts, and collects every fault on its way."""

from __future__ import annotations

import os
import re
import tomllib
from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from piazzi.kernels import RungeKutta8
from piazzi.model import Model
from piazzi.opening import opened
from piazzi.problem import Problem
from piazzi.problem.checks import Array
from piazzi.problem.epochs import epoch_given
from piazzi.problem.gaps import is_restricted
from piazzi.problem.truth import true_problem
from piazzi.scenarios.earth import read_earth, step_of, with_forces
from piazzi.scenarios.motion import read_gauss_markov, read_integrator, read_manoeuvres
from piazzi.scenarios.physics import read_physics, with_orbit
from piazzi.scenarios.scenario import Picture, Scenario, read_plan, read_recording, read_times
from piazzi.scenarios.table import Fault, Faults, ScenarioError, Table
from piazzi.scenarios.truth import read_truth
from piazzi.scenarios.values import read_noise, read_parameters, read_prior, read_stations
from piazzi.text import nearest, shown
from piazzi.units import Units

if TYPE_CHECKING:
    from piazzi.earth import Epoch

FILES = Path(__file__).parent / "files"
TEMPLATE = "template"
MAX_BYTES = 2**23  # a field of degree 120 in numbers, and the times of a week
# TOML takes time in the square of the length of a dotted key
_LONG_KEY = re.compile(rb"(?:[\w\"'-]{1,200}[ \t]{0,20}\.[ \t]{0,20}){30}")
_PLACE = re.compile(r" \(at (line \d+, column \d+|end of document)\)$")
SECTIONS = (
    "title", "epoch", "units", "earth", "states", "memory", "groups", "functions", "definitions", "roots", "events",
    "dynamics", "step", "parameters", "sensors", "stations", "prior", "process_noise", "gauss_markov", "integrator",
    "manoeuvres", "times", "truth", "picture", "study", "recording", "determine", "object", "product",
)  # fmt: skip
MAX_STEPS = 10**10
MAX_ROWS = 2 * 10**7


def names() -> list[str]:
    """Names of the built-in scenarios."""
    return sorted(file.stem for file in FILES.glob("*.toml") if file.stem != TEMPLATE)


def titles() -> dict[str, str]:
    """Titles of the built-in scenarios by name."""
    return {name: str(tomllib.loads(show(name))["title"]) for name in names()}


def show(name: str = TEMPLATE) -> str:
    """The commented text of a built-in scenario, or of "template", to start from; raises ValueError for an unknown name."""
    known = [*names(), TEMPLATE]
    if name not in known:
        raise ValueError(f"unknown scenario {shown(name)}{nearest(name[:60], known)}")
    return (FILES / f"{name}.toml").read_text(encoding="utf-8")


def load_scenario(source: str | os.PathLike[str]) -> Scenario:
    """The scenario of that name, or in the file at that path.

    Raises
    ------
    OSError
        Where the file cannot be read.
    ScenarioError
        (a ValueError) for a file with faults: the message has the first, `faults` all of them.
    ValueError
        For an unknown name, with the nearest.
    """
    text = os.fspath(source)
    if text in (*names(), TEMPLATE):
        return _built_in(text)
    scenario, faults = _read(Path(text))
    if scenario is None:
        raise ScenarioError(text, faults)
    return scenario


def check(source: str | os.PathLike[str]) -> list[Fault]:
    """Everything that is wrong with the scenario of that name or path, each with its place; empty where all is well.

    Raises
    ------
    OSError
        Where the file cannot be read.
    ValueError
        For an unknown name.
    """
    text = os.fspath(source)
    scenario, faults = _read(FILES / f"{text}.toml" if text in (*names(), TEMPLATE) else Path(text))
    return faults if scenario is None or faults else _underivable(scenario.problem.model)


def _underivable(model: Model) -> list[Fault]:
    """What SymPy makes nothing of, or not in time, among equations that are right by themselves."""
    from piazzi.model.derivation import derive, derive_sensor

    faults = Faults()
    with faults.at("dynamics"):
        derive(model)
    for sensor in model.sensors:
        with faults.at(f"sensors.{sensor.name}"):
            derive_sensor(model, sensor)
    return list(faults)


@cache
def _built_in(name: str) -> Scenario:
    scenario, faults = _read(FILES / f"{name}.toml")
    if scenario is None:
        raise ScenarioError(name, faults)
    return scenario


def tables_of(source: str | os.PathLike[str]) -> tuple[dict[str, Any], Faults]:
    """The tables of the scenario of that name or path as they are, and what is wrong with them; raises OSError, ValueError."""
    text = os.fspath(source)
    path = FILES / f"{text}.toml" if text in (*names(), TEMPLATE) else Path(text)
    _check_there(path)
    faults = Faults()
    faults.folder = path.parent
    return _tables(path, faults), faults


def _check_there(path: Path) -> None:
    if path.suffix != ".toml" and not path.exists():
        hint = nearest(path.name[:60], names())
        raise ValueError(f"there is no file or scenario {shown(os.fspath(path))}{hint}")


def _read(path: Path) -> tuple[Scenario | None, list[Fault]]:
    data, faults = tables_of(path)
    scenario = read_scenario(data, path.stem, faults) if not faults else None
    return scenario, list(faults)


def _tables(path: Path, faults: Faults) -> dict[str, Any]:
    """The file as plain tables; a fault where it is no TOML."""
    with opened(path) if path.suffix == ".toml" else open(path, "rb") as file:  # <(...) of a shell is a pipe, without ending
        content = file.read(MAX_BYTES + 1)
    if len(content) > MAX_BYTES:
        faults.add("", f"is longer than {MAX_BYTES} bytes, which no scenario is")
        return {}
    long = _LONG_KEY.search(content)
    if long:
        faults.add(f"line {content.count(bytes([10]), 0, long.start()) + 1}", "has a dotted key of more than 30 parts")
        return {}
    try:
        return tomllib.loads(content.decode("utf-8") + "\n")  # so that the end has a line, too
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        faults.add(f"line {line}", f"is not UTF-8 text: byte 0x{content[error.start]:02x}")
    except RecursionError:
        faults.add("", "is nested too deep")
    except ValueError as error:
        place = _PLACE.search(str(error))
        faults.add(place[1] if place else "", f"is not TOML: {_PLACE.sub('', str(error))}")
    return {}


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
        plan, recording = read_plan(file.table("study")), read_recording(file.table("recording"))
        file.finish(SECTIONS)
        if problem is not None and times is not None:
            _check_size(problem, times, faults)
            _check_schedules(problem, times, faults)
            problem = _with_steps_of(problem, times)
    if faults or problem is None or times is None:
        return None
    return Scenario(name, title or name, problem, times, picture, plan, recording)


def read_problem(file: Table, name: str, units: Units, start: float | None = None) -> Problem | None:
    """The problem, or None after noting every fault; its prior is at `start` unless the file says otherwise."""
    before = len(file.faults)
    epoch = _epoch(file)
    forces = read_earth(file.table("earth"), epoch) if "earth" in file else None
    if len(file.faults) > before:
        return None  # without its forces a file lacks states and names, which would be faults of its other sections
    file = file if forces is None else with_forces(file, forces)
    physics = read_physics(file, units, epoch, forces)
    parameters = read_parameters(file.table("parameters"), physics, physics.model)
    integrator = read_integrator(file.table("integrator"), units)
    if "stations" not in file:
        file.fault("stations", "is missing: write [[stations]] with name, sensor and noise")
    if not physics.states:
        return None
    stations = read_stations(file, physics, units, epoch)
    prior, prior_time = read_prior(file.table("prior"), physics, file.table("truth"), units, start, epoch)
    if prior is not None:
        with file.faults.at("earth"):
            with_orbit(physics, epoch, prior.mean, (start or 0.0) if prior_time is None else prior_time)
    noise = read_noise(file.table("process_noise"), physics) if "process_noise" in file else None
    gauss_markov = read_gauss_markov(file.table("gauss_markov"), physics, units) if "gauss_markov" in file else None
    manoeuvres = read_manoeuvres(file, physics, units)
    truth = read_truth(file, physics, prior, units, epoch) if "truth" in file else None
    if len(file.faults) > before or physics.model is None or prior is None:
        return None
    with file.faults.at(""):
        places = [s for s in stations if s is not None]
        given = (physics.model, prior, noise, places, parameters, integrator, prior_time, truth, name, manoeuvres)
        problem = Problem(*given, functions=physics.functions, epoch=epoch)
        if forces is not None:
            with file.faults.at("prior"):
                step = step_of(physics.states, prior.mean)
                problem = problem if integrator is not None else replace(problem, integrator=RungeKutta8(max_step=step))
        with file.faults.at("truth"):
            true_problem(problem)
        with file.faults.at("gauss_markov"):
            if gauss_markov is not None:
                from piazzi.problem.gauss_markov import with_gauss_markov

                problem = with_gauss_markov(problem, **gauss_markov)
            return problem
    return None


def _epoch(file: Table) -> Epoch | None:
    """The instant of time zero, where the file has one."""
    with file.faults.at("epoch"):
        return epoch_given(file.text("epoch"))
    return None


def _units(file: Table) -> Units:
    text = file.text("units")
    if text is not None:
        with file.faults.at("units"):
            return Units.parse(text)
    return Units()


def _with_steps_of(problem: Problem, times: Array) -> Problem:
    """The problem with steps as long in a gap of the measurements as between two times, where there may be gaps."""
    given: Any = problem.integrator
    substeps = getattr(given, "substeps", None)
    if not is_restricted(problem) or len(times) < 2 or substeps is None or given.chooses_steps:
        return problem
    return replace(problem, integrator=replace(given, substeps=None, max_step=float(np.diff(times).max()) / substeps))


def _check_schedules(problem: Problem, times: Array, faults: Faults) -> None:
    """Note a schedule that has none of the times, or an interval that is no multiple of theirs."""
    step = times[1] - times[0] if len(times) > 1 else 0.0
    regular = step > 0 and np.allclose(np.diff(times), step, rtol=1e-9, atol=0)
    for i, station in enumerate(problem.stations):
        schedule = station.schedule
        if schedule is None:
            continue
        many = 1.0 if schedule.every is None else schedule.every / step if regular else 1.0
        if abs(many - round(many)) > 1e-9 * many:
            faults.add(f"stations[{i}]", f"measures every {schedule.every:g} s, no multiple of the step of [times], {step:g} s")
        elif not schedule.has(times).any():
            faults.add(f"stations[{i}]", f"measures {schedule}: at none of the {len(times)} times of [times]")


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
        if problem.integrator is not None and problem.integrator.needs_times:
            return
        steps = problem.intervals(times)[1].sum(dtype=float)
        if steps > MAX_STEPS:
            raise ValueError(f"makes {steps:g} steps in all; at most {MAX_STEPS:g} are allowed")
