"""``piazzi windows``: how long a sliding window has to be."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from piazzi.cli import options, output, results
from piazzi.cli.conventions import recording as recording_options

if TYPE_CHECKING:
    from piazzi.present.report import Tab
    from piazzi.scenarios import Recording

DEFAULT = "1,2,5,10,20,50,100,200"
_LARGEST = 1_000_000
_LONG = 50_000  # epochs times states in windows from which a run takes long enough to show a bar


def whole_numbers(context: click.Context, parameter: click.Parameter, text: str) -> tuple[int, ...]:
    """Numbers apart by commas."""
    try:
        lags = tuple(int(word) for word in text.split(","))
    except ValueError:
        raise click.BadParameter(f"{text!r} is not whole numbers apart by commas, such as {DEFAULT}") from None
    for lag in lags:
        if not 1 <= lag <= _LARGEST:
            raise click.BadParameter(f"{lag} states are no window: from 1 to {_LARGEST}")
    return lags


@click.command(cls=options.Command)
@options.source
@click.option(
    "--lags", metavar="N,N,...", default=DEFAULT, show_default=True, callback=whole_numbers, help="States in each window."
)
@click.option(
    "--iterations",
    type=options.WholeNumber(1, 1000),
    metavar="N",
    default=1,
    show_default=True,
    help="Gauss-Newton steps per epoch.",
)
@click.option("--no-graph", is_flag=True, help="Leave out the full graph and its timing.")
@options.output("Write the rows as .json or .csv; - is JSON on stdout.")
@options.as_json
@options.seed
@options.scenario
@recording_options
@results.report_option
@results.title_option
def command(
    source: str,
    lags: tuple[int, ...],
    iterations: int,
    no_graph: bool,
    output_file: str | None,
    as_json: bool,
    seed: int,
    scenario: str | None,
    recording: Recording,
    report: str | None,
) -> int:
    """Try sliding windows of several lengths on SOURCE.

    Shows accuracy in real time (the newest state) and delayed (each state as it leaves the window), consistency and time
    per step against window length, and seconds of the full graph against the number of epochs.

    Examples:
      piazzi windows tracking.npz
      piazzi windows b612-range --lags 1,5,20,100 --iterations 3 --json
      piazzi windows satellite-bearing -o windows.csv
    """
    outputs = results.Outputs(output_file, as_json, report)
    outputs.check()
    from piazzi.cli.sources import load_source
    from piazzi.evaluate.window_lengths import steps_of, windows

    found = load_source(source, seed, scenario, recording)
    problem, tracking = found.problem, found.tracking
    steps = steps_of(lags, tracking, graph=not no_graph)
    with output.progress(steps, long=len(tracking.times) * sum(lags) > _LONG) as step:
        trade = windows(problem, tracking, lags, iterations=iterations, graph=not no_graph, source=found.name, announce=step)

    def tab() -> Tab:
        from piazzi.present.report import windows_tab

        return windows_tab(trade, title=results.title_and_planet(source, found.name, scenario)[0])

    return outputs.write(trade, trade.records, tab)
