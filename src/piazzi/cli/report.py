"""``piazzi report``: a page to hand to somebody."""

from __future__ import annotations

import click

from piazzi.cli import options, output, reporting
from piazzi.cli.running import DONE, NOT_ESTIMATED

DEFAULT = ("ekf", "graph", "window:100")


@click.command(cls=options.WithEstimators)
@click.argument("sources", metavar="SOURCE...", nargs=-1, required=True)
@options.estimators(", ".join(DEFAULT))
@click.option(
    "-o", "--output", "output_file", metavar="FILE", default="report.html", show_default=True, help="The page, .html."
)
@options.seed
@options.scenario
def command(sources: tuple[str, ...], names: tuple[str, ...], output_file: str, seed: int, scenario: str | None) -> int:
    """Compare estimators on each SOURCE and write one page.

    The page works offline, in any browser: a summary in plain words, then charts to point at, an orbit that plays, and all
    numbers.  It can be printed.

    Examples:
      piazzi report tracking.npz
      piazzi report satellite-bearing b612-range --with ekf -o orbits.html
      piazzi report rows.csv --scenario b612-range
    """
    if output_file == output.STDOUT:
        raise click.UsageError("-o -: a page goes into a file", click.get_current_context(silent=True))
    output.check_output(output_file, reporting.ENDINGS)
    estimators = options.parsed(names, DEFAULT)
    from piazzi.cli.comparing import run_comparison
    from piazzi.present.report import comparison_tab

    tabs, success = [], True
    for source in sources:
        name, comparison = run_comparison(
            source, estimators, seed, scenario if source.lower().endswith(".csv") else None, bar=True
        )
        title, radius = reporting.titled(source, name, scenario)
        tabs.append(comparison_tab(comparison, title=title, planet_radius=radius))
        success &= comparison.success
    wrote = reporting.write(output_file, tabs)
    output.print_rich(f"Wrote {wrote}: open it in a browser.")
    return DONE if success else NOT_ESTIMATED
