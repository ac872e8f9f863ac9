"""Tables for terminals."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from piazzi.estimate.estimator import Estimate
from piazzi.estimate.forecast import Forecast
from piazzi.evaluate.grids import Grid, rich_table
from piazzi.evaluate.metrics import errors, residual_rms
from piazzi.evaluate.quantities import Display, display_of, displays, duration, number, with_sigma
from piazzi.model import Model
from piazzi.problem import Problem, Tracking, epoch_of
from piazzi.problem.checks import Array
from piazzi.problem.gaps import in_passes
from piazzi.text import counted, printable

if TYPE_CHECKING:
    from piazzi.earth import Epoch


def heading(problem: Problem, tracking: Tracking, source: str, remark: str = "") -> Any:
    """The summary as rich text."""
    from rich.text import Text

    return Text(summary(problem, tracking, source) + remark)


def summary(problem: Problem, tracking: Tracking, source: str) -> str:
    """One line on what there is: source, epochs, how long, who measured, whether the truth is known, where the prior stands."""
    times, count = tracking.times, len(problem.stations)
    span = f" over {duration(float(times[-1] - times[0]))}" if len(times) > 1 else ""
    span += _date(epoch_of(problem, tracking), float(times[0]), " from {}")
    stations = problem.stations[0].name if count == 1 else f"{count} stations"
    missing = int(np.isnan(tracking.values).all(axis=1).sum())
    found = len(in_passes(problem, tracking))
    who = f"{stations} in {found:,} passes" if found else stations
    parts = [
        f"{source}: {counted(len(times), 'epoch')}{span}",
        f"{counted(len(tracking.row_times) - missing, 'measurement')} by {who}",
        *([f"{missing:,} missing"] if missing else []),
        "truth known" if tracking.truth is not None else "truth not known",
        prior_place(problem, tracking.times),
    ]
    return printable(", ".join(parts))


def prior_place(problem: Problem, times: Array) -> str:
    """At which time the prior stands, and how long before the first of these epochs."""
    start = problem.prior_start(times)
    before = float(times[0]) - start
    return f"prior at {start:.12g} s" + (f", {duration(before)} before the first epoch" if before > 0 else "")


def _date(epoch: Epoch | None, t: float, text: str = " ({})") -> str:
    """The date of a time within a text, "" where there is none."""
    return "" if epoch is None else text.format(epoch + t)


def state_grid(name: str, estimate: Estimate, k: int = -1) -> Grid:
    """Every state at epoch `k` with its standard deviation, and its error where the truth is known."""
    error = errors(estimate)
    view = "with later measurements too" if estimate.view == "delayed" else "from measurements up to then"
    date = _date(estimate.epoch, float(estimate.times[k]))
    title = f"State at t = {estimate.times[k]:g} s{date}, {name}, {view}"
    heads = ("state", "estimate", "sigma", *(["error"] if error is not None else []), "unit")
    rows = []
    sigmas = np.sqrt(np.maximum(np.diagonal(estimate.covariance[k]), 0.0))
    shows = _shows(estimate.problem.model, estimate.names, [[v] for v in estimate.mean[k].tolist()])
    for i, (state, show) in enumerate(zip(estimate.names, shows, strict=True)):
        value, sigma = float(estimate.mean[k, i]), float(sigmas[i])
        texts = [*with_sigma(value * show.factor, sigma * show.factor)]
        if error is not None:
            e = float(error[k, i]) * show.factor
            texts.append(with_sigma(e, sigma * show.factor)[0] if np.isfinite(e) else "-")
        rows.append((state, *texts, printable(show.unit)))
    return Grid(title, heads, tuple(rows))


def state_table(name: str, estimate: Estimate) -> Any:
    """`state_grid` for terminals."""
    from rich.console import Group
    from rich.text import Text

    grid = state_grid(name, estimate)
    return Group(Text(printable(grid.title), style="bold"), _table(grid.heads, grid.rows))


def _shows(model: Model, names: Sequence[str], values: Sequence[Sequence[float]]) -> list[Display]:
    """The unit of every state: one for all of a group."""
    return displays([model.unit(name) for name in names], values, model.group_indices.values())


def _table(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> Any:
    """A rich table of states and numbers."""
    return rich_table([(head, head in ("state", "true state", "unit")) for head in heads], rows)


def solver_line(estimate: Estimate) -> list[str]:
    """How an optimisation ended, for estimators that tell of one: its solver, start, cost, gradient and dynamics defect."""
    details = estimate.details
    if not {"solver", "start", "cost"} <= details.keys():
        return []
    numbers = [f"cost {details['cost']:.6g}"]
    numbers += [f"gradient {details['gradient_norm']:.1g}"] if "gradient_norm" in details else []
    numbers += [f"dynamics defect {details['defect']:.1g} sigma"] if "defect" in details else []
    steps = f"{estimate.iterations} iteration{'s' * (estimate.iterations != 1)}"
    return [f"Solver {details['solver']}, started from {details['start']}: {steps}, {', '.join(numbers)}"]


def residual_line(estimate: Estimate) -> list[Any]:
    """One line with what is left of the measurements, by component; none where the estimator kept no residuals."""
    from rich.text import Text

    units = {c: unit for s in estimate.problem.model.sensors for c, unit in dict(s.units).items()}
    parts = []
    for name, value in residual_rms(estimate).items():
        show = display_of(units[name], [value])
        parts.append(f"{name} {number(value * show.factor, 3)}{show.suffix}")
    return [Text(printable(f"Left over (RMS): {', '.join(parts)}"))] if parts else []


def forecast_table(name: str, forecast: Forecast) -> Any:
    """A rich table of every state at each predicted time: value, sigma, and that over the one at the last epoch."""
    from rich.console import Group
    from rich.text import Text

    date = _date(forecast.problem.epoch, forecast.start)
    title = f"Predicted from t = {forecast.start:g} s{date}, {name}, without measurements"
    rows = []
    shows = _shows(forecast.problem.model, forecast.names, forecast.mean.T.tolist())
    for k, t in enumerate(forecast.times.tolist()):
        for i, (state, show) in enumerate(zip(forecast.names, shows, strict=True)):
            ahead = duration(t - forecast.start) if i == 0 else ""
            value, sigma = (float(a[k, i]) * show.factor for a in (forecast.mean, forecast.sigma))
            growth = f"{number(float(forecast.growth[k, i]), 3)}x"
            rows.append((ahead, state, *with_sigma(value, sigma), growth, printable(show.unit)))
    return Group(Text(printable(title), style="bold"), _table(("ahead", "state", "estimate", "sigma", "growth", "unit"), rows))


def truth_table(problem: Problem, tracking: Tracking) -> Any:
    """A rich table of the true state at the first and last epoch."""
    rows = []
    if tracking.truth is not None:
        names, both = problem.model.names[: tracking.truth.shape[1]], tracking.truth[[0, -1]].T.tolist()
        for state, ends, show in zip(names, both, _shows(problem.model, names, both), strict=True):
            rows.append((state, *(number(v * show.factor, 6) for v in ends), printable(show.unit)))
    return _table(("true state", *(f"t = {t:g} s" for t in (tracking.times[0], tracking.times[-1])), "unit"), rows)
