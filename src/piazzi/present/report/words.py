"""What a comparison means, in plain words: what is best, what is not to be trusted and why, what it costs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import isfinite

from piazzi.evaluate import Comparison, Row
from piazzi.evaluate.display import expected_nis, failing, group_display
from piazzi.evaluate.quantities import duration, number, sigma_factor
from piazzi.present.report.blocks import Point, Tone

_HEADING = {"realtime": "Best while measuring", "delayed": "Best with all in hand"}
_PART = {"realtime": "in the last half of the run", "delayed": "over the whole run"}
_VIEW = {"realtime": "in real time", "delayed": "delayed"}
_FAULTS = {"NIS": "have the wrong size", "whiteness": "hang together in time", "bias": "are off to one side"}
_CLAIMS: tuple[tuple[int, str, Tone], ...] = (
    (1, "Too sure of themselves", "bad"),
    (0, "Covariance holds", "good"),
    (-1, "Too cautious", "plain"),
)
_LEVEL = 1.01  # errors nearer than this are called the same
_HONEST = 1.5  # one run cannot tell a smaller factor
_FEW = 3  # names that a sentence lists before it counts them
_SETTLING = 5.0  # times the error of the last half that the whole run's must be to be called slow to settle


def points(comparison: Comparison) -> list[Point]:
    """The summary of a comparison, the most useful first."""
    rows = comparison.rows
    sound = [r for r in rows if r.success and not r.diverged]
    known = any(v is not None for r in sound for v in r.rmse.values())
    out: list[Point] = []
    if known:
        out += [p for view in ("realtime", "delayed") for p in _best(comparison, [r for r in sound if r.view == view], view)]
    elif sound:
        out.append(Point("Errors unknown", "There is no truth to compare with: here is what estimators say of themselves."))
    out += _failed(rows)
    out += _honesty(comparison, sound, known)
    out += _against(sound)
    out += _settling(comparison, sound)
    out += _cost(rows)
    return out or [Point("Nothing to show", "No estimator gave a result.", "bad")]


def _counted(row: Row) -> Mapping[str, float | None]:
    """Errors that count for a row: once settled while measuring, over the whole run where all measurements are in hand."""
    return row.rmse_last_half if row.view == "realtime" else row.rmse


def _best(comparison: Comparison, rows: Sequence[Row], view: str) -> list[Point]:
    group = _first_group(rows)
    found = [(v, r) for r in rows if (v := _counted(r).get(group)) is not None and isfinite(v)]
    if not found:
        return []
    ranked = sorted(found, key=lambda pair: pair[0])
    best, first = ranked[0]
    level = [r.estimator for v, r in ranked if v <= _LEVEL * best]
    others = [v for v, _ in ranked[len(level) :]]
    text = f"{listed(level)}: {_errors(comparison, first)} {_PART[view]}"
    if others:
        text += f"; {'the other has' if len(others) == 1 else 'the others have'} {_more(others, best)}"
    elif len(ranked) == 1:
        text += "; there is no other to compare with"
    if others and others[-1] < _HONEST * best:
        text += ", which may be the luck of one run"
    text += _bound(comparison, first, group)
    return [Point(_HEADING[view], f"{text}.", "good")]


def _bound(comparison: Comparison, row: Row, group: str) -> str:
    """What the best error could be on average, where that is known."""
    bound = (row.crlb_last_half if row.view == "realtime" else row.crlb).get(group)
    if bound is None or not isfinite(bound):
        return ""
    show = group_display(comparison, group)
    return f". Over many such runs no unbiased estimator does better than {number(bound * show.factor, 3)}{show.suffix}"


def _first_group(rows: Sequence[Row]) -> str:
    """The first group of states whose error is known."""
    return next((g for r in rows for g, v in _counted(r).items() if v is not None and isfinite(v)), "")


def _errors(comparison: Comparison, row: Row) -> str:
    parts = []
    for group, value in _counted(row).items():
        if value is not None:
            show = group_display(comparison, group)
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
    lost = [r for r in rows if r.success and r.diverged]
    if lost:
        out.append(
            Point(
                "Diverged", f"{_named(lost, rows)}: errors stay far beyond the covariance and do not come down enough.", "bad"
            )
        )
    return out


def _judged(row: Row, known: bool, m: float | None) -> tuple[float, int] | None:
    """Errors (else innovations) in units of what the covariance says, and 1 where they are too large, -1 too small, else 0.

    By the test of mean NEES that allows for correlation in time, where there is one; else by a factor that one run can tell.
    """
    early = row.view != "realtime"
    of_errors = (row.mean_nees, row.nees_ideal) if early else (row.mean_nees_last_half, row.nees_ideal_last_half)
    value, expected = of_errors if known else (row.mean_nis, m)
    if value is None or not isfinite(value) or not expected:
        return None
    factor = sigma_factor(value, expected)
    check = (row.honesty.nees if early else row.honesty.nees_last_half) if known else row.honesty.nis
    if check is None or not isfinite(check.high):
        return factor, int(factor > _HONEST) - int(factor < 1 / _HONEST)
    return factor, int(check.statistic > check.high) - int(check.statistic < check.low)


def _honesty(comparison: Comparison, rows: Sequence[Row], known: bool) -> list[Point]:
    """Whose covariance can be taken at its word."""
    m = expected_nis(comparison)
    found = [(r, judged) for r in rows if (judged := _judged(r, known, m)) is not None]
    judged_rows, what = [r for r, _ in found], "Errors" if known else "Innovations"
    out = []
    for sign, heading, tone in _CLAIMS:
        chosen = [(r, factor) for r, (factor, where) in found if where == sign]
        if chosen:
            names, factors = _named([r for r, _ in chosen], judged_rows), [f for _, f in chosen]
            out.append(Point(heading, f"{what} of {names} are {_claim(sign, factors)}.", tone))
    return out


def _claim(sign: int, factors: Sequence[float]) -> str:
    if sign > 0:
        return f"{_span(factors)} times as large as the covariance says: widen it, or find what the model leaves out"
    if sign < 0:
        return f"only {_span(factors)} times as large as the covariance says"
    return "as large as the covariance says, as far as one run can tell"


def _against(rows: Sequence[Row]) -> list[Point]:
    """Whose innovations speak against the model, and in which way."""
    wrong: dict[tuple[str, ...], list[Row]] = {}
    for row in rows:
        tests = tuple(_FAULTS[name] for name in failing(row) if name in _FAULTS)
        if tests:
            wrong.setdefault(tests, []).append(row)
    if not wrong:
        return []
    parts = [f"those of {_named(found, rows)} {listed(tests)}" for tests, found in wrong.items()]
    text = f"Innovations should be noise, but {'; '.join(parts)} (tests at the 5 % level)."
    return [Point("Innovations are not noise", text, "bad")]


def _span(factors: Sequence[float]) -> str:
    ends = dict.fromkeys(number(v, 2) for v in (min(factors), max(factors)))
    return " to ".join(ends)


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


def _settling(comparison: Comparison, rows: Sequence[Row]) -> list[Point]:
    """Who is far off before settling."""
    rows = [r for r in rows if r.view == "realtime"]
    group = _first_group(rows)
    slow, sizes = [], []
    for r in rows:
        whole, late = r.rmse.get(group), r.rmse_last_half.get(group)
        if whole is not None and late is not None and isfinite(whole) and whole > _SETTLING * late:
            slow.append(r)
            sizes.append(whole)
    if not slow:
        return []
    show = group_display(comparison, group)
    ends = dict.fromkeys(f"{number(v * show.factor, 3)}{show.suffix}" for v in (min(sizes), max(sizes)))
    text = f"Over the whole run the {group} error of {_named(slow, rows)} is {' to '.join(ends)} (RMS)"
    return [Point("Not before it settles", f"{text}: do not use the first estimates{_settled(slow)}.", "bad")]


def _settled(rows: Sequence[Row]) -> str:
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
