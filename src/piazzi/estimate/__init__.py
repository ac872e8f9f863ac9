"""Estimators: frozen settings with one verb, ``estimate(problem, tracking) -> Estimate``; one in each module."""

from piazzi.estimate.estimator import Estimate, Estimator

__all__ = ["Estimate", "Estimator"]
