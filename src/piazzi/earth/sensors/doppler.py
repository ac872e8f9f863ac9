"""Range-rate and Doppler: the rate of a signal's way, at an instant or over a count."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from piazzi.earth.constants import GM, SPEED_OF_LIGHT
from piazzi.earth.sensors.instrument import Instrument, one_of
from piazzi.earth.sensors.light import C, Leg
from piazzi.earth.sensors.ray import Ray, ray_of
from piazzi.earth.sensors.text import difference, dot, length
from piazzi.earth.stations import Station

REFERENCES = ("start", "middle", "end")
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
    visible: Sequence[str] = (),
) -> Instrument:
    """A sensor of range-rate (m/s), positive when receding: the rate of what `range` measures, by the time of the row.

    A station gives the numbers ``range_rate_bias`` (m/s) and, with `count`, ``count`` (s), default 10.

    Parameters
    ----------
    path, tag, steps, time_bias, biases, parameters, transmitter, visible, mapping : as `range` takes them
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
        ray = ray_of(path, tag, steps=steps, time_bias=time_bias, transmitter=transmitter)
        value = _mean_rate(ray, tag)
    else:
        one_of(count, REFERENCES, "count")
        begin = {"start": "", "middle": "- count/2", "end": "- count"}[count]
        end = {"start": "+ count", "middle": "+ count/2", "end": ""}[count]
        common: Any = {"relativity": relativity, "time_bias": time_bias, "transmitter": transmitter, "steps": True}
        ray, other = (ray_of(path, tag, shift=s, prefix=p, **common) for s, p in ((end, ""), (begin, "begin_")))
        for one in (ray, other):
            one.media(troposphere, ionosphere, advanced=True)
        value = f"({ray.length} - ({other.length}))/count"
        ray.add(other)
        ray.numbers["count"] = 10.0
    value = ray.biased(value, "range_rate", biases)
    return ray.instrument(name, {"range_rate": value}, parameters, visible, units={"range_rate": "m/s"}, mapping=mapping)


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
    rates = _rates(ray, "reception")
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


def frequency(
    nominal: float,
    *,
    name: str = "frequency",
    passes: Mapping[str, str] | Sequence[str] = (),
    relativity: bool = True,
    steps: bool = False,
    time_bias: bool = False,
    parameters: Mapping[str, str] | Sequence[str] = ("carrier", "drift"),
    visible: Sequence[str] = (),
) -> Instrument:
    """A sensor of the frequency (Hz) of a satellite's own transmitter, as a station receives it.

    Its carrier, how far it is from `nominal` (Hz), and the drift of that (Hz/s) since ``since`` (s, a number of the station,
    default 0) are parameters of the model, estimated, common to all stations; `Instrument.priors` has what they may be.

    Parameters
    ----------
    nominal : Hz
    name : of the sensor
    passes : names of stations or passes with parameters ``carrier_NAME`` and ``drift_NAME`` of their own, which are added
    relativity : whether the clock of the satellite goes by its speed and height
    steps, time_bias, parameters, visible : as `range` takes them; without parameters carrier and drift are numbers

    Raises
    ------
    ValueError
        For a frequency that is not positive.
    """
    if not nominal > 0.0:
        raise ValueError(f"nominal is {nominal!r}; a frequency is positive, in Hz")
    ray = ray_of("one-way", "reception", steps=steps, time_bias=time_bias)
    (rate,) = _rates(ray, "reception")
    carrier, drift = (f"{what}{ray.picked(what, passes)}" for what in ("carrier", "drift"))
    ray.numbers |= {"carrier": 0.0, "drift": 0.0, "since": 0.0}
    value = f"({nominal!r} + {carrier} + ({drift})*(t - since))*(1 - {rate}/{C})"
    if relativity:
        ray.definitions |= _clocks(ray.light.legs[0])
        value += "*slow/slow_here"
    owners = ["", *(name.removeprefix("carrier") for name in ray.roles if name.startswith("carrier_"))]
    priors = {f"carrier{o}": (0.0, CARRIER * nominal) for o in owners} | {f"drift{o}": (0.0, DRIFT * nominal) for o in owners}
    return ray.instrument(name, {"frequency": value}, parameters, visible, units={"frequency": "Hz"}, priors=priors)


def _rates(ray: Ray, tag: str) -> list[str]:
    """Names of the rates of the legs' lengths by the time of the tag: c dtau/dt of the light time's equation."""
    before, out = "", []
    legs = ray.light.legs if tag != "transmission" else tuple(reversed(ray.light.legs))
    for leg in legs:
        down = leg is ray.light.legs[0]
        line, rate = f"{leg.light_time}_line", f"{leg.light_time}_rate"
        whose = {"reception": "satellite" if down else "station", "bounce": "station"}.get(
            tag, "station" if down else "satellite"
        )
        moving = f"{leg.satellite if whose == 'satellite' else leg.station}_v"
        sign = "+" if down else "-"
        towards = {f"{line}_v{a}": f"{leg.satellite}_v{a} - {leg.station}_v{a}" for a in "xyz"}
        ray.definitions |= difference(line, leg.satellite, leg.station) | towards
        slope = f"({dot(line, f'{line}_v')})/({leg.rho} {sign} ({dot(line, moving)})/{C})"
        ray.definitions[rate] = f"{slope}*{before}" if before else slope
        out.append(rate)
        before = "" if tag == "bounce" else f"(1 {'-' if tag == 'reception' else '+'} {rate}/{C})"
    return out


def _mean_rate(ray: Ray, tag: str) -> str:
    if len(ray.light.legs) == 1 and tag == "transmission":
        tag = "bounce"
    rates = _rates(ray, tag)
    return rates[0] if len(rates) == 1 else f"({' + '.join(rates)})/{len(rates)}"


def _clocks(leg: Leg) -> dict[str, str]:
    """How slow the clocks of satellite and station go: 1 - U/c^2 - v^2/2c^2."""
    c2 = SPEED_OF_LIGHT**2
    return {
        name: f"1 - ({GM['earth']!r}/{length(place)} + ({dot(f'{place}_v', f'{place}_v')})/2)/{c2!r}"
        for name, place in (("slow", leg.satellite), ("slow_here", leg.station))
    }
