"""How good an estimate is, and whether it knows: errors, consistency, comparison, window lengths, observability."""

from piazzi.evaluate.comparison import Comparison, Row, compare, evaluate
from piazzi.evaluate.metrics import errors, has_diverged, nees, nis, rmse
from piazzi.evaluate.observable import Observability, observability
from piazzi.evaluate.window_trade import WindowTrade, windows

__all__ = [
    "Comparison",
    "Observability",
    "Row",
    "WindowTrade",
    "compare",
    "errors",
    "evaluate",
    "has_diverged",
    "nees",
    "nis",
    "observability",
    "rmse",
    "windows",
]
