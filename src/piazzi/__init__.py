"""Piazzi: orbit and state estimation.  Say the physics once; see which estimator to trust, how sure it is, what it costs."""

from __future__ import annotations

from typing import TYPE_CHECKING

from piazzi.faces import lazy

if TYPE_CHECKING:
    from piazzi import earth, formats, orbit

    def scenarios() -> dict[str, str]:
        """Names of the built-in scenarios, with their titles."""

    from piazzi.determination.determining import determine
    from piazzi.determination.ephemerides import ephemeris
    from piazzi.determination.figures import figures
    from piazzi.determination.following import Following
    from piazzi.determination.initial import initial_orbits
    from piazzi.determination.initial_result import InitialOrbits
    from piazzi.determination.result import Determination
    from piazzi.determination.unknowns import Estimated
    from piazzi.earth import Epoch
    from piazzi.estimate.bank import Bank
    from piazzi.estimate.batch import BatchLeastSquares
    from piazzi.estimate.estimator import Estimate
    from piazzi.estimate.factor_graph import FactorGraph
    from piazzi.estimate.forecast import Forecast
    from piazzi.estimate.kalman import ExtendedKalmanFilter, Prediction, Updated, predict, update
    from piazzi.estimate.live import LiveFilter
    from piazzi.estimate.live_root import LiveRootFilter
    from piazzi.estimate.live_window import LiveWindow
    from piazzi.estimate.long_steps import step_warning
    from piazzi.estimate.losses import Cauchy, Huber, Tukey
    from piazzi.estimate.prior import with_prior_at
    from piazzi.estimate.propagation import Propagation, propagate
    from piazzi.estimate.sliding_window import SlidingWindow
    from piazzi.estimate.smoother import Smoother
    from piazzi.estimate.square_root import SquareRootKalmanFilter
    from piazzi.estimate.substeps import choose_substeps, substep_error
    from piazzi.estimate.unscented import UnscentedKalmanFilter
    from piazzi.evaluate.comparison import Comparison, compare
    from piazzi.evaluate.observable import Observability
    from piazzi.evaluate.observing import observability
    from piazzi.evaluate.window_lengths import windows
    from piazzi.evaluate.window_trade import WindowTrade
    from piazzi.formats import Ephemeris, Observations, read_ephemeris, read_tracking
    from piazzi.io import save
    from piazzi.kernels import (
        ConstantAcceleration,
        Discrete,
        DormandPrince,
        DormandPrince5,
        Euler,
        GaussJackson,
        Heun,
        Integrator,
        Kepler,
        Midpoint,
        Ralston,
        RungeKutta,
        RungeKutta4,
        RungeKutta8,
        Taylor,
    )
    from piazzi.loading import load
    from piazzi.model import Model, Parameter, Sensor
    from piazzi.orbit import kepler_transition, propagate_kepler
    from piazzi.orbit.difference import difference
    from piazzi.outside.function import Function
    from piazzi.outside.interpolation import Interpolation
    from piazzi.outside.table import Table
    from piazzi.present.progress import progress
    from piazzi.present.report import write_report
    from piazzi.problem import (
        Gaussian,
        Manoeuvre,
        Pass,
        Problem,
        ProcessNoise,
        Schedule,
        Station,
        Tracking,
        Truth,
        passes,
    )
    from piazzi.problem.gauss_markov import with_gauss_markov
    from piazzi.simulation import simulate
    from piazzi.study import Study, read_store

__version__ = "0.1.0"
__all__ = [
    "Bank", "BatchLeastSquares", "Cauchy", "Comparison", "ConstantAcceleration", "Determination", "Discrete",
    "DormandPrince", "DormandPrince5", "Ephemeris", "Epoch", "Estimate", "Estimated", "Euler", "ExtendedKalmanFilter",
    "FactorGraph", "Following", "Forecast", "Function", "GaussJackson", "Gaussian", "Heun", "Huber", "InitialOrbits",
    "Integrator", "Interpolation", "Kepler", "LiveFilter", "LiveRootFilter", "LiveWindow", "Manoeuvre", "Midpoint", "Model",
    "Observability", "Observations", "Parameter", "Pass", "Prediction", "Problem", "ProcessNoise", "Propagation", "Ralston",
    "RungeKutta", "RungeKutta4", "RungeKutta8", "Schedule", "Sensor", "SlidingWindow", "Smoother", "SquareRootKalmanFilter",
    "Station", "Study", "Table", "Taylor", "Tracking", "Truth", "Tukey", "UnscentedKalmanFilter", "Updated", "WindowTrade",
    "choose_substeps", "compare", "determine", "difference", "earth", "ephemeris", "figures", "formats", "initial_orbits",
    "kepler_transition", "load", "observability", "orbit", "passes", "predict", "progress", "propagate", "propagate_kepler",
    "read_ephemeris", "read_store", "read_tracking", "save", "scenarios", "simulate", "step_warning", "substep_error",
    "update", "windows", "with_gauss_markov", "with_prior_at", "write_report",
]  # fmt: skip

lazy(__name__)
