"""What ``estimate``, ``compare`` and ``demo`` have in common: load, run the estimators, show how far they are."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from piazzi.cli import output
from piazzi.cli.running import say
from piazzi.cli.sources import Source, load_source

if TYPE_CHECKING:
    from piazzi.estimate import Estimator
    from piazzi.evaluate import Comparison

_LONG = 200_000  # epochs times estimators from which a run takes long enough to show a bar


def run_comparison(
    source: str,
    estimators: Mapping[str, Estimator],
    seed: int,
    scenario: str | None,
    *,
    bar: bool = False,
    thorough: bool = True,
) -> tuple[str, Comparison, str]:
    """The source's name, the comparison of these estimators on it, and a warning of long steps, "" for none.

    Raises as `piazzi.loading` and `piazzi.compare` do.  A bar of progress is shown for long runs, and where it is asked for;
    `thorough` is for `compare`.
    """
    from piazzi.evaluate import compare

    found = load_source(source, seed, scenario)
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
    from piazzi.estimate import ExtendedKalmanFilter, FactorGraph
    from piazzi.estimate.estimator import views_of
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
