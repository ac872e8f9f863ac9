"""Observability in plain words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from piazzi.estimate.chi_square import quantile
from piazzi.evaluate.attempts import Attempt
from piazzi.evaluate.information import Information
from piazzi.evaluate.judgement import CLEARLY
from piazzi.evaluate.quantities import displays, number
from piazzi.evaluate.twins import Search
from piazzi.model import Model
from piazzi.problem.checks import Array

_SHOWN = 0.1  # smallest component of a direction that is worth telling
AS_THE_PRIOR = 1.0  # singular value up to which the measurements tell less than the prior
# share of matched runs, of errors that never change their direction, that stay within what counts as attained
_ATTAINED_PROBABILITY = 0.999
_RULED_OUT = 5.0  # prior sigmas from which a twin is ruled out
_LISTED = 4  # twins that are told one by one
_WITHIN_NOISE = 3.0  # difference of all measurements together, in sigma, that noise hides


def weakest(names: Sequence[str], direction: Array) -> dict[str, float]:
    """Components of a unit vector by name, largest first, without those that are small."""
    order = np.argsort(-np.abs(direction), kind="stable")
    return {names[i]: round(float(direction[i]), 6) for i in order if abs(direction[i]) >= _SHOWN}


def unreliable(message: str) -> list[str]:
    """That there is no truth, and no estimate to take its place, where `message` says why."""
    reason = "the factor graph, whose estimate replaces the unknown truth, did not succeed"
    return [f"Unreliable: {reason}: {message}."] if message else []


def local(
    model: Model, found: Information, weakest_direction: Mapping[str, float], since: float | None, *, noise: bool
) -> list[str]:
    """Whether the first state is observable, and to what sigma; `since` when, and whether process noise is assumed."""
    blind = found.blind
    direction = " ".join(f"{c:+.2f} {name}" for name, c in weakest_direction.items())
    if blind:
        unseen = [name for name, s in zip(model.names, found.crlb_sigma.tolist(), strict=True) if not np.isfinite(s)]
        many = f"{blind} of {model.n} directions of the first state {'is' if blind == 1 else 'are'} not observable"
        return [f"Observability: {many}: a step along {direction} changes no measurement; no bound for {', '.join(unseen)}."]
    sigmas = []
    bounds = found.crlb_sigma.tolist()
    shows = displays([model.unit(name) for name in model.names], [[s] for s in bounds], model.group_indices.values())
    for name, s, show in zip(model.names, bounds, shows, strict=True):
        sigmas.append(f"{name} {number(s * show.factor, 3)}{show.suffix}")
    smallest = float(found.singular_values[-1])
    how = "to" if smallest > AS_THE_PRIOR else "only to"
    better = "" if since is None else f" From t = {since:g} s on they determine every direction better than the prior."
    return [
        f"Observability: the first state is observable from the measurements alone, condition {number(found.condition, 3)}; "
        f"the weakest direction ({direction}) is known {how} {number(1 / smallest, 2)} prior sigma.{better}",
        f"{'With the process noise assumed, n' if noise else 'N'}o unbiased estimator can do better than sigma "
        f"{', '.join(sigmas)}.",
    ]


def twins_found(names: Sequence[str], search: Search, count: int, *, continuum: bool) -> list[str]:
    """The twins of states of these names, for so many measurements; a continuum of them where directions are unobservable."""
    twins = search.twins
    if not twins:
        part = "" if search.fitted == search.starts else f", those that come nearest of {search.starts}"
        return [f"Twins: none found from {search.fitted} starts{part}." if search.starts else "Twins: not looked for."]
    if continuum:
        return [f"Twins: a continuum of first states gives the same measurements; {len(twins)} of them were found."]
    out = []
    for twin in twins[:_LISTED]:
        state = ", ".join(f"{name} {number(v, 4)}" for name, v in zip(names, twin.state, strict=True))
        exact = twin.misfit < 1e-6
        hidden = twin.misfit * count**0.5 <= _WITHIN_NOISE
        what = "exactly the same measurements" if exact else "the same measurements to within their noise" if hidden else (
            f"nearly the same measurements (RMS difference {number(twin.misfit, 2)} sigma)"
        )  # fmt: skip
        place = "" if twin.prior_distance is None else f", {number(twin.prior_distance, 3)} sigma from the prior mean"
        out.append(f"Twin: {state} gives {what}{place}.")
    if len(twins) > _LISTED:
        out.append(f"And {len(twins) - _LISTED} more twins.")
    far = [twin.prior_distance is not None and twin.prior_distance > _RULED_OUT for twin in twins]
    if all(far):
        out.append("Only the prior distinguishes the truth from a twin, and does so clearly.")
    return out


def conclusion(attempts: Sequence[Attempt], n: int, *, blind: bool) -> list[str]:
    """What limits the estimators of n values, where the truth is known; `blind` where directions are unobservable."""
    tried = {a.estimator: a for a in attempts}
    if not {"ekf", "graph"} <= tried.keys():
        return []
    ekf, graph, ideal = tried["ekf"], tried["graph"], tried["ekf at the truth"]
    sizes = f"{_times(ekf.excess)} for the EKF, {_times(graph.excess)} for the factor graph"
    out = [f"Errors of the last half, from the same prior and measurements, in units of the best that is possible: {sizes}."]
    on_twin = [a.estimator for a in (ekf, graph) if a.twin is not None]
    attained = float(np.sqrt(quantile(_ATTAINED_PROBABILITY, n) / n))
    if on_twin:
        out.append(f"Verdict: a twin; {' and '.join(on_twin)} ended on its orbit.")
    elif graph.excess <= attained < ekf.excess and ekf.excess > CLEARLY * graph.excess:
        out.append(
            "Verdict: linearisation. The information is there and the graph extracts it. The EKF does not because it takes its "
            "Jacobians once, at a wrong state; neither observability nor a twin limits it: "
            f"with Jacobians from the truth the same filter has {_times(ideal.excess)}."
        )
    elif max(ekf.excess, graph.excess) <= attained and blind:
        out.append("Verdict: observability. Both attain the bound; unobservable directions stay as uncertain as in the prior.")
    elif max(ekf.excess, graph.excess) <= attained:
        out.append("Verdict: both attain the bound; nothing is wrong.")
    else:
        out.append(
            "Verdict: neither estimator attains the bound, so linearisation or the model, not observability, limits them."
        )
    return out


def _times(excess: float) -> str:
    return number(excess, 2) if np.isfinite(excess) else "diverged"
