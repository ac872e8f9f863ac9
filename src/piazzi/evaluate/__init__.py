"""How good an estimate is, and whether it knows: errors, consistency, comparison."""

from piazzi.evaluate.comparison import Comparison, Row, compare, evaluate
from piazzi.evaluate.metrics import errors, has_diverged, nees, nis, rmse

__all__ = ["Comparison", "Row", "compare", "errors", "evaluate", "has_diverged", "nees", "nis", "rmse"]
