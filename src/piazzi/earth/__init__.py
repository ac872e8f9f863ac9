"""The Earth: time scales, its orientation, frames and places on it."""

from piazzi.earth.eop import EOP, EOPTable, EOPWarning, read_eop
from piazzi.earth.epoch import Epoch
from piazzi.earth.fields import GravityField, gravity_field, read_gravity
from piazzi.earth.geodetic import geodetic_to_position, position_to_geodetic
from piazzi.earth.rotation import FRAMES, rotation, rotation_rate, transform

__all__ = [
    "EOP", "FRAMES", "EOPTable", "EOPWarning", "Epoch", "GravityField", "geodetic_to_position", "gravity_field",
    "position_to_geodetic", "read_eop", "read_gravity", "rotation", "rotation_rate", "transform",
]  # fmt: skip
