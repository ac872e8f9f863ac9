"""What comes back: delays and shifts of echoes, frequencies and phases of signals that a satellite returns."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from piazzi.earth.sensors.instrument import Instrument
from piazzi.earth.sensors.light import C
from piazzi.earth.sensors.rates import rates_of, received
from piazzi.earth.sensors.ray import ray_of
from piazzi.earth.stations import Station


def radar_doppler(
    *,
    name: str = "radar_doppler",
    steps: bool = False,
    time_bias: bool = False,
    biases: Mapping[str, str] | Sequence[str] = (),
    parameters: Mapping[str, str] | Sequence[str] = (),
    transmitter: Station | None = None,
) -> Instrument:
    """A sensor of the shift in frequency (Hz) of an echo: received less transmitted, times of rows at reception.

    A station gives the numbers ``transmit_frequency`` and ``radar_doppler_bias`` (Hz); the others are as `range` takes them.
    """
    path = "three-way" if transmitter else "two-way"
    ray = ray_of(path, "reception", steps=steps, time_bias=time_bias, transmitter=transmitter)
    rates = rates_of(ray, "reception")
    ray.numbers["transmit_frequency"] = 2.38e9
    value = ray.biased(f"-transmit_frequency*({' + '.join(rates)})/{C}", "radar_doppler", biases)
    return ray.instrument(name, {"radar_doppler": value}, parameters, units={"radar_doppler": "Hz"})


def radar_delay(
    *,
    name: str = "radar_delay",
    steps: bool = False,
    relativity: bool = False,
    time_bias: bool = False,
    biases: Mapping[str, str] | Sequence[str] = (),
    parameters: Mapping[str, str] | Sequence[str] = (),
    transmitter: Station | None = None,
) -> Instrument:
    """A sensor of the time from transmission to reception of an echo (s), times of rows at reception.

    A station gives the number ``radar_delay_bias`` (s); the others are as `range` takes them.
    """
    path = "three-way" if transmitter else "two-way"
    ray = ray_of(path, "reception", steps=steps, relativity=relativity, time_bias=time_bias, transmitter=transmitter)
    value = ray.biased(f"2*({ray.length})/{C}", "radar_delay", biases)
    return ray.instrument(name, {"radar_delay": value}, parameters, units={"radar_delay": "s"})


def returned_frequency(
    path: str = "two-way",
    *,
    name: str = "returned_frequency",
    count: str | None = None,
    steps: bool = False,
    relativity: bool = False,
    time_bias: bool = False,
    biases: Mapping[str, str] | Sequence[str] = (),
    parameters: Mapping[str, str] | Sequence[str] = (),
    transmitter: Station | None = None,
) -> Instrument:
    """A sensor of the frequency (Hz) of a signal that the satellite's transponder returns, as a station receives it.

    What was sent is linear in time: ``transmit_frequency + transmit_rate*(t - since)``, numbers (Hz, Hz/s, s) of a station, as
    are the ratio ``turnaround`` of the transponder, ``returned_frequency_bias`` (Hz) and, with `count`, ``count`` (s).

    Parameters
    ----------
    path : "two-way", or "three-way" from a `transmitter`
    name : of the sensor
    count : as `frequency` takes it
    relativity : whether the gravity of the Earth delays the legs, with `count` only
    steps, time_bias, biases, parameters, transmitter : as `range` takes them
    """
    if relativity and count is None:
        raise ValueError("relativity changes slowly and is not in a frequency of an instant: give count, or leave it out")
    others = {"relativity": True} if relativity else {}
    signal = received(path, count, steps, time_bias=time_bias, transmitter=transmitter, **others)
    ray = signal.ray
    ray.numbers |= {"transmit_frequency": 2e9, "transmit_rate": 0.0, "since": 0.0, "turnaround": 1.0}
    value = f"turnaround*(transmit_frequency + transmit_rate*({signal.sent} - since))*{signal.share}"
    value = ray.biased(value, "returned_frequency", biases)
    return ray.instrument(name, {"returned_frequency": value}, parameters, units={"returned_frequency": "Hz"})


def carrier_phase(
    path: str = "two-way",
    *,
    name: str = "carrier_phase",
    steps: bool = False,
    relativity: bool = False,
    time_bias: bool = False,
    passes: Sequence[str] = (),
    parameters: Mapping[str, str] | Sequence[str] = (),
    transmitter: Station | None = None,
    aboard: bool = False,
) -> Instrument:
    """A sensor of counts of a carrier (cycles) from an unknown begin: its phase, or the cycles of its Doppler shift.

    It is ``phase + beat*(t - since) - cycles*way``: the way is the length of all legs, and numbers of a station are
    ``cycles`` (1/m, of what is received without a shift: frequency over the speed of light), ``beat`` (Hz, at which the count
    grows without a shift) and ``since`` (s).

    Parameters
    ----------
    path, steps, relativity, time_bias, parameters, transmitter, aboard : as `range` takes them
    name : of the sensor
    passes : names of stations or passes, each with a parameter ``phase_NAME`` of its own, where its count began
    """
    others: Any = {"relativity": relativity, "time_bias": time_bias, "transmitter": transmitter, "aboard": aboard}
    ray = ray_of(path, "reception", steps=steps, **others)
    ray.numbers |= {"cycles": 1.0, "beat": 0.0, "since": 0.0, "phase": 0.0}
    late = " - time_bias" if time_bias else ""
    legs = len(ray.light.legs)
    text = f"phase{ray.picked('phase', passes)} + beat*(t{late} - since) - cycles*{legs}*({ray.length})"
    return ray.instrument(name, {"carrier_phase": text}, parameters, units={"carrier_phase": "cycle"})
