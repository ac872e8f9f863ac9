"""Equations: what moves, how, and what is seen of it."""

from piazzi.model.gauss_markov import with_gauss_markov
from piazzi.model.model import STEP, TIME, Model
from piazzi.model.sensor import Parameter, Role, Sensor

__all__ = ["STEP", "TIME", "Model", "Parameter", "Role", "Sensor", "with_gauss_markov"]
