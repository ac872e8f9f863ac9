"""The simulation options of a problem: noiseless observations, a perfect initial guess, a fixed or a drawn truth."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Literal

from piazzi.problem import Gaussian, Problem, Truth


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
