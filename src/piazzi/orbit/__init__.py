"""Orbits of single bodies: elements, axes and covariances, two-body motion."""

from piazzi.orbit.axes import covariance_root, orbit_axes, state_axes, transform_covariance, transform_root
from piazzi.orbit.equinoctial import Equinoctial, ModifiedEquinoctial
from piazzi.orbit.keplerian import Keplerian
from piazzi.orbit.lambert import Transfer, lambert, lambert_all
from piazzi.orbit.two_body import kepler_transition, propagate_kepler

__all__ = [
    "Equinoctial", "Keplerian", "ModifiedEquinoctial", "Transfer", "covariance_root", "kepler_transition", "lambert",
    "lambert_all", "orbit_axes", "propagate_kepler", "state_axes", "transform_covariance", "transform_root",
]  # fmt: skip
