"""Numbers: a model with values, and measurements of it."""

from piazzi.problem.epochs import epoch_of
from piazzi.problem.gaps import Pass, passes
from piazzi.problem.parts import Gaussian, Manoeuvre, ProcessNoise, Schedule, Station, Truth
from piazzi.problem.problem import Problem
from piazzi.problem.tracking import Tracking

__all__ = [
    "Gaussian", "Manoeuvre", "Pass", "Problem", "ProcessNoise", "Schedule", "Station", "Tracking", "Truth", "epoch_of",
    "passes",
]  # fmt: skip
