"""What a comparison means, in plain words: what is best, what is not to be trusted and why, what it costs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import isfinite

from piazzi.evaluate import Comparison, Row
from piazzi.evaluate.display import expected_nis, group_display
from piazzi.evaluate.quantities import duration, number, sigma_factor
from piazzi.present.colours import label_of
from piazzi.present.report.blocks import Point

_HEADING = {"realtime": "Best while measuring", "delayed": "Best with all in hand"}
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
    out += _settling(comparison, sound)
    out += _cost(rows)
    return out or [Point("Nothing to show", "No estimator gave a result.", "bad")]


def _best(comparison: Comparison, rows: Sequence[Row], view: str) -> list[Point]:
    group = next((g for r in rows for g, v in r.rmse_last_half.items() if v is not None and isfinite(v)), None)
    if group is None:
        return []
    ranked = sorted(
        ((v, r) for r in rows if (v := r.rmse_last_half.get(group)) is not None and isfinite(v)), key=lambda found: found[0]
    )
    best, first = ranked[0]
    level = [r.estimator for v, r in ranked if v <= _LEVEL * best]
    others = [v for v, _ in ranked[len(level) :]]
    text = f"{listed(level)}: {_errors(comparison, first)} in the last half of the run"
    if others:
        text += f"; {'the other has' if len(others) == 1 else 'the others have'} {_more(others, best)}"
    elif len(ranked) == 1:
        text += "; there is no other to compare with"
    if others and others[-1] < _HONEST * best:
        text += ", which may be the luck of one run"
    return [Point(_HEADING[view], f"{text}.{_whole_run(comparison, rows, group, level)}", "good")]


def _whole_run(comparison: Comparison, rows: Sequence[Row], group: str, level: Sequence[str]) -> str:
    """Who is best over the whole run, where that is another one."""
    found = [(v, r.estimator) for r in rows if (v := r.rmse.get(group)) is not None and isfinite(v)]
    value, name = min(found, default=(0.0, ""))
    show = group_display(comparison, group)
    return f" Over the whole run {name}: {number(value * show.factor)}{show.suffix}." if name and name not in level else ""


def _errors(comparison: Comparison, row: Row) -> str:
    parts = []
    for group, value in row.rmse_last_half.items():
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
    lost = [label_of(r.estimator, r.view) for r in rows if r.success and r.diverged]
    if lost:
        out.append(Point("Diverged", f"{listed(lost)}: errors stay far beyond the covariance and do not come down.", "bad"))
    return out


def _honesty(comparison: Comparison, rows: Sequence[Row], known: bool) -> list[Point]:
    """Whose covariance can be taken at its word."""
    n, m = comparison.problem.model.n, expected_nis(comparison)
    factors: dict[str, float] = {}
    for r in rows:
        value, expected = (r.mean_nees_last_half, float(n)) if known else (r.mean_nis, m)
        if value is not None and isfinite(value) and expected:
            factors[label_of(r.estimator, r.view)] = sigma_factor(value, expected)
    what = "errors" if known else "innovations"
    small = {name: f for name, f in factors.items() if f > _HONEST}
    large = {name: f for name, f in factors.items() if f < 1 / _HONEST}
    fair = [name for name in factors if name not in small and name not in large]
    out = []
    if small:
        text = f"{_with_factors(small)} larger than the covariance says: widen it, or find what the model leaves out."
        out.append(Point("Too sure of themselves", f"{what.capitalize()} of {text}", "bad"))
    if fair:
        names = "all" if len(fair) == len(factors) > 1 else listed(fair)
        text = f"{what.capitalize()} of {names} are about as large as the covariance says"
        out.append(Point("Covariance holds", f"{text}, as far as one run can tell.", "good"))
    if large:
        text = f"{_with_factors({k: 1 / f if f > 0 else f for k, f in large.items()})} smaller than the covariance says"
        out.append(Point("More cautious than needed", f"{what.capitalize()} of {text}, in this one run."))
    return out


def _with_factors(found: Mapping[str, float]) -> str:
    factors = sorted(found.values())
    low, high = number(factors[0], 2), number(factors[-1], 2)
    return f"{listed(list(found))} are {low if low == high else f'{low} to {high}'} times"


def _settling(comparison: Comparison, rows: Sequence[Row]) -> list[Point]:
    """Who is far off before settling."""
    group = next((g for r in rows for g, v in r.rmse_last_half.items() if v is not None and isfinite(v)), None)
    if group is None:
        return []
    slow: dict[str, float] = {}
    for r in rows:
        whole, late = r.rmse.get(group), r.rmse_last_half.get(group)
        if whole is not None and late is not None and isfinite(whole) and whole > _SETTLING * late:
            slow[label_of(r.estimator, r.view)] = whole
    if not slow:
        return []
    show = group_display(comparison, group)
    sizes = [f"{number(v * show.factor, 3)}{show.suffix}" for v in (min(slow.values()), max(slow.values()))]
    size = sizes[0] if sizes[0] == sizes[1] else f"{sizes[0]} to {sizes[1]}"
    text = f"Over the whole run the {group} error of {_or_count(list(slow), len(rows))} is {size} (RMS)"
    return [Point("Not before it settles", f"{text}: do not use the first estimates.", "bad")]


def _or_count(names: Sequence[str], of: int) -> str:
    """The names where they are few, else how many of how many."""
    return listed(names) if len(names) <= _FEW else f"{'all' if len(names) == of else f'{len(names)} of {of}'} estimates"


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
    """Names as a sentence lists them; names with commas in them are kept apart by semicolons."""
    names = list(dict.fromkeys(names))
    if len(names) < 2:
        return "".join(names)
    comma = "; " if any("," in name for name in names) else ", "
    return f"{comma.join(names[:-1])} and {names[-1]}"
