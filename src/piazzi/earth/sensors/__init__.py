"""Sensors of satellites: ordinary sensors, made of definitions, functions from outside and roots, with light time.

States are those of `Forces`: x, y, z (m) and vx, vy, vz (m/s) on the axes of the GCRF.
"""

from typing import TYPE_CHECKING

from piazzi.faces import lazy

if TYPE_CHECKING:
    from piazzi.earth.sensors.between import pseudorange, satellite_range, two_satellites
    from piazzi.earth.sensors.directions import azimuth_elevation, right_ascension_declination
    from piazzi.earth.sensors.doppler import frequency, range_rate
    from piazzi.earth.sensors.echoes import carrier_phase, radar_delay, radar_doppler, returned_frequency
    from piazzi.earth.sensors.instrument import Instrument
    from piazzi.earth.sensors.interferometry import delay_difference
    from piazzi.earth.sensors.position import position
    from piazzi.earth.sensors.ranging import range  # noqa: A004

__all__ = [
    "Instrument", "azimuth_elevation", "carrier_phase", "delay_difference", "frequency", "position", "pseudorange",
    "radar_delay", "radar_doppler", "range", "range_rate", "returned_frequency", "right_ascension_declination",
    "satellite_range", "two_satellites",
]  # fmt: skip

lazy(__name__)
