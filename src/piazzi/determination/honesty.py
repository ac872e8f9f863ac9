"""The sentence on honesty: whether errors are as large as sigmas say, by residuals, by priors and by rows left out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from piazzi.determination.analysis import Analysis
from piazzi.determination.common import together
from piazzi.determination.departures import SURE, departures
from piazzi.determination.faults import STATION, Faults
from piazzi.determination.holding import GOOD, Held
from piazzi.determination.passes import labels_of
from piazzi.determination.remedies import remedy
from piazzi.determination.sentence import Sentence
from piazzi.determination.setup import Setup
from piazzi.estimate.chi_square import quantile
from piazzi.estimate.estimator import Estimate
from piazzi.evaluate.quantities import number
from piazzi.problem.checks import Array


def honest(
    given: Setup, answer: Estimate, analysis: Analysis | None, keep: Array, faults: Faults, held: Held | None
) -> Sentence:
    """Whether errors are as large as sigmas say, and what explains them else; what passes were left out for is said."""
    fitted = believable(given, answer, _fitted(given, analysis, keep, faults.reasons))
    said = explained(given, answer, analysis, keep, unseen(fitted, held))
    more = f" Left out: {'; '.join(faults.said)}." if faults.said else ""
    return replace(said, sentence=said.sentence + more)


def _fitted(given: Setup, analysis: Analysis | None, keep: Array, reasons: Array) -> Sentence:
    test = f"sum of squared residuals in sigma against chi-square at {SURE:.1%}"
    if analysis is None:
        return Sentence(None, None, test, "Honest: there are no residuals to judge by.")
    labels, there = labels_of(given), np.isfinite(given.tracking.values).any(axis=1)
    left = dict.fromkeys(labels[reasons == STATION].tolist())
    wrong = sorted(label for label in left if (reasons[(labels == label) & there] == STATION).all())
    if wrong:
        names = ", ".join(wrong)
        return Sentence(False, None, test, f"Not honest: all measurements of {names} contradict those of the others.")
    whitened = analysis.whitened[keep]
    squares = whitened[np.isfinite(whitened)] ** 2
    free = len(squares) - given.problem.model.n + len(analysis.prior_miss)
    if free < 1:
        return Sentence(None, None, test, "Honest: there are no more measurements than unknowns, so sigmas cannot be tested.")
    total = float(squares.sum() + (analysis.prior_miss**2).sum())
    size = float(np.sqrt(total / free))
    high, low = quantile(SURE, free), quantile(1.0 - SURE, free)
    shared = together(given, analysis, keep)
    if total <= high and shared is not None and shared[0] > quantile(SURE, shared[1]):
        size = float(np.sqrt(shared[0] / shared[1]))
        return Sentence(
            False, size, f"{test}; medians of passes likewise",
            f"Not honest: residuals of a pass go together, by {number(size, 3)} times what their sigmas allow.",
        )  # fmt: skip
    if total > high:
        return Sentence(
            False, size, test,
            f"Not honest: residuals are {number(size, 3)} times as large as their sigmas say, "
            "and so may be the errors of the orbit.",
        )  # fmt: skip
    fits = f"residuals are {number(size, 3)} of their sigmas" if total < low else "residuals are as large as their sigmas say"
    note = ": these are cautious" if total < low else ""
    return Sentence(True, size, test, f"Honest: {fits}{note}.")


def believable(given: Setup, answer: Estimate, fitted: Sentence) -> Sentence:
    """The sentence on residuals with whether values beside the orbit are near what was known of them before."""
    found = departures(given, answer) if answer.success and answer.view == "delayed" else None
    if found is None:
        return fitted
    test = f"{fitted.test}; values beside the orbit against what was known before, at {SURE:.1%} together"
    if fitted.ok is False or not found.contradict:
        return replace(fitted, test=test)
    return Sentence(False, found.excess, test, f"Not honest: {found.said}.")


def unseen(fitted: Sentence, held: Held | None) -> Sentence:
    """The sentence on residuals with what became of rows that were predicted by the others."""
    if held is None or not held.groups or not held.freedom:
        return fitted
    what = {"passes": "passes left out in turn are", "last": "the last pass, left out, is"}.get(
        held.how, "the last rows, left out, are"
    )
    many = f"{len(held.groups)} " if held.how == "passes" else ""
    found = (
        f"{many}{what} predicted with squared errors {number(held.nees, 2)} times what their covariances say "
        f"({held.coverage:.0%} within 95 %)"
    )
    test = f"{fitted.test}; predictions of rows left out, up to {GOOD:g} times their covariances"
    if held.honest or fitted.ok is False:
        figure = fitted.figure if held.honest else max(fitted.figure or 0.0, float(np.sqrt(held.nees)))
        return Sentence(fitted.ok, figure, test, f"{fitted.sentence} {found[0].upper()}{found[1:]}.")
    return Sentence(False, float(np.sqrt(held.nees)), test, f"Not honest: {found}.")


def explained(given: Setup, answer: Estimate, analysis: Analysis | None, keep: Array, said: Sentence) -> Sentence:
    """The sentence on residuals with the option that explains them best, where they are not as they should be."""
    if said.ok is not False or said.figure is None or analysis is None or answer.view != "delayed" or not answer.success:
        return said
    words = remedy(given, answer.mean, analysis, keep)
    return replace(said, sentence=f"{said.sentence} Explained by {words}.") if words else said
