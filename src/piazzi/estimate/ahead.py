"""Which kernels estimators need, so that several can be compiled at once before the first of them runs."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from piazzi.estimate.chain import chain_spec, solve_spec
from piazzi.estimate.factor_graph import FactorGraph
from piazzi.estimate.guarded import guarded_spec
from piazzi.estimate.kalman import ExtendedKalmanFilter, filter_spec, update_fragments
from piazzi.estimate.root import linear_root
from piazzi.estimate.sliding_window import SlidingWindow, window_spec
from piazzi.estimate.smoother import Smoother, smoother_spec
from piazzi.estimate.square_root import SquareRootKalmanFilter
from piazzi.estimate.unscented import UnscentedKalmanFilter
from piazzi.kernels import KernelSpec
from piazzi.kernels.ahead import compile_ahead
from piazzi.problem import Problem


def compile_for(problem: Problem, estimators: Iterable[Any]) -> int:
    """Compile what these estimators need for a problem and is not compiled yet; how many kernels that were."""
    return compile_ahead([spec for estimator in estimators for spec in specs_of(estimator, problem)])


def specs_of(estimator: Any, problem: Problem) -> list[KernelSpec]:
    """The kernels that an estimator surely needs; none of an estimator of somebody else's."""
    match estimator:
        case ExtendedKalmanFilter(guard=None):
            return [filter_spec(problem, estimator.update)]
        case ExtendedKalmanFilter():
            return [guarded_spec(problem, update_fragments(problem, estimator.update))]
        case UnscentedKalmanFilter():
            return [estimator.root(problem).spec(problem)]
        case SquareRootKalmanFilter():
            return [linear_root(estimator.gate).spec(problem)]
        case Smoother():
            model = problem.model
            again = [chain_spec(problem), solve_spec(model.n, model.width, problem.noise_varies)]
            return [smoother_spec(problem), *(again if estimator.iterations > 1 else [])]
        case SlidingWindow():
            return [window_spec(problem, estimator.loss)]
        case FactorGraph() if not isinstance(estimator.start, str) and problem.functions and problem.is_noise_free:
            return []  # it may follow one orbit
        case FactorGraph():
            first = [filter_spec(problem)] if isinstance(estimator.start, str) and estimator.start == "ekf" else []
            model = problem.model
            solve = [] if model.constants else [solve_spec(model.n, model.width, problem.noise_varies)]
            return [*first, chain_spec(problem), *solve]
    return []
