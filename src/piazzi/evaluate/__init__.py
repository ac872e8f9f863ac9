"""How good an estimate is, and whether it knows: errors, consistency, comparison, window lengths, observability."""

from piazzi.evaluate.bounds import Bounds, posterior_bounds
from piazzi.evaluate.comparison import Comparison, compare
from piazzi.evaluate.consistency import Check, epoch_bounds
from piazzi.evaluate.honesty import Honesty, judged
from piazzi.evaluate.metrics import errors, has_diverged, nees, nis, rmse
from piazzi.evaluate.observable import Observability
from piazzi.evaluate.observe import observability
from piazzi.evaluate.rows import Row, evaluate
from piazzi.evaluate.window_lengths import windows
from piazzi.evaluate.window_trade import WindowTrade

__all__ = [
    "Bounds",
    "Check",
    "Comparison",
    "Honesty",
    "Observability",
    "Row",
    "WindowTrade",
    "compare",
    "epoch_bounds",
    "errors",
    "evaluate",
    "has_diverged",
    "judged",
    "nees",
    "nis",
    "observability",
    "posterior_bounds",
    "rmse",
    "windows",
]
