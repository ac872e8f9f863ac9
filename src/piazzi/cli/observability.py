"""``piazzi observability``: what the measurements say about the first state."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from piazzi.cli import options, output, results
from piazzi.cli.conventions import recording as recording_options

if TYPE_CHECKING:
    from piazzi.evaluate.observable import Observability
    from piazzi.present.report import Tab
    from piazzi.scenarios import Recording


@click.command(cls=options.Command)
@options.source
@click.option("--add", "added", metavar="STATION", multiple=True, help="Additional station; may be repeated; see the examples.")
@click.option("--no-twins", is_flag=True, help="Do not look for other first states with the same measurements.")
@options.output("Write all of it as .json, or the growth over time as .csv; - is JSON on stdout.")
@options.as_json
@options.seed
@options.scenario
@recording_options
@results.report_option
@results.title_option
def command(
    source: str,
    added: tuple[str, ...],
    no_twins: bool,
    output_file: str | None,
    as_json: bool,
    seed: int,
    scenario: str | None,
    recording: Recording,
    report: str | None,
) -> int:
    """Analyse the observability of the first state in SOURCE.

    What the measurements say about it without the prior: singular values of the Fisher information in prior sigmas,
    Cramer-Rao bounds of every state, the least observable direction, and other first states that give the same
    measurements (twins); where the truth is known, whether observability, linearisation or a twin is what limits estimators.
    --add shows what an additional station would change: one of the problem's once more, a new one with a sensor of the model
    and its numbers, or one with an equation of its own; SI units and radians.

    Examples:
      piazzi observability b612-range-q0
      piazzi observability b612-range-q0 --add range:mx=-10,my=0,sigma=0.1
      piazzi observability b612-range-q0 --add "b=atan2(y, x):sigma=0.01,angle"
      piazzi observability network.toml --add radar --json
      piazzi observability lageos2-laser --add range:site=7839,sigma=0.02
    """
    outputs = results.Outputs(output_file, as_json, report)
    outputs.check()
    from piazzi.cli.additions import additions
    from piazzi.cli.sources import STDIN, load_source
    from piazzi.evaluate.observing import observability
    from piazzi.scenarios import load_scenario

    source_found = load_source(source, seed, scenario, recording)
    problem, tracking = source_found.problem, source_found.tracking
    add = additions(problem, added)
    anew: dict[str, Any] = {}
    if add and not source_found.recorded and source != STDIN:
        anew = {"times": load_scenario(source).times, "seed": seed}
    with output.progress(100) as announce:
        found = observability(
            problem, tracking, add=add, twins=not no_twins, source=source_found.name, announce=announce, **anew
        )

    def tab() -> Tab:
        from piazzi.present.report import observability_tab

        return observability_tab(found, title=results.title_and_planet(source, source_found.name, scenario)[0])

    return outputs.write(found, lambda: growth_rows(found), tab)


def growth_rows(found: Observability) -> list[dict[str, Any]]:
    """Singular values and Cramer-Rao sigmas after each epoch, one flat record each."""
    from piazzi.evaluate.quantities import finite

    names = found.problem.model.names
    return [
        {"time": t}
        | {f"singular_value_{i + 1}": v for i, v in enumerate(values)}
        | {f"{name}_crlb_sigma": finite(s) for name, s in zip(names, sigmas, strict=True)}
        for t, values, sigmas in zip(
            found.growth_times.tolist(), found.growth_values.tolist(), found.growth_sigma.tolist(), strict=True
        )
    ]
