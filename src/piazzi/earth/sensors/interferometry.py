"""Differences between two stations that receive the same signal of a satellite."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from piazzi.earth.sensors.instrument import Instrument
from piazzi.earth.sensors.light import C, Leg, Light
from piazzi.earth.sensors.ray import Transmitter, ray_of
from piazzi.earth.sensors.text import distance, names
from piazzi.earth.stations import Station


def delay_difference(
    second: Station,
    *,
    name: str = "delay_difference",
    steps: bool = False,
    biases: Mapping[str, str] | Sequence[str] = (),
    parameters: Mapping[str, str] | Sequence[str] = (),
) -> Instrument:
    """A sensor of how much later (s) a `second` station receives what the station of a row receives at its time.

    A station gives the number ``delay_difference_bias`` (s); the others are as `range` takes them.
    """
    ray = ray_of("one-way", "reception", steps=steps)
    (leg,) = ray.light.legs
    other = Leg("other", "other_rho", "far", leg.satellite)
    own = {names("far", True): f"second(t - {leg.light_time} + other)", "other_rho": distance(leg.satellite, "far")}
    root = {"root": f"other_rho/{C} - other", "iterations": 3, "definitions": own}
    ray.light = Light(ray.light.definitions, {**ray.light.roots, other.light_time: root}, ray.light.legs)
    ray.makers["second"] = Transmitter(second)
    value = ray.biased(f"(other_rho - {leg.rho})/{C}", "delay_difference", biases)
    return ray.instrument(name, {"delay_difference": value}, parameters, units={"delay_difference": "s"})
