"""Orbits of single bodies: elements, axes and covariances, two-body motion, and orbits from a few observations."""

from typing import TYPE_CHECKING

from piazzi.faces import lazy

if TYPE_CHECKING:
    from piazzi.orbit.axes import covariance_root, orbit_axes, state_axes, transform_covariance, transform_root
    from piazzi.orbit.difference import Difference, difference
    from piazzi.orbit.double_r import double_r
    from piazzi.orbit.equinoctial import Equinoctial
    from piazzi.orbit.fit_mean import MeanFit, fit_sgp4
    from piazzi.orbit.fits import Rows
    from piazzi.orbit.from_directions import gauss, laplace
    from piazzi.orbit.from_positions import gibbs, herrick_gibbs
    from piazzi.orbit.from_ranges import direction, direction_rate, range_to_state, three_ranges
    from piazzi.orbit.gooding import gooding
    from piazzi.orbit.initial import InitialOrbit
    from piazzi.orbit.keplerian import Keplerian
    from piazzi.orbit.lambert import Transfer, lambert, lambert_all
    from piazzi.orbit.mean_elements import read_tle, sgp4_covariance, sgp4_states
    from piazzi.orbit.modes import Mode, Search, two_body_modes
    from piazzi.orbit.modified_equinoctial import ModifiedEquinoctial
    from piazzi.orbit.radar import radar
    from piazzi.orbit.region import Region
    from piazzi.orbit.two_body import kepler_transition, propagate_kepler

__all__ = [
    "Difference", "Equinoctial", "InitialOrbit", "Keplerian", "MeanFit", "Mode", "ModifiedEquinoctial", "Region", "Rows",
    "Search", "Transfer", "covariance_root", "difference", "direction", "direction_rate", "double_r", "fit_sgp4", "gauss",
    "gibbs", "gooding", "herrick_gibbs", "kepler_transition", "lambert", "lambert_all", "laplace", "orbit_axes",
    "propagate_kepler", "radar", "range_to_state", "read_tle", "sgp4_covariance", "sgp4_states", "state_axes",
    "three_ranges", "transform_covariance", "transform_root", "two_body_modes",
]  # fmt: skip

lazy(__name__)
