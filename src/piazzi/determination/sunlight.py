"""How far sunlight on a body departs from that on a sphere, where nobody says what shape it has.

A body with panels is pushed across the direction of the Sun too, and not the same all around its orbit: positions of GPS
satellites that are known to centimetres are left by a sphere at decimetres, and missed by metres half a day later.  Where that
may matter, shares of the sunlight on a sphere are estimated beside its coefficient, constant along the axes of a body that
turns to the Earth and the Sun (`earth.force_text.sunlight`).  Where the density of the air is estimated it takes up along the
orbit what sunlight departs by; what it does not take up comes and goes with each turn.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from piazzi.determination.additions import with_empirical
from piazzi.determination.analysis import analysed
from piazzi.determination.density import SMALL
from piazzi.determination.orbit_forces import DEPARTS
from piazzi.determination.physical import DRAG_LOGARITHM, LIGHT, slope_of, value_of
from piazzi.determination.setup import Setup, renewed
from piazzi.earth.force_options import SUNLIGHT
from piazzi.problem import Gaussian

SAID = (
    f"how sunlight departs from that on a sphere is estimated, in {len(SUNLIGHT)} shares of it, each 0 +- {DEPARTS:g} before "
    "the measurements (as ECOM has them: Springer et al. 1999, GPS Solut. 2, 50; Arnold et al. 2015, J. Geod. 89, 775)"
)


def with_sunlight(given: Setup) -> Setup:
    """The set-up with shares of sunlight as unknowns, where they matter and the user says nothing of them."""
    chosen, names = given.chosen, given.problem.model.names
    said = (
        chosen.choice.sphere
        or LIGHT not in names
        or "cr_a_m_change" in names
        or not SUNLIGHT.keys().isdisjoint(chosen.forces.empirical)
    )
    known = given.earlier is not None and not SUNLIGHT.keys().isdisjoint(given.earlier.names)  # which go on with the orbit
    if said or DRAG_LOGARITHM in names or not np.isfinite(given.states).all():
        return given
    share = given.states[0, names.index(LIGHT)]
    moved = np.nan_to_num(analysed(given, given.states).rows[..., names.index(LIGHT)]) * value_of(share) / slope_of(share)
    if not (known or np.linalg.norm(moved) * DEPARTS > SMALL):
        return given
    wider = with_empirical(chosen, tuple(SUNLIGHT))
    roles = {**wider.roles, **dict.fromkeys(SUNLIGHT, "estimated")}
    values = {**wider.values, **dict.fromkeys(SUNLIGHT, Gaussian(0.0, DEPARTS**2))}
    found = renewed(given, given.measured, replace(wider, roles=roles, values=values))
    return replace(found, assumed=(*given.assumed, SAID))
