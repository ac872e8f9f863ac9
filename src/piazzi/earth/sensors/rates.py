"""Rates of a signal's way: of an instant, and over a count, and the frequency that is received."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from piazzi.earth.constants import GM, SPEED_OF_LIGHT
from piazzi.earth.sensors.instrument import one_of
from piazzi.earth.sensors.light import C
from piazzi.earth.sensors.ray import Ray, ray_of
from piazzi.earth.sensors.text import difference, dot, length

REFERENCES = ("start", "middle", "end")
ENDS = {"start": ("", "+ count"), "middle": ("- count/2", "+ count/2"), "end": ("- count", "")}
MIDDLE = {"start": " + count/2", "middle": "", "end": " - count/2"}


@dataclass(frozen=True)
class Received:
    """A signal as it is received.

    Attributes
    ----------
    ray : its way; over a count at the end of that, with what the begin needs
    share : text, of what is received of a frequency that is sent
    sent : text, the instant when it was sent; over a count that of its middle
    signals : the ray, over a count with that of its begin
    """

    ray: Ray
    share: str
    sent: str
    signals: tuple[Ray, ...]

    def clocks(self) -> str:
        """Text of how much the clock of who sends is ahead of that of who receives, by their speeds and heights.

        Clocks go slower by U/c^2 + v^2/2c^2; over a count it is the mean of both ends.
        """
        shares = []
        for ray in self.signals:
            leg, p = ray.light.legs[0], ray.prefix
            for name, place in ((f"{p}slow", leg.satellite), (f"{p}slow_here", leg.station)):
                potential = f"{GM['earth']!r}/{length(place)} + ({dot(f'{place}_v', f'{place}_v')})/2"
                self.ray.definitions[name] = f"1 - ({potential})/{SPEED_OF_LIGHT**2!r}"
            names = (f"{p}slow_here", f"{p}slow") if leg.upwards else (f"{p}slow", f"{p}slow_here")
            shares.append("/".join(names))
        return shares[0] if len(shares) == 1 else f"({' + '.join(shares)})/{len(shares)}"


def received(path: str, count: str | None, steps: bool = False, **others: Any) -> Received:
    """A signal as it is received at times of rows, of an instant or over a count of which these are a part."""
    late = " - time_bias" if others.get("time_bias") else ""
    if count is None:
        ray = ray_of(path, "reception", steps=steps, **others)
        way = " + ".join(rates_of(ray, "reception"))
        return Received(ray, f"(1 - ({way})/{C})", f"t{late} - ({_times(ray)})", (ray,))
    ray, begin = counted(path, "reception", count, **others)
    legs = len(ray.light.legs)
    share = f"(1 - {legs}*({ray.length} - ({begin.length}))/({C}*count))"
    sent = f"t{late}{MIDDLE[count]} - ({_times(ray)} + {_times(begin)})/2"
    ray.add(begin)
    return Received(ray, share, sent, (ray, begin))


def _times(ray: Ray) -> str:
    """Text of the light times of all legs, together."""
    return " + ".join(leg.light_time for leg in ray.light.legs)


def counted(path: str, tag: str, count: str, **others: Any) -> tuple[Ray, Ray]:
    """Signals at the end and at the begin of a count; times of rows are its start, middle or end."""
    one_of(count, REFERENCES, "count")
    begin, end = ENDS[count]
    ray, other = (ray_of(path, tag, shift=s, prefix=p, steps=True, **others) for s, p in ((end, ""), (begin, "begin_")))
    ray.numbers["count"] = 10.0
    return ray, other


def rates_of(ray: Ray, tag: str) -> list[str]:
    """Names of the rates of the legs' lengths by the time of the tag: c dtau/dt of the light time's equation."""
    before, out = "", []
    legs = ray.light.legs if tag != "transmission" else tuple(reversed(ray.light.legs))
    for leg in legs:
        down = not leg.upwards
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


def mean_rate(ray: Ray, tag: str) -> str:
    """Text of their mean, by the time of the tag."""
    if len(ray.light.legs) == 1 and tag == "transmission":
        tag = "bounce"
    rates = rates_of(ray, tag)
    return rates[0] if len(rates) == 1 else f"({' + '.join(rates)})/{len(rates)}"
