"""Estimators: frozen settings with one verb, ``estimate(problem, tracking) -> Estimate``."""

from piazzi.estimate.bank import Bank
from piazzi.estimate.batch import BatchLeastSquares
from piazzi.estimate.estimator import Estimate, Estimator
from piazzi.estimate.factor_graph import FactorGraph
from piazzi.estimate.forecast import Forecast
from piazzi.estimate.kalman import ExtendedKalmanFilter, Prediction, Updated, predict, update
from piazzi.estimate.live import LiveFilter
from piazzi.estimate.live_root import LiveRootFilter
from piazzi.estimate.live_window import LiveWindow
from piazzi.estimate.losses import Cauchy, Huber, Tukey
from piazzi.estimate.sliding_window import SlidingWindow
from piazzi.estimate.smoother import Smoother
from piazzi.estimate.square_root import SquareRootKalmanFilter
from piazzi.estimate.unscented import UnscentedKalmanFilter

__all__ = [
    "Bank",
    "BatchLeastSquares",
    "Cauchy",
    "Estimate",
    "Estimator",
    "ExtendedKalmanFilter",
    "FactorGraph",
    "Forecast",
    "Huber",
    "LiveFilter",
    "LiveRootFilter",
    "LiveWindow",
    "Prediction",
    "SlidingWindow",
    "Smoother",
    "SquareRootKalmanFilter",
    "Tukey",
    "UnscentedKalmanFilter",
    "Updated",
    "predict",
    "update",
]
