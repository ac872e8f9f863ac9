"""Piazzi: orbit and state estimation.  Say the physics once; see which estimator to trust, how sure it is, what it costs."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from piazzi.estimate import (
        Estimate,
        ExtendedKalmanFilter,
        FactorGraph,
        LiveFilter,
        LiveWindow,
        Prediction,
        SlidingWindow,
        Updated,
        predict,
        update,
    )
    from piazzi.evaluate import Comparison, compare
    from piazzi.kernels import Discrete, Integrator, RungeKutta4, Taylor
    from piazzi.loading import load
    from piazzi.model import Model, Parameter, Sensor
    from piazzi.problem import Gaussian, Problem, ProcessNoise, Station, Tracking, Truth
    from piazzi.simulation import simulate

# name -> module; nothing is imported before it is used
_WHERE = {
    **dict.fromkeys(("Model", "Parameter", "Sensor"), "piazzi.model"),
    **dict.fromkeys(("Discrete", "Integrator", "RungeKutta4", "Taylor"), "piazzi.kernels"),
    **dict.fromkeys(("Gaussian", "Problem", "ProcessNoise", "Station", "Tracking", "Truth"), "piazzi.problem"),
    **dict.fromkeys(("Estimate", "ExtendedKalmanFilter", "FactorGraph", "LiveFilter", "LiveWindow"), "piazzi.estimate"),
    **dict.fromkeys(("Prediction", "SlidingWindow", "Updated", "predict", "update"), "piazzi.estimate"),
    **dict.fromkeys(("Comparison", "compare"), "piazzi.evaluate"),
    "simulate": "piazzi.simulation",
    "load": "piazzi.loading",
}

__version__ = "0.1.0"
__all__ = [
    "Comparison",
    "Discrete",
    "Estimate",
    "ExtendedKalmanFilter",
    "FactorGraph",
    "Gaussian",
    "Integrator",
    "LiveFilter",
    "LiveWindow",
    "Model",
    "Parameter",
    "Prediction",
    "Problem",
    "ProcessNoise",
    "RungeKutta4",
    "Sensor",
    "SlidingWindow",
    "Station",
    "Taylor",
    "Tracking",
    "Truth",
    "Updated",
    "compare",
    "load",
    "predict",
    "simulate",
    "update",
]


def __getattr__(name: str) -> Any:
    if name not in _WHERE:
        raise AttributeError(f"module 'piazzi' has no attribute {name!r}")
    value = getattr(import_module(_WHERE[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
