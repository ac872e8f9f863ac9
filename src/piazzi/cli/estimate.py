"""``piazzi estimate``: the orbit in a recording, and how sure it is."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import click

from piazzi.cli import options, output
from piazzi.cli.conventions import recording as recording_options
from piazzi.cli.running import DONE, NOT_ESTIMATED, say

if TYPE_CHECKING:
    from piazzi.estimate.estimator import Estimate
    from piazzi.estimate.forecast import Forecast
    from piazzi.evaluate import Comparison
    from piazzi.scenarios import Recording

SCHEMA = "piazzi.estimate/1"
DEFAULT = "ekf"
ENDINGS = (".json", ".csv", ".npz", ".nc")


@click.command(cls=options.WithEstimators)
@options.source
@options.estimators(DEFAULT)
@options.output("Write the estimate: every mean and covariance, as .json, .csv, .npz or .nc; - is JSON on stdout.")
@options.as_json
@options.seed
@options.scenario
@recording_options
@click.option(
    "--predict",
    "ahead",
    metavar="AHEAD",
    help="Propagate the last state this far and report its uncertainty: 2h; 10min,1d; 1d/1h (hourly for a day).",
)
@click.option("--follow", metavar="FILE", help="Read measurements as lines of CSV from FILE, - for stdin, as they come.")
@click.option("--checkpoint", metavar="FILE", help="With --follow: file that the state is saved in, and resumed from.")
def command(
    source: str,
    names: tuple[str, ...],
    output_file: str | None,
    as_json: bool,
    seed: int,
    scenario: str | None,
    recording: Recording,
    ahead: str | None,
    follow: str | None,
    checkpoint: str | None,
) -> int:
    """Estimate the states in SOURCE.

    Prints the last state with its standard deviations, and errors and consistency over the run.

    Examples:
      piazzi estimate tracking.npz
      piazzi estimate tracking.npz --with window:100 -o orbit.nc
      piazzi estimate tracking.npz --predict 10min,2h
      piazzi estimate rows.csv --scenario b612-range --json
      piazzi simulate b612-range -o - | piazzi estimate - --scenario b612-range
      sensor | piazzi estimate b612-range --follow - --checkpoint state.npz
    """
    if ahead is not None and follow is not None:
        raise click.UsageError("--predict and --follow do not go together", click.get_current_context())
    if follow is not None:
        if recording.columns:
            raise click.UsageError("--columns and --follow do not go together", click.get_current_context())
        estimator = options.parsed(names, (DEFAULT,))
        return _follow(source, estimator, output_file, as_json, follow, checkpoint, recording.scale)
    if checkpoint is not None:
        raise click.UsageError("--checkpoint goes with --follow", click.get_current_context())
    output.check_output(output_file, ENDINGS)
    estimators = options.parsed(names, (DEFAULT,))
    if output_file is not None and len(estimators) > 1:
        raise click.UsageError("-o writes one estimate: give one --with, or use compare", click.get_current_context())
    if ahead is not None:
        from piazzi.cli.ahead import times_ahead

        times_ahead(ahead, 0.0)  # what cannot be read is told before anything is computed
    from piazzi.cli.sources import run_comparison

    source_name, comparison, _ = run_comparison(source, estimators, seed, scenario, recording, thorough=False)
    forecasts = {} if ahead is None else predicted(comparison, ahead)
    document = to_dict(comparison, forecasts)
    if output_file is not None:
        write(output_file, comparison, document)
    if as_json:
        if output_file != output.STDOUT:
            output.print_json(document)
    elif output_file != output.STDOUT:
        _print(comparison, source_name, output_file, forecasts)
    for name, forecast in forecasts.items():
        if not forecast.success:
            say(f"{name}: {forecast.message}")
    return DONE if comparison.success and all(f.success for f in forecasts.values()) else NOT_ESTIMATED


def _follow(
    source: str,
    estimators: dict[str, Any],
    output_file: str | None,
    as_json: bool,
    stream: str,
    checkpoint: str | None,
    scale: str | None,
) -> int:
    """Follow a stream of measurements of the problem in SOURCE."""
    from piazzi.cli.follow import follow
    from piazzi.cli.sources import load_problem

    if len(estimators) > 1:
        raise click.UsageError("--follow runs one estimator: give one --with", click.get_current_context())
    output.check_output(output_file, (".jsonl",) if as_json else (".csv",))
    return follow(load_problem(source), next(iter(estimators.values())), stream, output_file, checkpoint, as_json, scale)


def predicted(comparison: Comparison, ahead: str) -> dict[str, Forecast]:
    """Every estimate's last state propagated; one that is not finite has none."""
    import numpy as np

    from piazzi.cli.ahead import times_ahead
    from piazzi.estimate.estimator import has_considered

    times = times_ahead(ahead, float(comparison.tracking.times[-1]))
    usable = {name: e for name, e in comparison.estimates.items() if np.isfinite([*e.mean[-1], *e.covariance[-1].flat]).all()}
    return {name: estimate.predict(times) for name, estimate in usable.items() if has_considered(estimate)}


def to_dict(comparison: Comparison, forecasts: Mapping[str, Forecast]) -> dict[str, Any]:
    """The comparison's object with units, and in every row the last state with its sigmas and, if asked, later ones."""
    from piazzi.evaluate.metrics import residual_rms
    from piazzi.evaluate.quantities import finite

    model, views = comparison.problem.model, comparison.views
    document = comparison.to_dict() | {"schema": SCHEMA, "units": {name: model.unit(name) for name in model.names}}
    for row in document["rows"]:
        estimate = views.get((row["estimator"], row["view"]))
        if estimate is not None:
            variances = estimate.covariance[-1].diagonal().tolist()
            row["final"] = {
                "time": float(estimate.times[-1]),
                "mean": [finite(v) for v in estimate.mean[-1].tolist()],
                "sigma": [finite(v**0.5) if v >= 0 else None for v in variances],
            }
            row["details"] = _plain_details(estimate)
            row["residual_rms"] = {name: finite(v) for name, v in residual_rms(estimate).items()}
        if row["estimator"] in forecasts:
            row["prediction"] = prediction(forecasts[row["estimator"]])
    return document


def _plain_details(estimate: Estimate) -> dict[str, Any]:
    """What the estimator tells of itself in single numbers and words, such as its cost, its solver and where it started."""
    from piazzi.evaluate.quantities import finite

    plain = {k: v for k, v in estimate.details.items() if v is None or isinstance(v, bool | int | float | str)}
    return {k: finite(v) if isinstance(v, float) else v for k, v in plain.items()}


def prediction(forecast: Forecast) -> dict[str, Any]:
    """Whether it succeeded; times, means, covariances, sigmas and their growth as lists, what is not finite as None."""
    from piazzi.evaluate.quantities import finite

    def listed(values: Any) -> Any:
        return [listed(v) for v in values] if isinstance(values, list) else finite(values)

    names = ("times", "mean", "sigma", "growth", "covariance")
    out = {"success": forecast.success, "message": forecast.message}
    return out | {name: listed(getattr(forecast, name).tolist()) for name in names}


def write(path: str, comparison: Comparison, document: dict[str, Any]) -> None:
    """Write the one estimate of a comparison in the format of the file's ending."""
    if not comparison.estimates:
        return
    estimate = next(iter(comparison.estimates.values()))
    if path == output.STDOUT or path.lower().endswith(".json"):
        output.write_json(path, document | {"series": series(estimate)})
    else:
        from piazzi.io import save_estimate

        save_estimate(path, estimate)


def series(estimate: Estimate) -> dict[str, Any]:
    """Every time, mean and covariance as lists, numbers that are not finite as None."""
    from piazzi.evaluate.quantities import finite

    out: dict[str, Any] = {"view": estimate.view, "times": estimate.times.tolist()}
    out["mean"] = [[finite(v) for v in row] for row in estimate.mean.tolist()]
    out["covariance"] = [[[finite(v) for v in row] for row in matrix] for matrix in estimate.covariance.tolist()]
    if estimate.delayed is not None:
        out["delayed"] = series(estimate.delayed)
    return out


def _print(comparison: Comparison, source_name: str, output_file: str | None, forecasts: Mapping[str, Forecast]) -> None:
    from piazzi.present.tables import forecast_table, heading, residual_line, solver_line, state_table

    parts: list[Any] = [heading(comparison.problem, comparison.tracking, source_name), ""]
    for name, estimate in comparison.estimates.items():  # at the last epoch both views of a window are one
        parts += [state_table(name, estimate), *residual_line(estimate), *solver_line(estimate), ""]
        parts += [forecast_table(name, forecasts[name]), ""] if name in forecasts else []
    output.print_rich(*parts, comparison, *([f"Wrote {output_file}"] if output_file and comparison.estimates else []))
