"""A comparison as a table, and as a sentence."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from html import escape
from typing import TYPE_CHECKING, Any

from piazzi.evaluate.grids import Grid, fits, rich_table
from piazzi.evaluate.judgement import (
    claims,
    divergences,
    errors_known,
    expected_nis,
    failing,
    fails_at_first_only,
    far_apart,
    not_diverged,
    tested,
)
from piazzi.evaluate.quantities import NOTHING, Display, display_of, duration, ends, ideal, number, unit_of
from piazzi.model import Model
from piazzi.text import printable

if TYPE_CHECKING:
    from rich.console import Console, ConsoleOptions, RenderResult

    from piazzi.evaluate.rows import Row
    from piazzi.problem.checks import Array

_VIEW = {"realtime": "real time", "delayed": "delayed"}
TESTS, PASSED, BOUND = "tests failed", "none", "bound"
LINEARISED_ONCE = "a filter and one pass of a smoother linearise each step once, graph, window:2 and smoother:3 anew"
_TEXT_COLUMNS = 2  # name and view, before the numbers


@dataclass(frozen=True)
class Column:
    """One column of the table: its name, which part of the run it covers, its unit or remark, and the text of every row."""

    name: str
    part: str
    unit: str
    texts: tuple[str, ...]

    @property
    def title(self) -> str:
        return f"{self.name}, {self.part}" if self.part else self.name


def row_display(model: Model, rows: Iterable[Row], group: str) -> Display:
    """The unit to show the errors of a group of a model's states in, one for all these rows."""
    unit = unit_of(model.unit(s) for s in dict(model.groups).get(group, (group,)))
    return display_of(unit, [v for r in rows for v in (r.rmse.get(group), r.rmse_last_half.get(group))])


def columns(model: Model, rows: Sequence[Row], values: Array) -> list[Column]:
    """Everything the table shows of rows about the measurements (J, m); columns without any value are left out."""
    found = [
        Column("estimator", "", "", tuple(printable(r.estimator) for r in rows)),
        Column("view", "", "", tuple(_VIEW.get(r.view, r.view) for r in rows)),
    ]
    for group in dict.fromkeys(g for r in rows for g in r.rmse):
        show = row_display(model, rows, group)
        for part, errors in (("whole run", [r.rmse for r in rows]), ("last half", [r.rmse_last_half for r in rows])):
            shown = (number(_times(e.get(group), show.factor)) for e in errors)
            found.append(Column(f"{printable(group)} RMSE", part, printable(show.unit), tuple(shown)))
        bounds = (number(_times(r.crlb_last_half.get(group), show.factor)) for r in rows)
        found.append(Column(f"{printable(group)} {BOUND}", "last half", printable(show.unit), tuple(bounds)))
    if not errors_known(rows):
        found += _without_truth(rows)
    whole, half = (ideal(r.nees_ideal for r in rows), ideal(r.nees_ideal_last_half for r in rows))
    found += [
        Column("mean NEES", "whole run", whole, tuple(number(r.mean_nees, 3) for r in rows)),
        Column("mean NEES", "last half", half, tuple(number(r.mean_nees_last_half, 3) for r in rows)),
        Column("mean NIS", "", ideal([expected_nis(values)]), tuple(number(r.mean_nis, 3) for r in rows)),
        Column(TESTS, "", "5 % each", tuple(", ".join(failing(r)) or (PASSED if tested(r) else "") for r in rows)),
        Column("iterations", "", "", tuple(str(r.iterations) if r.iterations else NOTHING for r in rows)),
        Column("time", "", "", tuple(duration(r.seconds) for r in rows)),
        Column("", "", "", tuple(_remark(r) for r in rows)),
    ]
    return [c for i, c in enumerate(found) if i < _TEXT_COLUMNS or any(v not in ("", NOTHING) for v in c.texts)]


def _without_truth(rows: Sequence[Row]) -> list[Column]:
    """What stands where errors would: residuals by unit, and how far the last states are from those of the first estimator."""
    found = []
    for unit in dict.fromkeys(unit for r in rows for unit in r.residual_rms):
        values = [r.residual_rms.get(unit) for r in rows]
        show = display_of(unit, values)
        shown = tuple(number(_times(v, show.factor)) for v in values)
        found.append(Column("residual RMS", "", printable(show.unit), shown))
    first = next((r.estimator for r in rows if r.success and r.apart is None), "")
    apart = tuple(number(r.apart, 2) for r in rows)
    return [*found, Column(f"last state from {printable(first)}", "", "sigma", apart)]


def grid(model: Model, rows: Sequence[Row], values: Array) -> Grid:
    """The table as text."""
    shown = columns(model, rows, values)
    heads = tuple("\n".join(filter(None, (c.title, c.unit and f"[{c.unit}]"))) for c in shown)
    return Grid("Comparison", heads, tuple(zip(*(c.texts for c in shown), strict=True)), _TEXT_COLUMNS)


def _times(value: float | None, factor: float) -> float | None:
    return None if value is None else value * factor


def _remark(row: Row) -> str:
    return "FAILED" if not row.success else "diverged" if row.diverged else ""


def html(model: Model, rows: Sequence[Row], values: Array) -> str:
    """The table and its sentences for a notebook; all text is escaped."""
    shown = columns(model, rows, values)
    head = "".join(f"<th>{escape(c.title)}{f'<br><small>{escape(c.unit)}</small>' if c.unit else ''}</th>" for c in shown)
    cells = zip(*(c.texts for c in shown), strict=True)
    body = "".join("<tr>" + "".join(f"<td>{escape(v)}</td>" for v in row) + "</tr>" for row in cells)
    says = "".join(f"<p>{escape(line)}</p>" for line in sentences(model, rows, values))
    return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>{says}"


def render(model: Model, rows: Sequence[Row], values: Array, console: Console, options: ConsoleOptions) -> RenderResult:
    """The comparison for rich, then its sentences.

    All columns where they fit the width; else those of the last half; else without bounds and tests; else a block of lines for
    each row.
    """
    from rich.text import Text

    everything = columns(model, rows, values)
    fewer = [c for c in everything if c.part != "whole run" and c.name != "iterations"]
    least = [c for c in fewer if c.name != TESTS and not c.name.endswith(BOUND)]
    for chosen in (everything, fewer, least):
        table = wide_table(chosen)
        if fits(table, console, options):
            yield table
            if chosen is not everything:
                yield Text("A wider terminal shows the whole run too.", style="dim")
            yield Text("")
            break
    else:
        yield from blocks(everything)
    for line in sentences(model, rows, values):
        yield Text(line)


def wide_table(shown: Sequence[Column]) -> Any:
    """A rich table that does not wrap."""
    heads = ["\n".join([*c.name.split(), *filter(None, (c.part, c.unit))]) for c in shown]
    words = [i < _TEXT_COLUMNS or not c.name for i, c in enumerate(shown)]
    return rich_table(zip(heads, words, strict=True), zip(*(c.texts for c in shown), strict=True), _style)


def blocks(shown: Sequence[Column]) -> Iterable[Any]:
    """For narrow terminals: every row as a title and lines of name and value."""
    from rich.text import Text

    for row in zip(*(c.texts for c in shown), strict=True):
        remark = [row[-1]] if _style(row[-1]) else []
        yield Text(" ".join([row[0], f"({row[1]})", *remark]), style="bold")
        for c, value in list(zip(shown, row, strict=True))[_TEXT_COLUMNS:]:
            if c.name and value != NOTHING:
                yield Text(f"  {c.title}: {value} {_bracket(c.unit)}".rstrip())
        yield Text("")


def _bracket(unit: str) -> str:
    return f"({unit})" if " " in unit else unit


def _style(value: str) -> str:
    return {"FAILED": "bold red", "diverged": "bold yellow"}.get(value, "")


# ---- what it means -------------------------------------------------------------------------------------------------------


def sentences(model: Model, rows: Sequence[Row], values: Array) -> list[str]:
    """What the table means, in plain words: who is best, whose covariance is consistent, who failed."""
    judged = not_diverged(rows)
    out = [f"{r.estimator} did not succeed: {r.message}." for r in rows if not r.success]
    out += divergences(rows)
    out += dict.fromkeys(f"{r.estimator}: {r.message}." for r in rows if r.success and r.message)
    out += [*_rejected(rows, len(values)), *_modes(rows)]
    known = errors_known(judged)
    if known:
        out += _best(model, rows, judged)
    elif judged:
        out.append("There is no truth to compare with, so errors are unknown.")
        out += _apart(rows)
    what, basis = ("Errors", "NEES of this one run") if known else ("Innovations", "NIS")
    for claim in claims(rows, values):
        names = _list([_named(r, judged) for r in claim.rows])
        out.append(f"{what} of {names} are {claim.text} ({basis}).")
    return [printable(line) for line in [*out, *_tested(judged)]]


def _tested(rows: Sequence[Row]) -> list[str]:
    """Who fails which tests, and that the others do not."""
    judged = [r for r in rows if tested(r)]
    found: dict[str, list[str]] = {}
    for row in judged:
        if failing(row):
            test = f"the {_list(failing(row))} test{'s' * (len(failing(row)) > 1)}"
            found.setdefault(test, []).append(_named(row, rows))
    out = [f"{_list(names)} fail{'s' * (len(names) == 1)} {which} (5 % level)." for which, names in found.items()]
    passed = [_named(r, rows) for r in judged if not failing(r)]
    who = "All others pass" if out else f"{passed[0]} passes" if len(passed) == 1 else "All pass"
    out += [f"{who} the consistency tests (NEES of the last half, NIS, whiteness, bias; 5 % level)."] if passed else []
    early = [_named(r, rows) for r in judged if fails_at_first_only(r)]
    return out + ([f"Over the whole run the errors of {_list(early)} are inconsistent with the covariance."] if early else [])


def _rejected(rows: Sequence[Row], total: int) -> list[str]:
    """How many of all measurements each gate left out."""
    counts = {r.estimator: r.rejected for r in rows if r.rejected is not None}
    out = [f"The gate of {name} rejected {count:,} of {total:,} measurements." for name, count in counts.items()]
    counts = {r.estimator: r.outliers for r in rows if r.outliers is not None}
    return out + [f"{name} classified {count:,} of {total:,} measurements as outliers." for name, count in counts.items()]


def _modes(rows: Sequence[Row]) -> list[str]:
    """How probable each of several solutions is."""
    out = []
    for row in rows:
        if row.modes and len(row.modes) > 1:
            shares = [f"{100 * mode['probability']:.3g} %" for mode in row.modes[:4]]
            more = f" and {len(row.modes) - 4} more" if len(row.modes) > 4 else ""
            out.append(f"{row.estimator} found {len(row.modes)} solutions, with probabilities {_list(shares)}{more}.")
    return out


def _apart(rows: Sequence[Row]) -> list[str]:
    """Who ends elsewhere than the first estimator, and what linearises better."""
    far = far_apart(rows)
    if not far:
        return []
    off = f"{' to '.join(f'{v:g}' for v in ends(r.apart for r in far))} sigma"
    first = next(r.estimator for r in rows if r.success and r.apart is None)
    who = _list([_named(r, rows) for r in far])
    return [f"The last states of {who} are {off} from those of {first}: {LINEARISED_ONCE}."]


def _best(model: Model, rows: Sequence[Row], judged: Sequence[Row]) -> list[str]:
    group = next((g for r in judged for g, v in r.rmse_last_half.items() if v is not None), None)
    if group is None:
        return ["The truth of the last half of the run is not known, so its errors are unknown."]
    ranked = [(v, r.estimator, r.view) for r in judged if (v := r.rmse_last_half.get(group)) is not None]
    show = row_display(model, rows, group)
    ranked.sort(key=lambda found: float(f"{found[0]:.3e}"))  # a difference that is not shown is no difference
    value, name, view = ranked[0]
    error = f"{number(value * show.factor)}{show.suffix}"
    if len(ranked) == 1:
        return [f"In the last half of the run the {group} error of {name} is {error} (RMS)."]
    return [f"Smallest {group} error in the last half of the run: {name} ({_VIEW.get(view, view)}), {error} (RMS)."]


def _named(row: Row, rows: Sequence[Row]) -> str:
    """The estimator's name, with the view where it has two."""
    both = sum(other.estimator == row.estimator for other in rows) > 1
    return f"{row.estimator} ({_VIEW.get(row.view, row.view)})" if both else row.estimator


def _list(names: Sequence[str]) -> str:
    return names[0] if len(names) == 1 else ", ".join(names[:-1]) + " and " + names[-1]
