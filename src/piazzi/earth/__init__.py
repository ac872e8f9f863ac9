"""The Earth: time scales, its orientation, frames, stations, Sun, Moon and planets."""

from typing import TYPE_CHECKING

from piazzi.faces import lazy

if TYPE_CHECKING:
    from piazzi.earth import media, sensors
    from piazzi.earth.bodies import BODIES, EphemerisWarning, body
    from piazzi.earth.defaults import ForceChoice, default_forces, read_forces
    from piazzi.earth.eop import EOP, EOPTable, EOPWarning, read_eop
    from piazzi.earth.epoch import Epoch
    from piazzi.earth.fields import GravityField, gravity_field, read_gravity
    from piazzi.earth.finding import use_data
    from piazzi.earth.force_faults import coefficient_faults
    from piazzi.earth.forces import Forces
    from piazzi.earth.formula import Formula
    from piazzi.earth.geodetic import geodetic_to_position, position_to_geodetic
    from piazzi.earth.gravity import Gravity
    from piazzi.earth.ilrs import ilrs_stations
    from piazzi.earth.observatories import mpc_stations
    from piazzi.earth.rotation import FRAMES, rotation, rotation_rate, transform
    from piazzi.earth.satellites import LASER_SPHERES, LaserSphere, laser_sphere
    from piazzi.earth.space_weather import SpaceWeather, SpaceWeatherWarning, read_space_weather
    from piazzi.earth.station_files import read_stations
    from piazzi.earth.stations import (
        Coordinates,
        Eccentricity,
        Station,
        StationList,
        StationWarning,
        azimuth_elevation_range,
        up_north_east,
    )
    from piazzi.earth.subdaily import SubdailyEOP
    from piazzi.earth.tabulated import Body, Place, Rotation
    from piazzi.earth.thermosphere import Thermosphere
    from piazzi.earth.tides import pole_tide, solid_tide, station_displacement
    from piazzi.earth.weather import Weather

__all__ = [
    "BODIES", "EOP", "FRAMES", "LASER_SPHERES", "Body", "Coordinates", "EOPTable", "EOPWarning", "Eccentricity",
    "EphemerisWarning", "Epoch", "ForceChoice", "Forces", "Formula", "Gravity", "GravityField", "LaserSphere", "Place",
    "Rotation", "SpaceWeather", "SpaceWeatherWarning", "Station", "StationList", "StationWarning", "SubdailyEOP",
    "Thermosphere", "Weather", "azimuth_elevation_range", "body", "coefficient_faults", "default_forces",
    "geodetic_to_position", "gravity_field", "ilrs_stations", "laser_sphere", "media", "mpc_stations", "pole_tide",
    "position_to_geodetic", "read_eop", "read_forces", "read_gravity", "read_space_weather", "read_stations", "rotation",
    "rotation_rate", "sensors", "solid_tide", "station_displacement", "transform", "up_north_east", "use_data",
]  # fmt: skip

lazy(__name__)
