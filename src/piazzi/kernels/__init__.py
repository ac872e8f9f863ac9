"""Equations become compiled code."""

from piazzi.kernels.cache import build_seconds, load
from piazzi.kernels.integrators import Discrete, Integrator, RungeKutta4, Taylor
from piazzi.kernels.spec import KernelSpec

__all__ = ["Discrete", "Integrator", "KernelSpec", "RungeKutta4", "Taylor", "build_seconds", "load"]
