"""The other half of a scenario: what really happens, where that differs from what the estimators assume."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from piazzi.expressions import check
from piazzi.problem import Gaussian, Problem, ProcessNoise, Truth
from piazzi.scenarios.equations import Physics
from piazzi.scenarios.motion import read_integrator, read_manoeuvres
from piazzi.scenarios.table import Table, joined
from piazzi.scenarios.true_physics import read_true_physics
from piazzi.scenarios.values import read_noise
from piazzi.units import Units

if TYPE_CHECKING:
    from piazzi.earth import Epoch


def read_truth(file: Table, physics: Physics, prior: Gaussian | None, units: Units, epoch: Epoch | None = None) -> Truth | None:
    """What really happens, where it differs from what the estimators assume."""
    table = file.table("truth")
    state = table.raw("state")
    mean = None
    if isinstance(state, str):
        table.text("state", choices=("drawn", "mean"))
        mean = prior.mean if state == "mean" and prior is not None else None
    elif state is not None:
        vector = table.vector("state", physics.states)
        mean = None if vector is None else vector * physics.factors(physics.states)
    noise: ProcessNoise | None = None
    if isinstance(table.raw("process_noise"), bool):
        noise = None if table.raw("process_noise") else ProcessNoise(np.zeros(len(physics.states)), "step")
    elif "process_noise" in table:
        noise = read_noise(table.table("process_noise"), physics)
    integrator = read_integrator(table.table("integrator"), units)
    noisy = table.flag("measurement_noise", True)
    manoeuvres = read_manoeuvres(table, physics, units) if "manoeuvres" in table else None
    accept = table.texts("accept")
    known = [*physics.units]
    for i, text in enumerate(accept):
        with table.faults.at(joined(table.at("accept"), i)):
            check(text, known)
    true = read_true_physics(file, table, physics, units, epoch)
    table.finish()
    return Truth(
        mean, true.parameters, noise, integrator, bool(noisy), manoeuvres, accept,
        true.dynamics, true.definitions, true.functions, true.stations, true.places,
    )  # fmt: skip


def vary(
    problem: Problem, *, truth: Literal["fixed", "drawn"] | None = None, perfect_guess: bool = False, noiseless: bool = False
) -> Problem:
    """The problem with another truth half.

    Parameters
    ----------
    truth : "fixed" or "drawn", optional
        Where the truth starts: where the problem says or else at the prior's mean; or drawn from the prior.
    perfect_guess : bool
        The prior's mean is the true first state: a fixed one becomes the mean; a drawn one gives way to the mean.
    noiseless : bool
        Sensors without error.  What the estimators assume about them stays.

    Raises
    ------
    ValueError
        For another `truth`.
    """
    if truth not in (None, "fixed", "drawn"):
        raise ValueError(f"truth is {truth!r}; it must be 'fixed' or 'drawn'")
    half = problem.truth or Truth()
    if truth == "drawn":
        half = replace(half, state=None)
    elif truth == "fixed" and half.state is None:
        half = replace(half, state=problem.prior.mean)
    if noiseless:
        half = replace(half, measurement_noise=False)
    return _with_perfect_guess(problem, half) if perfect_guess else replace(problem, truth=half)


def _with_perfect_guess(problem: Problem, half: Truth) -> Problem:
    state = problem.prior.mean if half.state is None else half.state
    guesses: dict[str, Any] = dict(problem.parameters)
    true = dict(half.parameters)
    for name in problem.model.constants:
        true.setdefault(name, float(guesses[name].mean[0]))
        guesses[name] = Gaussian([true[name]], guesses[name].covariance)
    return replace(
        problem,
        prior=Gaussian(state, problem.prior.covariance),
        parameters=guesses,
        truth=replace(half, state=state, parameters=true),
    )
