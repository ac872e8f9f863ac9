"""Small studies that several tests run."""

import numpy as np

import piazzi as pz
from piazzi.study import Study
from tests.laws.problems import b612


def small(runs=24, estimators=("ekf", "window:5"), epochs=30, **changes) -> Study:
    """Probes about a planet of 10 m, seen by range."""
    problem = changes.pop("problem", None) or b612(truth=None)
    return Study(
        problem, np.arange(epochs) * 0.1, list(estimators) if isinstance(estimators, tuple) else estimators, runs, **changes
    )


def drawn_truth(**changes) -> pz.Problem:
    """The same with a rule: only truths that start outside the planet count."""
    return b612(truth=pz.Truth(accept=["hypot(x, y) - 11.5", "vy"]), **changes)
