"""Ranges: the length of a signal's way, with the light time of each leg."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from piazzi.earth.sensors.instrument import Instrument
from piazzi.earth.sensors.ray import ray_of
from piazzi.earth.stations import Station


def range(  # noqa: A001
    path: str = "two-way",
    *,
    name: str = "range",
    tag: str = "reception",
    steps: bool = False,
    relativity: bool | str = False,
    troposphere: str | None = None,
    mapping: str = "niell",
    ionosphere: str | None = None,
    time_bias: bool = False,
    biases: Mapping[str, str] | Sequence[str] = (),
    parameters: Mapping[str, str] | Sequence[str] = (),
    transmitter: Station | None = None,
    aboard: bool = False,
    visible: Sequence[str] = (),
) -> Instrument:
    """A sensor of range (m): the mean length of the legs, each station and the satellite at its own event.

    A station gives the numbers ``range_bias`` (m), ``range_scale`` and ``centre_of_mass`` (m, what the reflector is nearer
    by): ``(1 + range_scale)*(legs + media - centre_of_mass) + range_bias``.

    Parameters
    ----------
    path : "one-way" from the satellite to the station, "two-way", or "three-way" from a `transmitter`
    name : of the sensor
    tag : "reception", "bounce" (of one way: when the satellite sends) or "transmission": what times of rows are
    steps : whether the satellite is carried to its event by a step of the dynamics, as beyond the orbit of the Moon, instead of
        by position, velocity and acceleration
    relativity : whether the gravity of the Earth delays the legs (Shapiro); "sun", that of the Sun, where states are about it
    troposphere : "saastamoinen" for radio, "mendes-pavlis" or "marini-murray" for lasers; the weather is the station's
    mapping : "niell" or "gmf", with "saastamoinen"
    ionosphere : "single-layer" or "klobuchar", whose numbers stations give, with ``frequency`` and ``uplink_frequency`` (Hz)
    time_bias : whether clocks are off: the number ``time_bias`` (s) is what times of the rows are late by
    biases : stations, or passes, whose biases are parameters ``range_bias_NAME``, estimated; or a mapping to other roles
    parameters : numbers such as ``range_bias`` that are parameters of the model, estimated, common to its stations; or a
        mapping to other roles
    transmitter : the other station of "three-way"
    aboard : whether the satellite itself receives, what a station (whose place may be the orbit of another satellite) sends,
        or returns on two ways; times of rows are those of reception
    visible : when stations measure in simulation: "above" their ``mask`` (rad), "dark", with the Sun below their ``night``
        (rad, default -12 degrees), "sunlit", with the satellite out of the shadow of the Earth, "clear", with no Earth between;
        or rules as `Sensor` takes them

    Raises
    ------
    ValueError
        For a path, tag or medium that there is not.
    """
    ray = ray_of(path, tag, steps=steps, relativity=relativity, time_bias=time_bias, transmitter=transmitter, aboard=aboard)
    if aboard and (troposphere or ionosphere):
        raise ValueError("between satellites there is no troposphere, and the ionosphere is not modelled: leave them out")
    ray.media(troposphere, ionosphere)
    ray.numbers |= {"range_scale": 0.0, "centre_of_mass": 0.0}
    value = ray.biased(f"(1 + range_scale)*({ray.length} - centre_of_mass)", "range", biases)
    return ray.instrument(name, {"range": value}, parameters, visible, units={"range": "m"}, mapping=mapping)
