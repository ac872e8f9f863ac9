"""Window lengths as a table, and as a sentence."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from piazzi.evaluate.display import PASSED, row_display
from piazzi.evaluate.grids import Grid, as_html, as_rich
from piazzi.evaluate.judgement import failing, tested
from piazzi.evaluate.quantities import duration, ideal, number
from piazzi.problem.checks import Array

if TYPE_CHECKING:
    from rich.console import Console, ConsoleOptions, RenderResult

    from piazzi.evaluate.window_trade import WindowTrade

_SAME = 1.0001  # times the best error that is no difference
_ENOUGH = 1.05  # times the best error that is as good as the best


def grids(trade: WindowTrade) -> list[Grid]:
    """Errors, NEES and cost against window length; seconds of the graph against epochs."""
    out = [_trade(trade)]
    if trade.timing is not None:
        timing = trade.timing
        rows = tuple(
            (f"{epochs:,}", str(steps) if steps else "-", duration(float(s)), duration(float(s / epochs)))
            for epochs, s, steps in zip(timing.epochs.tolist(), timing.seconds, timing.iterations.tolist(), strict=True)
        )
        out.append(Grid("Full graph, on the first epochs", ("epochs", "iterations", "time", "per epoch"), rows, left=0))
    return out


def sentences(trade: WindowTrade) -> list[str]:
    """How long a window is long enough, in plain words; what failed."""
    rows = [*trade.realtime, *trade.delayed, *([trade.graph] if trade.graph else [])]
    broken = {r.estimator: r.message for r in rows if not r.success}
    out = [f"{name} did not succeed: {message}." for name, message in broken.items()]
    if not trade.groups:
        return [*out, "There is no truth to compare with, so errors are unknown."]
    group = trade.groups[0]
    show = row_display(trade.problem.model, rows, group)
    for view, name in (("realtime", "In real time"), ("delayed", "Delayed")):
        errors = trade.rmse(group, view)
        if np.isfinite(errors).any():
            best = float(np.nanmin(errors))
            out.append(
                f"{name}, the smallest {group} error of the last half is {number(best * show.factor)}{show.suffix} (RMS), with "
                f"{_states(int(trade.lags[np.flatnonzero(errors <= _SAME * best)[0]]))}; {_enough(trade.lags, errors, best)}."
            )
    return out


def _enough(lags: Array, errors: Array, best: float) -> str:
    """From which length on all windows are as good as the best."""
    worse = np.flatnonzero(~(errors <= _ENOUGH * best))
    if not worse.size:
        return "all lengths are within 5 % of it"
    if worse[-1] + 1 == len(lags):
        return "longer windows do worse"
    return f"from {_states(int(lags[worse[-1] + 1]))} on, windows are within 5 % of it"


def _states(lag: int) -> str:
    return f"{lag} state{'' if lag == 1 else 's'}"


def html(trade: WindowTrade) -> str:
    """Tables and sentences for a notebook; all text is escaped."""
    return as_html(grids(trade), sentences(trade))


def render(trade: WindowTrade, console: Console, options: ConsoleOptions) -> RenderResult:
    """Tables and sentences for rich."""
    from rich.text import Text

    for grid in grids(trade):
        yield from as_rich(grid, console, options)
    for line in sentences(trade):
        yield Text(line)


def _trade(trade: WindowTrade) -> Grid:
    rows = [*trade.realtime, *trade.delayed, *([trade.graph] if trade.graph else [])]
    heads, columns = ["states"], [[str(lag) for lag in trade.lags.tolist()]]
    for group in trade.groups:
        show = row_display(trade.problem.model, rows, group)
        for view, name in (("realtime", "real time"), ("delayed", "delayed")):
            heads.append(f"{group} RMSE\n{name}" + (f"\n[{show.unit}]" if show.unit else ""))
            columns.append(_texts(trade.rmse(group, view) * show.factor, 4))
    if trade.groups:
        for view, name in (("realtime", "real time"), ("delayed", "delayed")):
            heads.append(f"mean NEES\n{name}\n({ideal(trade.ideal_nees(view))})")
            columns.append(_texts(trade.mean_nees(view), 3))
    heads += ["mean NIS", "per step"]
    columns.append(["-" if r.mean_nis is None else number(r.mean_nis, 3) for r in trade.realtime])
    columns.append([duration(float(us) * 1e-6) for us in trade.microseconds_per_step])
    if any(map(tested, trade.realtime)):
        heads.append("tests failed\nreal time\n(5 % each)")
        columns.append([", ".join(failing(r)) or PASSED if tested(r) else "-" for r in trade.realtime])
    remarks = ["FAILED" if not r.success else "diverged" if r.diverged else "" for r in trade.realtime]
    if any(remarks):
        heads.append("")
        columns.append(remarks)
    cells = [tuple(row) for row in zip(*columns, strict=True)]
    if trade.graph is not None:
        cells.append(_graph(trade, len(heads)))
    if any(row.crlb for row in trade.realtime):
        cells.append(_bound(trade, len(heads)))
    spare = _columns(heads, "tests", "mean NEES\ndelayed", *(f"{g} " for g in trade.groups[1:]), "mean NIS", "mean NEES")
    return Grid("Sliding windows, last half of the run", tuple(heads), tuple(cells), 0, spare)


def _columns(heads: list[str], *starts: str) -> tuple[int, ...]:
    """Columns whose headings start so, in the order of the starts."""
    return tuple(dict.fromkeys(i for start in starts for i, head in enumerate(heads) if head.startswith(start)))


def _graph(trade: WindowTrade, width: int) -> tuple[str, ...]:
    """The line of the full graph: it has no real-time view."""
    assert trade.graph is not None
    row, cells = trade.graph, ["all (graph)"]
    for group in trade.groups:
        value = row.rmse_last_half.get(group)
        show = row_display(trade.problem.model, [*trade.realtime, *trade.delayed, row], group)
        cells += ["-", number(None if value is None else value * show.factor)]
    if trade.groups:
        cells += ["-", number(row.mean_nees_last_half, 3)]
    per_step = None if row.seconds is None else row.seconds / len(trade.tracking.times)
    cells += [number(row.mean_nis, 3), duration(per_step)]
    cells += [""] * (width - len(cells))
    return (*cells[:-1], "FAILED") if not row.success else tuple(cells)


def _bound(trade: WindowTrade, width: int) -> tuple[str, ...]:
    """The line of the Cramer-Rao bound."""
    rows, cells = [*trade.realtime, *trade.delayed, *([trade.graph] if trade.graph else [])], ["bound"]
    for group in trade.groups:
        show = row_display(trade.problem.model, rows, group)
        for view in ("realtime", "delayed"):
            value = trade.crlb(group, view)
            cells.append(number(None if value is None else value * show.factor))
    return (*cells, *("-" for _ in range(width - len(cells))))


def _texts(values: Array, digits: int) -> list[str]:
    return [number(float(v), digits) if np.isfinite(v) else "-" for v in values]
