"""Estimators: frozen settings with one verb, ``estimate(problem, tracking) -> Estimate``."""

from piazzi.estimate.estimator import Estimate, Estimator
from piazzi.estimate.kalman import ExtendedKalmanFilter, Prediction, Updated, predict, update

__all__ = ["Estimate", "Estimator", "ExtendedKalmanFilter", "Prediction", "Updated", "predict", "update"]
