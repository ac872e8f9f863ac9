"""``piazzi report``: a self-contained interactive page."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from piazzi.cli import options, output, results
from piazzi.cli.conventions import recording as recording_options
from piazzi.cli.running import DONE, NOT_ESTIMATED, say
from piazzi.cli.windows import whole_numbers

if TYPE_CHECKING:
    from piazzi.evaluate import Comparison
    from piazzi.present.report import Section
    from piazzi.scenarios import Recording

DEFAULT = ("ekf", "graph", "window:100")


def _lags(context: click.Context, parameter: click.Parameter, text: str | None) -> tuple[int, ...]:
    return whole_numbers(context, parameter, text) if text is not None else ()


@click.command(cls=options.WithEstimators)
@click.argument("sources", metavar="SOURCE...", nargs=-1, required=True)
@options.estimators(", ".join(DEFAULT))
@click.option(
    "-o", "--output", "output_file", metavar="FILE", default="report.html", show_default=True, help="The page, .html."
)
@click.option(
    "--windows",
    "lags",
    metavar="N,N,...",
    callback=_lags,
    help="Also compare sliding windows of these lengths, e.g. 10,50,200.",
)
@click.option("--observability", "seen", is_flag=True, help="Also analyse the observability of the first state.")
@click.option("--title", metavar="TEXT", help="Title of the page.")
@options.seed
@options.scenario
@recording_options
def command(
    sources: tuple[str, ...],
    names: tuple[str, ...],
    output_file: str,
    lags: tuple[int, ...],
    seen: bool,
    title: str | None,
    seed: int,
    scenario: str | None,
    recording: Recording,
) -> int:
    """Compare estimators on each SOURCE and write one page.

    The page works offline, in any browser: a summary in plain words, interactive charts, an animated orbit, and all numbers.
    It can be printed.

    Examples:
      piazzi report tracking.npz --windows 10,50,100,200 --observability
      piazzi report satellite-bearing b612-range --with ekf -o orbits.html
      piazzi report rows.csv --scenario b612-range
    """
    if output_file == output.STDOUT:
        raise click.UsageError("-o -: a page goes into a file", click.get_current_context(silent=True))
    output.check_output(output_file, results.PAGES)
    estimators = options.parsed(names, DEFAULT)
    from piazzi.cli.sources import run_comparison
    from piazzi.loading import is_tracking
    from piazzi.present.report import comparison_tab

    tabs, success = [], True
    for source in sources:
        rows = source.lower().endswith(".csv") or is_tracking(source, scenario)
        of_rows = (scenario, recording) if rows else (None, None)
        name, comparison, warning = run_comparison(source, estimators, seed, *of_rows, bar=True)
        named, radius = results.title_and_planet(source, name, scenario)
        more, well = _more(comparison, lags, seen)
        tabs.append(comparison_tab(comparison, title=named, planet_radius=radius, more=more, warning=warning))
        success &= comparison.success and well
    wrote = results.write_page(output_file, tabs, title)
    output.print_rich(f"Wrote {wrote}: open it in a browser.")
    return DONE if success else NOT_ESTIMATED


def _more(comparison: Comparison, lags: tuple[int, ...], seen: bool) -> tuple[list[Section], bool]:
    """Sections on windows and observability where they were asked for, and whether all of it succeeded."""
    from piazzi.evaluate.observing import observability
    from piazzi.evaluate.window_lengths import windows
    from piazzi.present.report import observability_section, windows_section

    problem, tracking, sections, well = comparison.problem, comparison.tracking, [], True
    if lags:
        from piazzi.evaluate.window_lengths import steps_of

        with output.progress(steps_of(lags, tracking)) as step:
            trade = windows(problem, tracking, lags, source=comparison.source, announce=step)
        sections.append(windows_section(trade))
        well = trade.success
    if seen:
        try:
            found = observability(problem, tracking, source=comparison.source)
        except ValueError as error:  # the rest of the page stands
            say(f"nothing on observability: {error}")
            return sections, False
        sections.append(observability_section(found))
        well = well and found.success
    return sections, well
