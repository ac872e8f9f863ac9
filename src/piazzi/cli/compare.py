"""``piazzi compare``: several estimators on the same measurements."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from piazzi.cli import options, results
from piazzi.cli.conventions import recording as recording_options

if TYPE_CHECKING:
    from piazzi.evaluate import Comparison
    from piazzi.present.report import Tab
    from piazzi.scenarios import Recording

DEFAULT = ("ekf", "graph", "window:100")


@click.command(cls=options.WithEstimators)
@options.source
@options.estimators(", ".join(DEFAULT))
@options.output("Write the rows as .json or .csv; - is JSON on stdout.")
@options.as_json
@options.seed
@options.scenario
@recording_options
@results.report_option
@results.title_option
def command(
    source: str,
    names: tuple[str, ...],
    output_file: str | None,
    as_json: bool,
    seed: int,
    scenario: str | None,
    recording: Recording,
    report: str | None,
) -> int:
    """Compare several estimators on SOURCE.

    Shows errors, consistency and cost side by side.  RMSE is the root of the mean squared length of the error; the last
    half shows what is left once an estimator has converged.  NEES and NIS measure consistency: near the ideal, errors are as
    large as the covariance predicts; above it, larger.

    Examples:
      piazzi compare tracking.npz
      piazzi compare tracking.npz --with ekf --with window:100 --with graph --json
      piazzi compare b612-range-q0 --seed 7
      piazzi compare tracking.npz --report out
    """
    outputs = results.Outputs(output_file, as_json, report)
    outputs.check()
    estimators = options.parsed(names, DEFAULT)
    from piazzi.cli.sources import run_comparison

    source_name, comparison, warning = run_comparison(source, estimators, seed, scenario, recording, bar=report is not None)

    def tab() -> Tab:
        from piazzi.present.report import comparison_tab

        title, planet_radius = results.title_and_planet(source, source_name, scenario)
        return comparison_tab(comparison, title=title, planet_radius=planet_radius, warning=warning)

    return outputs.write(comparison, lambda: rows(comparison), tab)


def rows(comparison: Comparison) -> list[dict[str, Any]]:
    """The rows of a comparison, their single values."""
    from piazzi.evaluate.rows import residual_name

    found = []
    for row in comparison.to_dict()["rows"]:
        left = {residual_name(unit): value for unit, value in row.pop("residual_rms").items()}
        found.append({k: v for k, v in row.items() if not isinstance(v, list)} | left)
    return found
