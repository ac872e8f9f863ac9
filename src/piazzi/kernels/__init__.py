"""Equations become compiled code."""

from piazzi.kernels.cache import build_seconds, fragment, is_compiled, load, load_plain
from piazzi.kernels.integrators import ConstantAcceleration, Discrete, DormandPrince, Integrator, Kepler, Taylor
from piazzi.kernels.runge_kutta import (
    DormandPrince5,
    Euler,
    ExplicitRungeKutta,
    GaussJackson,
    Heun,
    Midpoint,
    Ralston,
    RungeKutta,
    RungeKutta4,
    RungeKutta8,
)
from piazzi.kernels.spec import KernelSpec

__all__ = [
    "ConstantAcceleration",
    "Discrete",
    "DormandPrince",
    "DormandPrince5",
    "Euler",
    "ExplicitRungeKutta",
    "GaussJackson",
    "Heun",
    "Integrator",
    "Kepler",
    "KernelSpec",
    "Midpoint",
    "Ralston",
    "RungeKutta",
    "RungeKutta4",
    "RungeKutta8",
    "Taylor",
    "build_seconds",
    "fragment",
    "is_compiled",
    "load",
    "load_plain",
]
