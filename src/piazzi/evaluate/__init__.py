"""How good an estimate is, and whether its covariance is consistent with that: errors, tests, comparison.

Window lengths and observability are in modules of their own, which a comparison does not need.
"""

from typing import TYPE_CHECKING

from piazzi.faces import lazy

if TYPE_CHECKING:
    from piazzi.evaluate.bounds import Bounds, posterior_bounds
    from piazzi.evaluate.comparison import Comparison, compare
    from piazzi.evaluate.consistency import Check, epoch_bounds
    from piazzi.evaluate.consistency_tests import ConsistencyTests, check_consistency
    from piazzi.evaluate.metrics import errors, has_diverged, nees, nis, rmse
    from piazzi.evaluate.rows import Row, evaluate

__all__ = [
    "Bounds", "Check", "Comparison", "ConsistencyTests", "Row", "check_consistency", "compare", "epoch_bounds", "errors",
    "evaluate", "has_diverged", "nees", "nis", "posterior_bounds", "rmse",
]  # fmt: skip

lazy(__name__)
