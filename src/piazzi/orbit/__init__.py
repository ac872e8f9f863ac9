"""Orbits in closed form."""

from piazzi.orbit.kepler import kepler_transition, propagate_kepler

__all__ = ["kepler_transition", "propagate_kepler"]
