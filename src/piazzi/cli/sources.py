"""SOURCE of the command line -> problem and tracking, and the estimators that commands run on them."""

from __future__ import annotations

import os
import shutil
import sys
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import click

from piazzi.cli import output
from piazzi.cli.running import say
from piazzi.problem import Problem, Tracking

if TYPE_CHECKING:
    from piazzi.estimate.estimator import Estimator
    from piazzi.evaluate import Comparison
    from piazzi.scenarios import Recording


STDIN = "-"
_STARTS = {b"PK": ".npz", b"\x89HDF": ".nc", b"CDF": ".nc"}
_LONG = 200_000  # epochs times estimators from which a run takes long enough to show a bar


@dataclass(frozen=True, eq=False)
class Source:
    """A problem with its tracking, the name to report them by, and whether they were recorded rather than simulated."""

    problem: Problem
    tracking: Tracking
    name: str
    recorded: bool


def load_source(source: str, seed: int, scenario: str | None = None, recording: Recording | None = None) -> Source:
    """What `piazzi.loading` makes of a source, or of standard input for "-"; raises as that does."""
    from piazzi import load
    from piazzi.io.files import RECORDINGS
    from piazzi.loading import is_tracking, words_of
    from piazzi.scenarios import Recording

    told = {} if recording is None else words_of(recording)
    if not source:
        raise click.UsageError("SOURCE is empty", click.get_current_context(silent=True))
    if source.lower().endswith(".csv") and not scenario:
        raise click.UsageError(f"{source}: --scenario NAME says what it measures", click.get_current_context(silent=True))
    if is_tracking(source, scenario):
        from piazzi.determination.recorded import recorded

        return Source(*recorded(source, str(scenario), recording or Recording()), os.path.basename(source), True)
    if source != STDIN:
        problem, tracking = load(source, seed=seed, scenario=scenario, **told)
        found = Source(problem, tracking, os.path.basename(source) or source, source.lower().endswith(RECORDINGS))
        _say_moved_prior(found, scenario)
        return found
    path = _spooled(scenario)
    try:
        problem, tracking = load(path, seed=seed, scenario=scenario, **told)
    except (ValueError, OSError) as error:
        text = str(error) if isinstance(error, ValueError) else error.strerror or str(error)
        raise ValueError(text.replace(str(path), "standard input")) from None
    finally:
        path.unlink(missing_ok=True)
    found = Source(problem, tracking, STDIN, path.suffix in RECORDINGS)
    _say_moved_prior(found, scenario)
    return found


def _say_moved_prior(found: Source, scenario: str | None) -> None:
    """Say it where a recording began before the prior of its scenario."""
    first = float(found.tracking.times[0])
    if scenario is None or found.problem.prior_time != first:
        return
    from piazzi.cli.running import say
    from piazzi.scenarios import load_scenario

    stood = load_scenario(scenario).problem.prior_time
    if stood is not None and stood > first:
        say(f"{found.name}: begins at {first:g} s, before the prior at {stood:g} s, which was propagated back")


def load_problem(source: str) -> Problem:
    """The problem of a scenario, without simulating it, or of a recording; raises as `load_source` does."""
    from piazzi import load
    from piazzi.io.files import RECORDINGS
    from piazzi.scenarios import load_scenario

    if source.lower().endswith(RECORDINGS):
        return load(source)[0]
    return load_scenario(source).problem


def _spooled(scenario: str | None) -> Path:
    """Standard input as a temporary file whose ending says what its first bytes are."""
    if sys.stdin is None or sys.stdin.isatty():
        raise click.UsageError("- means standard input, but nothing is piped into it", click.get_current_context(silent=True))
    stream = sys.stdin.buffer
    head = stream.read(8)
    if not head:
        raise ValueError("standard input is empty")
    ending = next((e for start, e in _STARTS.items() if head.startswith(start)), ".csv" if scenario else ".toml")
    with tempfile.NamedTemporaryFile(prefix="piazzi-", suffix=ending, delete=False) as file:
        try:
            file.write(head)
            shutil.copyfileobj(stream, file)
        except BaseException:
            os.unlink(file.name)
            raise
    return Path(file.name)


def run_comparison(
    source: str,
    estimators: Mapping[str, Estimator],
    seed: int,
    scenario: str | None,
    recording: Recording | None = None,
    *,
    bar: bool = False,
    thorough: bool = True,
) -> tuple[str, Comparison, str]:
    """The source's name, the comparison of these estimators on it, and a warning of long steps, "" for none.

    Raises as `piazzi.loading` and `piazzi.compare` do.  A bar of progress is shown for long runs, and where it is asked for;
    `thorough` is for `compare`.
    """
    from piazzi.evaluate import compare

    found = load_source(source, seed, scenario, recording)
    with output.progress(len(estimators), long=bar or len(found.tracking.times) * len(estimators) > _LONG) as step:
        comparison = compare(found.problem, found.tracking, estimators, source=found.name, announce=step, thorough=thorough)
    warning = _warning_of_steps(found, comparison, estimators)
    if warning:
        say(f"warning: {found.name}: {warning}")
    return found.name, comparison, warning


def _warning_of_steps(found: Source, comparison: Comparison, estimators: Mapping[str, Estimator]) -> str:
    """What to say where the steps are long beside the noise, unless the truth was simulated with the same steps.

    Judged by an estimator whose kernel this run has compiled anyway, where there is one: the filter, where it or a graph (which
    starts from it) is asked for, else the first that gives states in real time, else the filter.
    """
    from piazzi.estimate.estimator import views_of
    from piazzi.estimate.factor_graph import FactorGraph
    from piazzi.estimate.kalman import ExtendedKalmanFilter
    from piazzi.estimate.long_steps import step_warning

    truth = found.problem.truth
    if not found.recorded and (truth is None or truth.integrator is None):
        return ""
    used = [estimators[name] for name, estimate in comparison.estimates.items() if estimate.success]
    plain = ExtendedKalmanFilter()
    if not any(e == plain or isinstance(e, FactorGraph) for e in used):
        realtime = [e for e in used if "realtime" in views_of(e)]
        plain = realtime[0] if realtime else plain  # type: ignore[assignment]
    return step_warning(found.problem, found.tracking, estimator=plain)
