"""``piazzi compare``: several estimators on the same measurements."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from piazzi.cli import options, output, reporting
from piazzi.cli.running import DONE, NOT_ESTIMATED

if TYPE_CHECKING:
    from piazzi.evaluate import Comparison

DEFAULT = ("ekf", "graph", "window:100")
ENDINGS = (".json", ".csv")


@click.command(cls=options.WithEstimators)
@options.source
@options.estimators(", ".join(DEFAULT))
@options.output("Write the rows as .json or .csv; - is JSON on stdout.")
@options.as_json
@options.seed
@options.scenario
@reporting.option
def command(
    source: str,
    names: tuple[str, ...],
    output_file: str | None,
    as_json: bool,
    seed: int,
    scenario: str | None,
    report: str | None,
) -> int:
    """Compare several estimators on SOURCE.

    Shows errors, honesty and cost side by side.  RMSE is the root of the mean squared length of the error; the last half
    shows what is left once an estimator has settled.  NEES and NIS measure honesty: near the ideal, errors are as large as
    the covariance says; above it, larger.

    Examples:
      piazzi compare tracking.npz
      piazzi compare tracking.npz --with ekf --with window:100 --with graph --json
      piazzi compare b612-range-q0 --seed 7
      piazzi compare tracking.npz --report out
    """
    output.check_output(output_file, ENDINGS)
    reporting.check(report)
    estimators = options.parsed(names, DEFAULT)
    from piazzi.cli.comparing import run_comparison

    source_name, comparison, warning = run_comparison(source, estimators, seed, scenario, bar=report is not None)
    if output_file is not None:
        write(output_file, comparison)
    if report is not None:
        report = write_report(report, comparison, warning, *reporting.titled(source, source_name, scenario))
    if as_json:
        if output_file != output.STDOUT:
            output.print_json(comparison.to_dict())
    elif output_file != output.STDOUT:
        from piazzi.present.tables import heading

        wrote = [f"Wrote {path}" for path in (output_file, report) if path]
        output.print_rich(heading(comparison.problem, comparison.tracking, source_name), "", comparison, *wrote)
    return DONE if comparison.success else NOT_ESTIMATED


def write_report(folder: str, comparison: Comparison, warning: str, title: str, planet_radius: float | None) -> str:
    """Write the page of a comparison; returns its path."""
    from piazzi.present.report import comparison_tab

    return str(reporting.write(folder, [comparison_tab(comparison, title=title, planet_radius=planet_radius, warning=warning)]))


def write(path: str, comparison: Comparison) -> None:
    """Write the rows of a comparison as JSON or CSV."""
    document = comparison.to_dict()
    if path == output.STDOUT or path.lower().endswith(".json"):
        output.write_json(path, document)
    else:
        output.write_csv(path, [{k: v for k, v in row.items() if not isinstance(v, list)} for row in document["rows"]])
