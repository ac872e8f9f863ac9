"""What a comparison means, in plain words: what is best, whose covariance is inconsistent and how, what it costs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import isfinite

from piazzi.evaluate import Comparison, Row
from piazzi.evaluate.comparison_table import row_display
from piazzi.evaluate.judgement import (
    CLEARLY,
    CONSISTENT,
    OPTIMISTIC,
    PESSIMISTIC,
    SAME_ERROR,
    SLOW_CONVERGENCE,
    claims,
    errors_known,
    failing,
    fails_at_first_only,
    not_diverged,
)
from piazzi.evaluate.quantities import duration, number
from piazzi.present.report.blocks import Point, Tone

_HEADING = {"realtime": "Best in real time", "delayed": "Best with all measurements"}
_PART = {"realtime": "in the last half of the run", "delayed": "over the whole run"}
_VIEW = {"realtime": "in real time", "delayed": "delayed"}
_FAULTS = {
    "NIS": "are larger or smaller than their covariance predicts",
    "whiteness": "are correlated in time",
    "bias": "have a mean other than zero",
}
_CLAIMS: Mapping[int, tuple[str, Tone, str]] = {
    OPTIMISTIC: ("Optimistic covariance", "bad", ": widen it, or find what the model leaves out"),
    CONSISTENT: ("Consistent covariance", "good", ", as far as one run can tell"),
    PESSIMISTIC: ("Pessimistic covariance", "plain", ""),
}
_FEW = 3  # names that a sentence lists before it counts them


def points(comparison: Comparison) -> list[Point]:
    """The summary of a comparison, the most useful first."""
    rows = comparison.rows
    judged = not_diverged(rows)
    out: list[Point] = []
    if errors_known(judged):
        out += [p for view in ("realtime", "delayed") for p in _best(comparison, [r for r in judged if r.view == view], view)]
    elif judged:
        out.append(Point("Errors unknown", "There is no truth to compare with; innovations are judged instead."))
    out += _failed(rows)
    out += _consistency(comparison)
    out += _not_white(judged)
    out += _slow_convergence(comparison, judged)
    out += _cost(rows)
    return out or [Point("Nothing to show", "No estimator gave a result.", "bad")]


def _counted(row: Row) -> Mapping[str, float | None]:
    """Errors that count for a row: of the last half in real time, of the whole run for delayed estimates."""
    return row.rmse_last_half if row.view == "realtime" else row.rmse


def _best(comparison: Comparison, rows: Sequence[Row], view: str) -> list[Point]:
    group = _first_group(rows)
    found = [(v, r) for r in rows if (v := _counted(r).get(group)) is not None and isfinite(v)]
    if not found:
        return []
    ranked = sorted(found, key=lambda pair: pair[0])
    best, first = ranked[0]
    level = [r.estimator for v, r in ranked if v <= SAME_ERROR * best]
    others = [v for v, _ in ranked[len(level) :]]
    text = f"{listed(level)}: {_errors(comparison, first)} {_PART[view]}"
    if others:
        text += f"; {'the other has' if len(others) == 1 else 'the others have'} {_more(others, best)}"
    elif len(ranked) == 1:
        text += "; there is no other to compare with"
    if others and others[-1] < CLEARLY * best:
        text += ", a difference that one run cannot establish"
    text += _bound(comparison, first, group)
    return [Point(_HEADING[view], f"{text}.", "good")]


def _bound(comparison: Comparison, row: Row, group: str) -> str:
    """What the best error could be on average, where that is known."""
    bound = (row.crlb_last_half if row.view == "realtime" else row.crlb).get(group)
    if bound is None or not isfinite(bound):
        return ""
    show = row_display(comparison.problem.model, comparison.rows, group)
    return f". The Cramer-Rao bound, a mean over many such runs, is {number(bound * show.factor, 3)}{show.suffix}"


def _first_group(rows: Sequence[Row]) -> str:
    """The first group of states whose error is known."""
    return next((g for r in rows for g, v in _counted(r).items() if v is not None and isfinite(v)), "")


def _errors(comparison: Comparison, row: Row) -> str:
    parts = []
    for group, value in _counted(row).items():
        if value is not None:
            show = row_display(comparison.problem.model, comparison.rows, group)
            parts.append(f"{group} error {number(value * show.factor)}{show.suffix}")
    return f"{listed(parts)} (RMS)"


def _more(others: Sequence[float], best: float) -> str:
    """How much larger the errors of others are, from the smallest to the largest."""
    if best <= 0:
        return "more"
    low, high = others[0] / best, others[-1] / best
    if high < 2:
        ends = [f"{number(100 * (v - 1), 2)} %" for v in (low, high)]
        return f"{' to '.join(dict.fromkeys(ends))} more"
    return f"{' to '.join(dict.fromkeys(number(v, 2) for v in (low, high)))} times that"


def _failed(rows: Sequence[Row]) -> list[Point]:
    failed = {r.estimator: r.message for r in rows if not r.success}
    out = [Point("Did not succeed", f"{name}: {message}.", "bad") for name, message in failed.items()]
    remarks = {r.estimator: r.message for r in rows if r.success and r.message}
    out += [Point("Note", f"{name}: {message}.") for name, message in remarks.items()]
    lost = [r for r in rows if r.success and r.diverged]
    if lost:
        out.append(
            Point(
                "Diverged", f"{_named(lost, rows)}: errors stay far beyond the covariance and do not come down enough.", "bad"
            )
        )
    return out


def _consistency(comparison: Comparison) -> list[Point]:
    """Whose covariance is consistent with the errors."""
    found = claims(comparison.rows, comparison.tracking.values)
    everyone = [r for claim in found for r in claim.rows]
    what = "Errors" if errors_known(not_diverged(comparison.rows)) else "Innovations"
    out = []
    for claim in found:
        heading, tone, advice = _CLAIMS[claim.sign]
        out.append(Point(heading, f"{what} of {_named(claim.rows, everyone)} are {claim.text}{advice}.", tone))
    early = [r for r in everyone if fails_at_first_only(r)]
    if early:
        text = f"Over the whole run the errors of {_named(early, everyone)} are inconsistent with the covariance (NEES)."
        out.append(Point("Inconsistent at first", text, "bad"))
    return out


def _not_white(rows: Sequence[Row]) -> list[Point]:
    """Whose innovations speak against the model, and in which way."""
    wrong: dict[tuple[str, ...], list[Row]] = {}
    for row in rows:
        tests = tuple(_FAULTS[name] for name in failing(row) if name in _FAULTS)
        if tests:
            wrong.setdefault(tests, []).append(row)
    if not wrong:
        return []
    parts = [f"those of {_named(found, rows)} {listed(tests)}" for tests, found in wrong.items()]
    text = f"Innovations should be white noise, but {'; '.join(parts)} (tests at the 5 % level)."
    return [Point("Innovations are not white noise", text, "bad")]


def _named(chosen: Sequence[Row], everyone: Sequence[Row]) -> str:
    """Estimators as a sentence lists them: a window without its view where both are meant, "all but" where few are left out."""
    left = [r for r in everyone if r not in chosen]
    if not left and len(everyone) > 1:
        return "all"
    if len(left) <= _FEW < len(chosen):
        return f"all but {_named(left, everyone)}"
    names = []
    for row in chosen:
        both = [r for r in everyone if r.estimator == row.estimator]
        whole = len(both) == 1 or all(r in chosen for r in both)
        names.append(row.estimator if whole else f"{row.estimator} {_VIEW[row.view]}")
    return listed(names)


def _slow_convergence(comparison: Comparison, rows: Sequence[Row]) -> list[Point]:
    """Who is far off before settling."""
    rows = [r for r in rows if r.view == "realtime"]
    group = _first_group(rows)
    slow, sizes = [], []
    for r in rows:
        whole, late = r.rmse.get(group), r.rmse_last_half.get(group)
        if whole is not None and late is not None and isfinite(whole) and whole > SLOW_CONVERGENCE * late:
            slow.append(r)
            sizes.append(whole)
    if not slow:
        return []
    show = row_display(comparison.problem.model, comparison.rows, group)
    ends = dict.fromkeys(f"{number(v * show.factor, 3)}{show.suffix}" for v in (min(sizes), max(sizes)))
    text = f"Over the whole run the {group} error of {_named(slow, rows)} is {' to '.join(ends)} (RMS)"
    return [Point("Slow to converge", f"{text}: do not use the first estimates{_convergence_times(slow)}.", "bad")]


def _convergence_times(rows: Sequence[Row]) -> str:
    """When they have settled, where that is known."""
    found = [r.convergence_time for r in rows if r.convergence_time is not None and isfinite(r.convergence_time)]
    if not found:
        return ""
    ends = dict.fromkeys(duration(t) for t in (min(found), max(found)))
    return f" before {' to '.join(ends)}, when they have settled"


def _cost(rows: Sequence[Row]) -> list[Point]:
    seconds = {r.estimator: r.seconds for r in rows if r.success and r.seconds}
    if not seconds:
        return []
    ranked = sorted(seconds, key=lambda name: seconds[name] or 0.0)
    first, last = ranked[0], ranked[-1]
    text = f"{first} takes {duration(seconds[first])}"
    if len(ranked) > 1:
        ratio = (seconds[last] or 0.0) / (seconds[first] or 1.0)
        text += f", {last} {duration(seconds[last])}, {number(ratio, 2)} times as long"
    return [Point("Cost", f"{text}.")]


def listed(names: Sequence[str]) -> str:
    """Names as a sentence lists them."""
    names = list(dict.fromkeys(names))
    return "".join(names) if len(names) < 2 else f"{', '.join(names[:-1])} and {names[-1]}"
