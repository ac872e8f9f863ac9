"""``piazzi simulate``: a truth and measurements of it."""

from __future__ import annotations

from dataclasses import fields
from typing import TYPE_CHECKING, Any, Literal

import click

from piazzi.cli import options, output
from piazzi.cli.conventions import recording as recording_options
from piazzi.cli.running import DONE

if TYPE_CHECKING:
    from piazzi.problem import Problem, Tracking
    from piazzi.scenarios import Recording

SCHEMA = "piazzi.simulate/1"
ENDINGS = (".nc", ".csv", ".npz")


@click.command(cls=options.Command)
@options.source
@options.output("Write problem and tracking as .nc, the tracking as .csv, or the founding layout as .npz; - is CSV on stdout.")
@options.as_json
@options.seed
@options.scenario
@recording_options
@click.option(
    "--tolerance",
    type=options.number,
    metavar="SIGMA",
    help="Choose the substeps: their error moves no estimate by more than this many standard deviations.",
)
@click.option(
    "--truth", type=click.Choice(("fixed", "drawn")), help="Where the truth starts: at one place, or drawn from the prior."
)
@click.option("--perfect-guess", is_flag=True, help="The prior's mean is the true first state (-o FILE.nc keeps it).")
@click.option("--noiseless", is_flag=True, help="Sensors without error; the noise that estimators assume is unchanged.")
def command(
    source: str,
    output_file: str | None,
    as_json: bool,
    seed: int,
    scenario: str | None,
    recording: Recording,
    tolerance: float | None,
    truth: Literal["fixed", "drawn"] | None,
    perfect_guess: bool,
    noiseless: bool,
) -> int:
    """Simulate a true trajectory and its measurements.

    A scenario says what is true and when it is measured.  A recording is simulated anew: its problem, at its times.

    Examples:
      piazzi simulate b612-range --seed 3 -o tracking.nc
      piazzi simulate my-scenario.toml -o rows.csv
      piazzi simulate b612-range -o - | piazzi estimate - --scenario b612-range
      piazzi simulate satellite-bearing --tolerance 0.01 -o fine.nc
      piazzi simulate b612-range --truth drawn --noiseless -o exact.nc
    """
    output.check_output(output_file, ENDINGS)
    if as_json and output_file == output.STDOUT:
        raise click.UsageError("--json and -o - both want stdout", click.get_current_context())
    from piazzi.cli.sources import load_source

    found = load_source(source, seed, scenario, recording)
    problem, tracking = found.problem, found.tracking
    if truth or perfect_guess or noiseless:
        from piazzi.scenarios import vary

        problem = vary(problem, truth=truth, perfect_guess=perfect_guess, noiseless=noiseless)
    if tolerance is not None:
        from piazzi.estimate.substeps import choose_substeps

        problem = choose_substeps(problem, tracking.times, tolerance)
    if found.recorded or problem is not found.problem:
        import numpy as np

        from piazzi.simulation import simulate

        tracking = simulate(problem, tracking.times, np.random.default_rng(seed))
    if output_file is not None:
        write(output_file, problem, tracking)
    if as_json:
        output.print_json(to_dict(problem, tracking, found.name, seed, output_file))
    elif output_file != output.STDOUT:
        _print(problem, tracking, found.name, seed, output_file)
    return DONE


def to_dict(problem: Problem, tracking: Tracking, name: str, seed: int, output_file: str | None) -> dict[str, Any]:
    """What was simulated, in numbers; the tracking itself is in the file."""
    from piazzi.problem.epochs import dated
    from piazzi.problem.gaps import in_passes
    from piazzi.simulation import true_problem

    assert tracking.truth is not None
    found = in_passes(problem, tracking)
    return {
        "schema": SCHEMA,
        "source": name,
        "seed": seed,
        "epochs": len(tracking.times),
        "measurements": len(tracking.row_times),
        "prior_time": problem.prior_start(tracking.times),
        **dated(problem, tracking),
        "integrator": steps(true_problem(problem).integrator),
        "states": list(problem.model.names),
        "units": {n: problem.model.unit(n) for n in problem.model.names},
        "first": {"time": float(tracking.times[0]), "truth": tracking.truth[0].tolist()},
        "final": {"time": float(tracking.times[-1]), "truth": tracking.truth[-1].tolist()},
        **({"passes": [one._asdict() for one in found]} if found else {}),
        "output": output_file,
    }


def steps(integrator: Any) -> str:
    """The integrator with the settings that it has, such as ``RungeKutta4(substeps=10)``."""
    given = [f"{f.name}={getattr(integrator, f.name)!r}" for f in fields(integrator) if getattr(integrator, f.name) is not None]
    return f"{type(integrator).__name__}({', '.join(given)})"


def write(path: str, problem: Problem, tracking: Tracking) -> None:
    """Write problem and tracking in the format of the file's ending, CSV for stdout."""
    from piazzi.io import save

    if path != output.STDOUT:
        save(path, problem, tracking)
        return
    import tempfile
    from pathlib import Path

    with tempfile.TemporaryDirectory(prefix="piazzi-") as folder:
        save(Path(folder) / "tracking.csv", problem, tracking)
        output.print_text((Path(folder) / "tracking.csv").read_text(encoding="utf-8"))


def _print(problem: Problem, tracking: Tracking, name: str, seed: int, output_file: str | None) -> None:
    from piazzi.present.tables import heading, truth_table
    from piazzi.simulation import true_problem

    how = f"Steps: {steps(true_problem(problem).integrator)}"
    after = f"Wrote {output_file}" if output_file else "Nothing was written: -o tracking.nc keeps it."
    output.print_rich(heading(problem, tracking, name, f", seed {seed}"), "", truth_table(problem, tracking), "", how, after)
