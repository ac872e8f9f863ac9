"""Equations: what moves, how, and what is seen of it."""

from piazzi.model.definitions import STEP, TIME
from piazzi.model.model import Model
from piazzi.model.sensor import Parameter, Role, Sensor

__all__ = ["STEP", "TIME", "Model", "Parameter", "Role", "Sensor"]
