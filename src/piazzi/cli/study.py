"""``piazzi study``: thousands of runs of several estimators, kept as they finish."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from piazzi.cli import options, output, results
from piazzi.cli.running import DONE, NOT_ESTIMATED, say

if TYPE_CHECKING:
    from piazzi.study import Stored, Study

ENDINGS = (".nc",)


@click.command(cls=options.WithEstimators)
@click.argument("scenario", metavar="SCENARIO")
@click.option(
    "--runs", type=options.WholeNumber(1), metavar="N", help="Runs at every point.  [default: the scenario's, or 100]"
)
@options.estimators("the scenario's, or ekf")
@click.option("--vary", multiple=True, metavar="NAME=V,V,...", help="Vary this; may be repeated, for a grid.  See above.")
@options.output("Keep all runs in this .nc file.")
@click.option("--resume", is_flag=True, help="Continue this study from the runs in FILE, or add runs to it.")
@click.option(
    "--workers", type=options.WholeNumber(0), metavar="N", help="Processes; 0 is this one.  [default: one per processor]"
)
@click.option("--scheduler", metavar="ADDRESS", help="A Dask scheduler, tcp://host:8786, or 'local' to start a cluster here.")
@click.option("--chunk", type=options.WholeNumber(1), metavar="N", help="Runs per task.  [default: about a second's]")
@click.option("--figures", metavar="FOLDER", help="Write pictures there.")
@results.report_option
@results.title_option
@options.as_json
@options.seed
def command(
    scenario: str,
    runs: int | None,
    names: tuple[str, ...],
    vary: tuple[str, ...],
    output_file: str | None,
    resume: bool,
    workers: int | None,
    scheduler: str | None,
    chunk: int | None,
    figures: str | None,
    report: str | None,
    as_json: bool,
    seed: int,
) -> int:
    """Simulate, estimate and score many runs of SCENARIO.

    Run i is the same whatever the workers, their number or the order: draws of prior, process and measurement noise are
    children of the seed.  Completed runs are saved: after Ctrl-C, a crash or a full disk, --resume continues from there, and
    with more --runs than FILE has it adds those that are missing.

    --vary takes settings of estimators (lag, iterations, gate, ...), and R.scale, R.STATION.scale, Q.scale, P.scale, substeps
    and parameters of the scenario; those change what happens and what is believed, with assumed. or truth. before the name one
    of the two.

    Examples:
      piazzi study satellite-bearing --runs 1000 --with ekf -o study.nc
      piazzi study b612-range --with window --vary lag=10,50 --vary R.scale=1,4
      piazzi study b612-range --with ekf --vary assumed.Q.scale=0.1,1,10
      piazzi study founding-study -o founding.nc --resume
      piazzi study b612-range --runs 80 -o sixty.nc --resume
    """
    if output_file == output.STDOUT:
        raise click.UsageError("-o -: a study goes into a .nc file", click.get_current_context())
    output.check_output(output_file, ENDINGS)
    if resume and output_file is None:
        raise click.UsageError("--resume needs -o FILE, the study to continue", click.get_current_context())
    results.check_report(report)
    results.check_title(report or figures, "--report DIR or --figures FOLDER")
    if figures is not None:
        output.make_folder(figures, "study-nees.png")
    _check_scenario(scenario)
    study = _study(scenario, runs, names, vary, seed)
    say(_size(study), prefix="")
    run = {"resume": resume, "workers": workers, "scheduler": scheduler, "chunk": chunk}
    with _place(output_file) as path:
        stored = _run(study, path, run, lasting=output_file is not None)
        summary = stored.summary
        wrote = [f"Wrote {output_file}"] if output_file else []
        if figures is not None:
            from piazzi.present.figures.studies import write_figures

            wrote += [f"Wrote {file}" for file in write_figures(figures, summary, results.given_title() or "")]
        if report is not None:
            from piazzi.present.report import study_tabs

            title = results.title_and_planet(scenario, study.name, None)[0]
            wrote.append(f"Wrote {results.write_page(report, study_tabs(summary, title), f'Piazzi report: {title}')}")
        if as_json:
            output.print_json(summary.to_dict())
        else:
            from piazzi.present.study_table import StudyTable, failures, heading

            output.print_rich(heading(stored), "", StudyTable(summary), *failures(summary), *wrote)
    return DONE if summary.success else NOT_ESTIMATED


def _check_scenario(scenario: str) -> None:
    """Refuse what is no scenario at a glance: a recording has one run only."""
    from piazzi.io.files import RECORDINGS

    if not scenario:
        raise click.UsageError("SCENARIO is empty", click.get_current_context())
    if scenario.lower().endswith(RECORDINGS):
        raise click.UsageError(f"{scenario}: a study simulates; name a scenario, not a recording", click.get_current_context())


def _study(scenario: str, runs: int | None, names: tuple[str, ...], vary: tuple[str, ...], seed: int) -> Study:
    from piazzi.study import Study

    changes: dict[str, Any] = {"seed": seed}
    if runs is not None:
        changes["runs"] = runs
    if names:
        changes["estimators"] = options.parsed(names, ())
    if vary:
        changes["vary"] = dict(map(_axis, vary))
        if len(changes["vary"]) < len(vary):
            raise click.UsageError("--vary: a name is given twice", click.get_current_context())
    return Study.of(scenario, **changes)


def _axis(text: str) -> tuple[str, list[str]]:
    name, equals, values = text.partition("=")
    found = [value.strip() for value in values.split(",")]
    if not equals or not name.strip() or not all(found):
        raise click.UsageError(f"--vary {text!r}: write NAME=VALUE,VALUE,..., such as lag=10,100", click.get_current_context())
    return name.strip(), found


def _size(study: Study) -> str:
    """How much work this is, before it begins."""
    points = f"{study.points:,} points x " if study.points > 1 else ""
    return (
        f"{points}{study.runs:,} runs x {len(study.variants)} estimator{'s' * (len(study.variants) > 1)} "
        f"= {study.estimates:,} estimates of {len(study.times):,} epochs"
    )


@contextmanager
def _place(output_file: str | None) -> Iterator[Path]:
    """The file asked for, or one that is gone afterwards."""
    if output_file is not None:
        yield Path(output_file)
        return
    import tempfile

    with tempfile.TemporaryDirectory(prefix="piazzi-study-") as folder:
        yield Path(folder) / "study.nc"


def _run(study: Study, path: Path, run: dict[str, Any], lasting: bool) -> Stored:
    from piazzi.study import kept_runs, run_study

    total = study.points * study.runs
    try:
        with _bar(total) as progress:
            return run_study(study, path, progress=progress, **run)
    except (KeyboardInterrupt, OSError, RuntimeError) as error:
        kept = kept_runs(path)
        if kept and lasting:
            say(f"{kept:,} of {total:,} runs are kept beside {path}: --resume continues from there")
        elif kept:
            say(f"the {kept:,} completed runs were discarded; use -o FILE to keep them")
        if isinstance(error, RuntimeError):
            raise ValueError(str(error)) from error
        raise


@contextmanager
def _bar(total: int) -> Iterator[Callable[[int, int], None]]:
    """A bar with rate and time left where stderr is a terminal."""
    if sys.stderr is None or not sys.stderr.isatty():
        yield lambda done, total: None
        return
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, ProgressColumn, Task, TimeRemainingColumn
    from rich.text import Text

    class Rate(ProgressColumn):
        def render(self, task: Task) -> Text:
            speed = task.finished_speed or task.speed
            return Text("" if speed is None else f"{speed:,.3g} runs/s")

    columns = (BarColumn(bar_width=24), MofNCompleteColumn(), Rate(), TimeRemainingColumn())
    with Progress(*columns, console=output.beside(), transient=True) as bar:
        task = bar.add_task("", total=total)
        yield lambda done, total: bar.update(task, completed=done)
