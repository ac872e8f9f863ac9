"""Estimators of a determination, each from the states of the guess."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from piazzi.determination.setup import Setup
from piazzi.estimate.batch import BatchLeastSquares
from piazzi.estimate.estimator import Estimate, Estimator
from piazzi.estimate.factor_graph import FactorGraph
from piazzi.estimate.registry import parse
from piazzi.problem import Tracking
from piazzi.problem.checks import Array

DEFAULT = ("graph",)
TOLERANCE = 1e-3  # sigma, to which batch least squares is taken: below, rounding over days of orbits moves it


def estimators(given: Any) -> dict[str, Estimator]:
    """Estimators by the text that asked for them.

    Raises
    ------
    ValueError
        For a name or an option that does not exist.
    """
    if given is None or (isinstance(given, (list, tuple)) and not given):
        given = DEFAULT
    if isinstance(given, Mapping):
        return dict(given)
    names: Iterable[Any] = [given] if isinstance(given, str) else given
    return {str(name).strip(): parse(str(name).strip()) for name in names}


def estimate(given: Setup, estimator: Estimator, keep: Array) -> Estimate:
    """The estimate from the rows to keep (J,), begun at the states of the guess where the estimator takes them."""
    return begun(given, estimator).estimate(given.problem, kept(given.tracking, keep))


def begun(given: Setup, estimator: Estimator) -> Estimator:
    """The estimator that begins at the states of the guess, where it takes them."""
    if isinstance(estimator, FactorGraph) and estimator.start == "ekf":  # what a text without a start means
        return replace(estimator, start=given.states)
    if isinstance(estimator, BatchLeastSquares) and estimator.start is None:
        return replace(estimator, start=given.states[0], tolerance=max(estimator.tolerance, TOLERANCE))
    return estimator


def kept(tracking: Tracking, keep: Array) -> Tracking:
    """The tracking with the values of the other rows missing."""
    if keep.all():
        return tracking
    values = np.where(keep[:, None], tracking.values, np.nan)
    return Tracking(tracking.row_times, values, tracking.row_stations, epoch=tracking.epoch)
