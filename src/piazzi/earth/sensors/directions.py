"""Directions: azimuth and elevation of mounts and antennas, right ascension and declination of telescopes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from piazzi.earth import media
from piazzi.earth.rotation import frame_named
from piazzi.earth.sensors.air import PLACE, WEATHER, Air
from piazzi.earth.sensors.instrument import Instrument, one_of
from piazzi.earth.sensors.light import C
from piazzi.earth.sensors.position import Turn
from piazzi.earth.sensors.ray import Ray, ray_of
from piazzi.earth.sensors.text import AXES, component, difference, dot, names
from piazzi.earth.sensors.turning import EarthVelocity

ANGLES = ("astrometric", "geocentric", "apparent")
REFRACTION = ("optical", "radio")
MOUNTS = {"azel": ("azimuth", "elevation"), "xeyn": ("x_east", "y_north"), "xsye": ("x_south", "y_east")}


def azimuth_elevation(
    angles: str = "apparent",
    *,
    name: str = "azimuth_elevation",
    mount: str = "azel",
    tag: str = "reception",
    steps: bool = False,
    refraction: str | None = None,
    time_bias: bool = False,
    biases: Mapping[str, str] | Sequence[str] = (),
    parameters: Mapping[str, str] | Sequence[str] = (),
    visible: Sequence[str] = (),
) -> Instrument:
    """A sensor of azimuth, from north through east, and elevation (rad), joint, or of both angles of another mount.

    Innovations of the azimuth, and so its noise, are on the sky: times the cosine of the elevation.  A station gives the
    numbers ``azimuth_bias`` and ``elevation_bias`` (rad); of other mounts they are called by their angles.

    Parameters
    ----------
    angles : "apparent", or "geocentric": without the aberration by the motion of the station
    name : of the sensor
    mount : "azel"; "xeyn", whose first angle ``x_east`` goes from the zenith to the east about an axis to the north, to which
        the second, ``y_north``, goes; or "xsye", ``x_south`` from the zenith to the south, and ``y_east``
    tag : what times of rows are; "bounce" is when a signal leaves the satellite, "transmission" when that of a radar leaves the
        station
    steps, time_bias, biases, parameters, visible : as `range` takes them
    refraction : "optical" or "radio", with the weather of the station; None where it was taken out already

    Raises
    ------
    ValueError
        For angles, a mount, a tag or a refraction that there is not.
    """
    one_of(angles, ANGLES[1:], "angles")
    one_of(mount, list(MOUNTS), "mount")
    ray = _seen(tag, steps, time_bias)
    air = Air()
    air.turn(ray.received, tuple(_sight(ray, angles)))
    above, up = "elevation", "look_u"
    if refraction is not None:
        _refract(air, refraction)
        above, up = "elevation + bent_refraction", "lifted"
        if mount != "azel":
            air.definitions["lifted"] = f"tan({above})*sqrt(look_e**2 + look_n**2)"
    ray.definitions |= air.definitions
    ray.numbers |= air.numbers
    texts = {
        "azel": ("atan2(look_e, look_n)", above),
        "xeyn": (f"atan2(look_e, {up})", f"atan2(look_n, sqrt(look_e**2 + {up}**2))"),
        "xsye": (f"atan2(-look_n, {up})", f"atan2(look_e, sqrt(look_n**2 + {up}**2))"),
    }[mount]
    kinds = MOUNTS[mount]
    equations = {kind: ray.biased(text, kind, biases) for kind, text in zip(kinds, texts, strict=True)}
    return ray.instrument(name, equations, parameters, visible, angles=kinds, on_sky={kinds[0]: kinds[1]})


def right_ascension_declination(
    angles: str,
    *,
    name: str = "right_ascension_declination",
    axes: str = "GCRF",
    tag: str = "reception",
    steps: bool = False,
    time_bias: bool = False,
    biases: Mapping[str, str] | Sequence[str] = (),
    parameters: Mapping[str, str] | Sequence[str] = (),
    visible: Sequence[str] = (),
    about: str = "earth",
) -> Instrument:
    """A sensor of right ascension and declination (rad), joint.

    Innovations of the right ascension, and so its noise, are on the sky: times the cosine of the declination.  A station gives
    the numbers ``right_ascension_bias`` and ``declination_bias`` (rad).

    Parameters
    ----------
    angles : "astrometric", reduced against stars of a catalogue: the direction in the BCRS from the observer at reception to
        the satellite at emission; "geocentric", that in the GCRS, with light time only, which differs by the annual aberration
        (20 arcseconds, kilometres in a geostationary orbit); or "apparent", with the aberration by the motion of the station
        too
    name : of the sensor
    axes : the frame along whose axes they are: GCRF, EME2000, MOD, TOD, TEME, ...
    about : "earth", or "sun" where states are about the Sun, and places of stations too (``earth.Place(..., about="sun")``)
    tag, steps, time_bias, biases, parameters, visible : as `azimuth_elevation` takes them

    Raises
    ------
    ValueError
        For angles, axes or a tag that there are not.
    """
    one_of(angles, ANGLES, "angles")
    one_of(about, ("earth", "sun"), "about")
    axes = frame_named(axes)
    ray = _seen(tag, steps, time_bias)
    sight = _sight(ray, angles) if about == "earth" else _sight_from_the_sun(ray, angles)
    if axes != "GCRF":
        turn = "fixed" if axes == "ITRF" else f"to_{axes.lower()}"
        if axes != "ITRF":
            ray.makers[turn] = Turn(axes)
        ray.definitions[names("turned")] = f"{turn}({ray.received}, {', '.join(sight)})"
        sight = [f"turned_{a}" for a in AXES]
    x, y, z = sight
    kinds = ("right_ascension", "declination")
    values = (f"atan2({y}, {x})", f"atan2({z}, sqrt({x}**2 + {y}**2))")
    equations = {kind: ray.biased(value, kind, biases) for kind, value in zip(kinds, values, strict=True)}
    return ray.instrument(name, equations, parameters, visible, angles=kinds, on_sky={kinds[0]: kinds[1]})


def _seen(tag: str, steps: bool, time_bias: bool) -> Ray:
    """The signal that comes down, and the line along it."""
    ray = ray_of("two-way" if tag == "transmission" else "one-way", tag, steps=steps, time_bias=time_bias)
    leg = ray.light.legs[0]
    ray.definitions |= difference("line", leg.satellite, leg.station)
    return ray


def _sight(ray: Ray, angles: str) -> list[str]:
    """Names of a vector along the direction, of any length, on the axes of the GCRF."""
    if angles == "geocentric":
        return [f"line_{a}" for a in AXES]
    rho = ray.light.legs[0].rho
    if angles == "apparent":  # first order in v/c: the second is 5e-7 arcseconds
        v = f"{ray.light.legs[0].station}_v"
        ray.definitions |= {f"sight_{a}": f"line_{a} + {rho}*{component(v, a)}/{C}" for a in AXES}
        return [f"sight_{a}" for a in AXES]
    ray.makers["earth_velocity"] = earth_velocity
    ray.definitions[names("sun_way")] = f"earth_velocity({ray.received})"
    ray.definitions |= {f"beta_{a}": f"sun_way_{a}/{C}" for a in AXES}
    ray.definitions |= {  # the aberration of one who moves with the Earth, undone: Klioner 2003, Astron. J. 125, 1580, eq. 10
        "rest": f"sqrt(1 - ({dot('beta', 'beta')}))",
        "ahead": f"({dot('line', 'beta')})/(1 + rest)",
        **{f"sight_{a}": f"rest*line_{a} - ({rho} - ahead)*beta_{a}" for a in AXES},
    }
    return [f"sight_{a}" for a in AXES]


def _sight_from_the_sun(ray: Ray, angles: str) -> list[str]:
    """The same where states are about the Sun: its axes are those of the catalogues, so the line itself is astrometric.

    The velocity of the Sun about the barycentre (15 m/s) is left out: 0.01 arcseconds of an apparent place, and 0.01 of where
    the body was when it sent the light.
    """
    if angles == "astrometric":
        return [f"line_{a}" for a in AXES]
    rho, station = ray.light.legs[0].rho, ray.light.legs[0].station
    if angles == "apparent":
        beta = {f"beta_{a}": f"{component(f'{station}_v', a)}/{C}" for a in AXES}
    else:
        ray.makers["earth_velocity"] = earth_velocity
        ray.definitions[names("sun_way")] = f"earth_velocity({ray.received})"
        beta = {f"beta_{a}": f"sun_way_{a}/{C}" for a in AXES}
    ray.definitions |= {
        **beta,
        "rest": f"sqrt(1 - ({dot('beta', 'beta')}))",
        "ahead": f"({dot('line', 'beta')})/(1 + rest)",
        **{f"sight_{a}": f"rest*line_{a} + ({rho} + ahead)*beta_{a}" for a in AXES},
    }
    return [f"sight_{a}" for a in AXES]


def earth_velocity(epoch: Any, eop: Any) -> EarthVelocity:
    """The motion of the Earth, for a problem's epoch."""
    return EarthVelocity(epoch)


def _refract(air: Air, kind: str) -> None:
    """What the air bends the elevation by: the name of it is ``bent_refraction``."""
    one_of(kind, REFRACTION, "refraction")
    air.numbers |= WEATHER
    if kind == "optical":
        del air.numbers["vapour"]
        air.add("bent", media.optical_refraction)
        return
    air.numbers |= {"height": PLACE["height"]}
    air.add("humid", media.refractivity)
    air.add("bent", media.radio_refraction, refractivity="humid_refractivity")
