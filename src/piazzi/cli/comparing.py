"""What ``estimate``, ``compare`` and ``demo`` have in common: load, run the estimators, show how far they are."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from piazzi.cli import output
from piazzi.cli.sources import load_source

if TYPE_CHECKING:
    from piazzi.estimate import Estimator
    from piazzi.evaluate import Comparison

_LONG = 200_000  # epochs times estimators from which a run takes long enough to show a bar


def run_comparison(
    source: str, estimators: Mapping[str, Estimator], seed: int, scenario: str | None, *, bar: bool = False
) -> tuple[str, Comparison]:
    """The source's name and the comparison of these estimators on it; raises as `piazzi.loading` and `piazzi.compare` do.

    A bar of progress is shown for long runs, and where it is asked for.
    """
    from piazzi.evaluate import compare

    found = load_source(source, seed, scenario)
    with output.progress(len(estimators), long=bar or len(found.tracking.times) * len(estimators) > _LONG) as step:
        return found.name, compare(found.problem, found.tracking, estimators, source=found.name, announce=step)
