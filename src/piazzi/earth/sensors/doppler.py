"""Range-rate and Doppler: the rate of a signal's way, at an instant or over a count."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from piazzi.earth.sensors.instrument import Instrument
from piazzi.earth.sensors.rates import counted, mean_rate, received
from piazzi.earth.sensors.ray import ray_of
from piazzi.earth.stations import Station

CARRIER, DRIFT = 1e-5, 3e-9  # of a crystal without oven: how far it is off, and per second as it warms up


def range_rate(
    path: str = "two-way",
    *,
    name: str = "range_rate",
    count: str | None = None,
    tag: str = "reception",
    steps: bool = False,
    relativity: bool = False,
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
    """A sensor of range-rate (m/s), positive when receding: the rate of what `range` measures, by the time of the row.

    A station gives the numbers ``range_rate_bias`` (m/s) and, with `count`, ``count`` (s), default 10.

    Parameters
    ----------
    path, tag, steps, time_bias, biases, parameters, transmitter, aboard, visible, mapping : as `range` takes them
    name : of the sensor
    count : None for the rate at an instant; "start", "middle" or "end" for the mean over a count of which times of rows are
        that part: the difference of two ranges.  Each is taken by one step of the dynamics, of at most some minutes
    relativity, troposphere, ionosphere : as `range` takes them, with `count` only; the ionosphere advances

    Raises
    ------
    ValueError
        For a path, tag, count or medium that there is not.
    """
    extras = {"relativity": relativity, "troposphere": troposphere, "ionosphere": ionosphere}
    if count is None:
        for what, given in extras.items():
            if given:
                raise ValueError(f"{what} changes slowly and is not in a rate at an instant: give count, or leave it out")
        ray = ray_of(path, tag, steps=steps, time_bias=time_bias, transmitter=transmitter, aboard=aboard)
        value = mean_rate(ray, tag)
    else:
        common: Any = {"relativity": relativity, "time_bias": time_bias, "transmitter": transmitter, "aboard": aboard}
        ray, other = counted(path, tag, count, **common)
        for one in (ray, other):
            one.media(troposphere, ionosphere, advanced=True)
        value = f"({ray.length} - ({other.length}))/count"
        ray.add(other)
    value = ray.biased(value, "range_rate", biases)
    return ray.instrument(name, {"range_rate": value}, parameters, visible, units={"range_rate": "m/s"}, mapping=mapping)


def frequency(
    nominal: float,
    *,
    name: str = "frequency",
    count: str | None = None,
    passes: Mapping[str, str] | Sequence[str] = (),
    relativity: bool = True,
    steps: bool = False,
    time_bias: bool = False,
    parameters: Mapping[str, str] | Sequence[str] = ("carrier", "drift"),
    aboard: bool = False,
    visible: Sequence[str] = (),
) -> Instrument:
    """A sensor of the frequency (Hz) of a satellite's own transmitter, as a station receives it.

    Its carrier, how far it is from `nominal` (Hz), and the drift of that (Hz/s) since ``since`` (s, a number of the station,
    default 0) are parameters of the model, estimated, common to all stations; `Instrument.priors` has what they may be.

    Parameters
    ----------
    nominal : Hz
    name : of the sensor
    count : None for the frequency of an instant, else the part of a count that times of rows are, as `range_rate` takes it: the
        mean over the number ``count`` (s)
    passes : names of stations or passes with parameters ``carrier_NAME`` and ``drift_NAME`` of their own, which are added
    relativity : whether the clock of the satellite goes by its speed and height
    steps, time_bias, parameters, aboard, visible : as `range` takes them; without parameters carrier and drift are numbers

    Raises
    ------
    ValueError
        For a frequency that is not positive, and a count that there is not.
    """
    if not nominal > 0.0:
        raise ValueError(f"nominal is {nominal!r}; a frequency is positive, in Hz")
    signal = received("one-way", count, steps, time_bias=time_bias, aboard=aboard)
    ray = signal.ray
    carrier, drift = (f"{what}{ray.picked(what, passes)}" for what in ("carrier", "drift"))
    ray.numbers |= {"carrier": 0.0, "drift": 0.0, "since": 0.0}
    value = f"({nominal!r} + {carrier} + ({drift})*(t - since))*{signal.share}"
    if relativity:
        value += f"*{signal.clocks()}"
    owners = ["", *(name.removeprefix("carrier") for name in ray.roles if name.startswith("carrier_"))]
    priors = {f"carrier{o}": (0.0, CARRIER * nominal) for o in owners} | {f"drift{o}": (0.0, DRIFT * nominal) for o in owners}
    return ray.instrument(name, {"frequency": value}, parameters, visible, units={"frequency": "Hz"}, priors=priors)
