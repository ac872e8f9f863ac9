"""How long a window has to be: accuracy, consistency and cost against its length; and what the full graph costs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from piazzi.drawn import Drawn
from piazzi.evaluate.comparison_table import PASSED, row_display
from piazzi.evaluate.grids import Grid
from piazzi.evaluate.judgement import claims, divergences, failing, tested
from piazzi.evaluate.quantities import duration, ends, finite, ideal, number
from piazzi.evaluate.rows import Row, numbers
from piazzi.evaluate.tabled import Tabled
from piazzi.problem import Problem, Tracking
from piazzi.problem.checks import Array
from piazzi.problem.epochs import dated
from piazzi.text import listed

if TYPE_CHECKING:
    import xarray

SCHEMA = "piazzi.windows/1"
_SAME = 1.0001  # times the best error that is no difference
_ENOUGH = 1.05  # times the best error that is as good as the best


@dataclass(frozen=True, eq=False)
class Timing:
    """Seconds of the full graph, warm, on the first so many epochs of the tracking.

    Attributes
    ----------
    epochs : (E,) int
    seconds : (E,), the whole estimation, its start by a filter included; NaN where it did not succeed
    iterations : (E,) int, Gauss-Newton steps
    """

    epochs: Array
    seconds: Array
    iterations: Array

    def to_dict(self) -> dict[str, Any]:
        """The timing as JSON keeps it."""
        seconds = [finite(s) for s in self.seconds.tolist()]
        return {"epochs": self.epochs.tolist(), "seconds": seconds, "iterations": self.iterations.tolist()}


@dataclass(frozen=True, eq=False)
class WindowTrade(Tabled, Drawn):
    """Sliding windows of several lengths on the same measurements, beside the full graph.

    Attributes
    ----------
    problem, tracking, source : what was estimated
    lags : (L,) int, states in each window
    iterations : Gauss-Newton steps of a window at each epoch
    realtime, delayed : tuples of L Row, the newest state as known at once, and each state as it left the window
    graph : Row of the full graph, the end that windows tend to; None where it was not wanted
    timing : Timing of the full graph; None where it was not wanted
    """

    problem: Problem
    tracking: Tracking
    source: str
    lags: Array
    iterations: int
    realtime: tuple[Row, ...]
    delayed: tuple[Row, ...]
    graph: Row | None = None
    timing: Timing | None = None

    @property
    def success(self) -> bool:
        """Whether every window, and the graph, succeeded."""
        return all(row.success for row in self.all_rows)

    @property
    def all_rows(self) -> tuple[Row, ...]:
        """Rows of both views of every window, and that of the graph."""
        return (*self.realtime, *self.delayed, *([self.graph] if self.graph else []))

    @property
    def groups(self) -> tuple[str, ...]:
        """Groups of states that have errors; none without truth."""
        return tuple(dict.fromkeys(g for row in self.realtime for g, v in row.rmse.items() if v is not None))

    @property
    def microseconds_per_step(self) -> Array:
        """Wall-clock microseconds per epoch, (L,), NaN where a window failed."""
        seconds = np.array([np.nan if row.seconds is None else row.seconds for row in self.realtime])
        return np.asarray(1e6 * seconds / len(self.tracking.times))

    def rows(self, view: str) -> tuple[Row, ...]:
        """The windows' rows of one view, "realtime" or "delayed"."""
        return self.realtime if view == "realtime" else self.delayed

    def rmse(self, group: str, view: str = "realtime", *, last_half: bool = True) -> Array:
        """RMSE of a group of states against window length, (L,), SI units, NaN where it is not known."""
        rows = [(row.rmse_last_half if last_half else row.rmse).get(group) for row in self.rows(view)]
        return np.array([np.nan if v is None else v for v in rows])

    def mean_nees(self, view: str = "realtime", *, last_half: bool = True) -> Array:
        """Mean NEES against window length, (L,), NaN where it is not known; see `ideal_nees`."""
        rows = [row.mean_nees_last_half if last_half else row.mean_nees for row in self.rows(view)]
        return np.array([np.nan if v is None else v for v in rows])

    def ideal_nees(self, *views: str) -> tuple[float, ...]:
        """What mean NEES of the last half should be in these views, the smallest and the largest: one where they agree."""
        return ends(row.nees_ideal_last_half for view in views for row in self.rows(view))

    def crlb(self, group: str, view: str = "realtime", *, last_half: bool = True) -> float | None:
        """Posterior Cramer-Rao bound of the RMSE of a group, the same for all lengths; None where it is not known."""
        row = next((r for r in self.rows(view) if r.crlb), None)
        return None if row is None else (row.crlb_last_half if last_half else row.crlb).get(group)

    def to_dict(self) -> dict[str, Any]:
        """The object of schema piazzi.windows/1."""
        return {
            "schema": SCHEMA,
            "source": self.source,
            "epochs": len(self.tracking.times),
            "prior_time": self.problem.prior_start(self.tracking.times),
            **dated(self.problem, self.tracking),
            "states": list(self.problem.model.names),
            "iterations": self.iterations,
            "lags": self.lags.tolist(),
            "rows": self.records(),
            "graph": None if self.graph is None else self.graph.to_dict(),
            "timing": None if self.timing is None else self.timing.to_dict(),
        }

    def records(self) -> list[dict[str, Any]]:
        """One flat record for every lag and view, as in piazzi.compare/1 with the lag and the microseconds per step."""
        cost = self.microseconds_per_step
        return [
            {"lag": int(lag), **row.to_dict(), "microseconds_per_step": finite(float(us))}
            for lag, us, *pair in zip(self.lags, cost, self.realtime, self.delayed, strict=True)
            for row in pair
        ]

    def to_dataset(self) -> xarray.Dataset:
        """Errors, consistency and cost against lag and view, with units."""
        import xarray as xr

        both = [{k: (v, a) for k, v, a in numbers(self.problem.model, self.rows(view))} for view in ("realtime", "delayed")]
        variables: dict[str, Any] = {
            key: (("lag", "view"), np.stack([values, both[1][key][0]], axis=1), attributes)
            for key, (values, attributes) in both[0].items()
        }
        variables["microseconds_per_step"] = (("lag",), self.microseconds_per_step, {"units": "us"})
        coordinates: dict[str, Any] = {"lag": self.lags, "view": np.array(["realtime", "delayed"], dtype=object)}
        if self.timing is not None:
            coordinates["graph_epochs"] = self.timing.epochs
            variables["graph_seconds"] = (("graph_epochs",), self.timing.seconds, {"units": "s"})
            variables["graph_iterations"] = (("graph_epochs",), self.timing.iterations)
        attributes = {"source": self.source, "epochs": len(self.tracking.times), "iterations": self.iterations}
        return xr.Dataset(variables, coordinates, attributes)

    def grids(self) -> list[Grid]:
        """Errors, NEES and cost against window length; seconds of the graph against epochs."""
        out = [_trade(self)]
        if self.timing is not None:
            timing = self.timing
            rows = tuple(
                (f"{epochs:,}", str(steps) if steps else "-", duration(float(s)), duration(float(s / epochs)))
                for epochs, s, steps in zip(timing.epochs.tolist(), timing.seconds, timing.iterations.tolist(), strict=True)
            )
            out.append(Grid("Full graph, on the first epochs", ("epochs", "iterations", "time", "per epoch"), rows, left=0))
        return out

    def sentences(self) -> list[str]:
        """How long a window is long enough, in plain words; what failed."""
        broken = {r.estimator: r.message for r in self.all_rows if not r.success}
        out = [f"{name} did not succeed: {message}." for name, message in broken.items()]
        if not self.groups:
            return [*out, "There is no truth to compare with, so errors are unknown."]
        group = self.groups[0]
        show = row_display(self.problem.model, self.all_rows, group)
        for view, name in (("realtime", "In real time"), ("delayed", "Delayed")):
            errors = self.rmse(group, view)
            if np.isfinite(errors).any():
                best = float(np.nanmin(errors))
                lag = _states(int(self.lags[np.flatnonzero(errors <= _SAME * best)[0]]))
                smallest = f"{number(best * show.factor)}{show.suffix} (RMS), with {lag}"
                enough = _enough(self.lags, errors, best)
                out.append(f"{name}, the smallest {group} error of the last half is {smallest}; {enough}.")
        out += divergences(self.all_rows)
        for claim in claims(self.all_rows, self.tracking.values):
            who = "all rows" if len(claim.rows) == len(self.all_rows) else f"{len(claim.rows)} of {len(self.all_rows)} rows"
            out.append(f"Errors of {who} are {claim.text} (NEES of this one run).")
        return out

    def __repr__(self) -> str:
        """In short: which lengths, on what."""
        return f"<WindowTrade: lags {listed(str(int(lag)) for lag in self.lags)} on {self.problem!r}>"


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


def _trade(trade: WindowTrade) -> Grid:
    heads, columns = ["states"], [[str(lag) for lag in trade.lags.tolist()]]
    for group in trade.groups:
        show = row_display(trade.problem.model, trade.all_rows, group)
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
        show = row_display(trade.problem.model, trade.all_rows, group)
        cells += ["-", number(None if value is None else value * show.factor)]
    if trade.groups:
        cells += ["-", number(row.mean_nees_last_half, 3)]
    per_step = None if row.seconds is None else row.seconds / len(trade.tracking.times)
    cells += [number(row.mean_nis, 3), duration(per_step)]
    cells += [""] * (width - len(cells))
    return (*cells[:-1], "FAILED") if not row.success else tuple(cells)


def _bound(trade: WindowTrade, width: int) -> tuple[str, ...]:
    """The line of the Cramer-Rao bound."""
    cells = ["bound"]
    for group in trade.groups:
        show = row_display(trade.problem.model, trade.all_rows, group)
        for view in ("realtime", "delayed"):
            value = trade.crlb(group, view)
            cells.append(number(None if value is None else value * show.factor))
    return (*cells, *("-" for _ in range(width - len(cells))))


def _texts(values: Array, digits: int) -> list[str]:
    return [number(float(v), digits) if np.isfinite(v) else "-" for v in values]
