"""ORBIT of the command line -> a problem without measurements, and the times to propagate it to."""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import Any

import click
import numpy as np

from piazzi.problem import Gaussian, Problem
from piazzi.problem.checks import Array
from piazzi.units import duration, positive_duration

STATES = ("x", "y", "z", "vx", "vy", "vz")
STEP, SPAN = 60.0, 86400.0
MOST = 10**7  # states


@dataclass(frozen=True, eq=False)
class Course:
    """An orbit and what moves it.

    `is_orbit`: its states are those of an orbit about the Earth in the GCRF; `uncertain`: it has a covariance; `beliefs` are
    states and covariances of a determination at times, whose constants are correlated with the orbit.
    """

    name: str
    problem: Problem
    source: str
    forces: str
    assumed: tuple[str, ...]
    is_orbit: bool
    uncertain: bool
    times: Array | None = None
    beliefs: Any = None

    def at(self, times: Array) -> Any:
        """The `Propagation` to these times."""
        from piazzi.estimate.propagation import Propagation, propagate

        if self.beliefs is None:
            return propagate(self.problem, times)

        class Believed(Propagation):
            names = STATES

        return Believed(self.problem, times, *self.beliefs(times))

    @property
    def dated(self) -> bool:
        """Whether it is an orbit with dates, as an ephemeris holds."""
        return self.is_orbit and self.problem.epoch is not None

    def ephemeris(self, found: Any, frame: str) -> Any:
        """The propagated states as an ephemeris, where it is `dated`."""
        from piazzi.orbit.predicted import ephemeris_of

        x = [found.names.index(name) for name in STATES]
        t, first = np.unique(found.times, return_index=True)
        P = found.covariance[first][:, x][:, :, x] if self.uncertain else None
        return ephemeris_of(self.name, self.problem.epoch, t, found.mean[first][:, x], P, frame)


def course_of(text: str, forces: str | None, begin: str | None, chosen: str | None) -> Course:
    """The orbit of a file or a scenario.

    Raises
    ------
    ValueError
        For what is no orbit, or forces that are not known.
    OSError
        Where a file cannot be read.
    """
    from piazzi.scenarios import names

    if not text:
        raise click.UsageError("ORBIT is empty", click.get_current_context(silent=True))
    if text.lower().endswith(".toml") or (text in names() and not os.path.exists(text)):
        return _of_scenario(text, forces)
    from piazzi.determination.course import determination_in
    from piazzi.determination.orbit_forces import COEFFICIENTS, with_sphere
    from piazzi.determination.words import date
    from piazzi.earth.defaults import default_forces, lowest_height, read_forces
    from piazzi.earth.stepping import longest_step
    from piazzi.kernels import RungeKutta8
    from piazzi.orbit.starting import start_of

    if (facts := determination_in(text)) is not None:
        return _of_determination(facts, text, forces)
    start = start_of(text, None if begin is None else date(begin, "--from"), chosen)
    height = lowest_height(start.state[:3], start.state[3:])
    choice = default_forces(height) if forces is None else read_forces(forces, height)
    choice, assumed = with_sphere(choice, start.name)
    if start.covariance is not None and any(text.partition(" = ")[0] in COEFFICIENTS.values() for text in assumed):
        assumed = (*assumed, "what these coefficients are off by is not in the covariance")
    P = np.zeros((6, 6)) if start.covariance is None else start.covariance
    problem = Problem(
        choice.forces.model(),
        Gaussian(start.state, P),
        parameters=choice.values,
        integrator=RungeKutta8(max_step=longest_step(start.state[:3], start.state[3:])),
        prior_time=0.0,
        name=start.name,
        epoch=start.epoch,
        functions=choice.functions(start.epoch, choice.air(start.epoch, start.state)),
    )
    return Course(start.name, problem, start.source, str(choice), assumed, True, start.covariance is not None)


def _of_determination(facts: Any, text: str, forces: str | None) -> Course:
    from piazzi.determination.course import course_of
    from piazzi.earth import Epoch

    found = course_of(facts, Epoch.at(0.0), forces=forces, source=text)
    if found.centre.name != "earth":
        raise ValueError(f"{text}: positions of {found.name} are about the Sun; orbits about the Earth are propagated")
    return Course(
        found.name, found.problem, text, "those of the determination", found.assumed, True, True, beliefs=found.beliefs
    )


def _of_scenario(text: str, forces: str | None) -> Course:
    from piazzi.scenarios import load_scenario

    if forces is not None:
        raise click.UsageError(
            "--forces is for files of orbits; a scenario has its own", click.get_current_context(silent=True)
        )
    scenario = load_scenario(text)
    problem = scenario.problem
    is_orbit = {*STATES} <= {*problem.model.states} and {"field", "fixed", "free"} <= {*problem.functions}
    uncertain = bool(problem.covariance.any())
    return Course(
        scenario.name, problem, f"the prior of {text}", "those of the scenario", (), is_orbit, uncertain, scenario.times
    )


def span_of(course: Course, begin: str | None, end: str | None, step: str | None) -> Array:
    """Times (K,) to propagate to, s past the problem's epoch; those of a scenario where nothing is asked for.

    Raises
    ------
    ValueError
        For dates and times that cannot be read, or too many states.
    """
    problem, given = course.problem, course.times
    if given is not None and begin is end is step is None:
        return given
    own = float(given[0]) if given is not None else 0.0
    first = own if begin is None else _time(problem, begin, "--from", own)
    usual = SPAN if given is None else float(given[-1] - given[0])
    last = first + usual if end is None else _time(problem, end, "--to", first)
    first, last = min(first, last), max(first, last)
    every = STEP if step is None else positive_duration(step, "--step")
    count = int(np.floor((last - first) / every * (1 + 1e-12))) + 1
    if count > MOST:
        raise ValueError(f"--to and --step make {count:g} states; at most {MOST:g} are allowed")
    times = first + every * np.arange(count)
    return times if last - times[-1] < 1e-6 else np.append(times, last)


def _time(problem: Problem, text: str, what: str, since: float) -> float:
    """Seconds past the epoch of a date, or of a time after `since`."""
    plain = text.strip().removeprefix("+")
    try:
        return since + duration(plain, what)
    except ValueError:
        if problem.epoch is None:
            raise
    from piazzi.determination.words import date

    try:
        return float(date(text, what) - problem.epoch)
    except ValueError as error:
        raise ValueError(f"{error}; or write a length of time such as 6h or 3d") from None
