"""Light time as text of the language: a root for each leg, every station and the satellite at its own event.

The satellite is where it was at its event by position, velocity and acceleration (``at(offset, order=2)``, exact to 1e-8 m to
geostationary orbits), or, with `steps`, by a step of the dynamics to about that instant and a Kepler arc for the rest.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from piazzi.earth.constants import GM, SPEED_OF_LIGHT
from piazzi.earth.sensors.text import AXES, distance, length, names

C = repr(SPEED_OF_LIGHT)
PATHS = ("one-way", "two-way", "three-way")
TAGS = ("reception", "bounce", "transmission")


@dataclass(frozen=True)
class Leg:
    """A signal between satellite and station: names of its light time, its length and the places; whether it goes up."""

    light_time: str
    rho: str
    station: str
    satellite: str
    upwards: bool = False


@dataclass(frozen=True)
class Light:
    """Definitions and roots of the legs of a signal, and the names in them."""

    definitions: Mapping[str, str]
    roots: Mapping[str, Mapping[str, Any]]
    legs: tuple[Leg, ...]

    @property
    def mean(self) -> str:
        """Mean length of the legs, m."""
        total = " + ".join(leg.rho for leg in self.legs)
        return total if len(self.legs) == 1 else f"({total})/{len(self.legs)}"


def light(
    path: str,
    tag: str,
    *,
    shift: str = "",
    steps: bool = False,
    prefix: str = "",
    transmitter: str = "station",
    aboard: bool = False,
) -> Light:
    """The legs of a signal.

    Parameters
    ----------
    path : "one-way" (from the satellite), "two-way" or "three-way"
    tag : the event that times of the rows are of
    shift : text of what is added to those times, such as ``- time_bias``
    steps : whether the satellite moves by steps of the dynamics
    prefix : of all names
    transmitter : of a three-way signal, the function that says where its station is
    aboard : whether the satellite receives, and the station sends or returns what it sent
    """
    sat, down, up, rec, tra = (f"{prefix}{name}" for name in ("sat", "down", "up", "rec", "tra"))
    instant = f"t{_signed(shift)}"
    there = "station" if path != "three-way" else transmitter
    downward, upward = Leg(down, f"{down}_rho", rec, sat), Leg(up, f"{up}_rho", tra, sat, True)
    if aboard:
        back = f"{prefix}back"
        inward, outward = Leg(down, f"{down}_rho", tra, sat, True), Leg(up, f"{up}_rho", tra, back)
        order = "" if steps else ", order=2"
        before = f"at(-{down} - {up}{_signed(shift)}{order})"
        roots = {
            down: _root(inward, {names(tra, True): f"station({instant} - {down})"}),
            up: _root(outward, {names(back, True): before}),
        }
        if path == "one-way":
            del roots[up]
        return Light(_at_the_tag(sat, shift, steps), roots, (inward, outward)[: len(roots)])
    if path == "one-way" and tag != "reception":
        tag = "bounce"
    if tag == "reception":
        start, at = _satellite(sat, f"-{down}", shift, steps, rec)
        definitions = {names(rec, True): f"station({instant})", **start}
        roots = {down: _root(downward, at), up: _root(upward, {names(tra, True): f"{there}({instant} - {down} - {up})"})}
    elif tag == "bounce":
        definitions = _at_the_tag(sat, shift, steps)
        roots = {
            down: _root(downward, {names(rec, True): f"station({instant} + {down})"}),
            up: _root(upward, {names(tra, True): f"{there}({instant} - {up})"}),
        }
    else:
        start, at = _satellite(sat, up, shift, steps, tra)
        definitions = {names(tra, True): f"{there}({instant})", **start}
        roots = {up: _root(upward, at), down: _root(downward, {names(rec, True): f"station({instant} + {up} + {down})"})}
    if path == "one-way":
        del roots[up]
        return Light(definitions, roots, (downward,))
    return Light(definitions, roots, (downward, upward))


def shapiro(leg: Leg, gm: str = "earth") -> tuple[str, dict[str, str]]:
    """What gravity of a body at the centre delays a leg by (m), as the name of it and definitions."""
    name, far = f"{leg.light_time}_shapiro", f"{leg.light_time}_far"
    factor = 2.0 * GM[gm] / SPEED_OF_LIGHT**2
    text = {
        far: f"{length(leg.satellite)} + {length(leg.station)}",
        name: f"{factor!r}*log(({far} + {leg.rho})/({far} - {leg.rho}))",
    }
    return name, text


def _signed(shift: str) -> str:
    """Text that is added behind another."""
    return f" {shift}" if shift else ""


def _root(leg: Leg, definitions: Mapping[str, str]) -> dict[str, Any]:
    own = {**definitions, leg.rho: distance(leg.satellite, leg.station)}
    return {"root": f"{leg.rho}/{C} - {leg.light_time}", "iterations": 3, "definitions": own}


def _satellite(sat: str, offset: str, shift: str, steps: bool, station: str) -> tuple[dict[str, str], dict[str, str]]:
    """The satellite `offset` after the tag: what is worked out before the root, and within."""
    if not steps:
        return {}, {names(sat, True): f"at({offset}{_signed(shift)}, order=2)"}
    guess, near, late = f"{sat}_guess", f"{sat}_near", f"{sat}_late"
    moved = {a: f"{a} + ({shift})*v{a}" if shift else a for a in AXES}
    sign = offset[0] if offset[0] == "-" else ""
    before = {
        guess: "sqrt(" + " + ".join(f"({moved[a]} - {station}_{a})**2" for a in AXES) + f")/{C}",
        names(near, True): f"at({sign}{guess}{_signed(shift)})",
        f"{near}_pull": f"{GM['earth']!r}/({length(near)})**3",
    }
    within = {late: f"{guess} - {offset[1:]}" if sign else f"{offset} - {guess}"}
    within |= {f"{sat}_v{a}": f"{near}_v{a} - {late}*{near}_pull*{near}_{a}" for a in AXES}
    within |= {f"{sat}_{a}": f"{near}_{a} + {late}*({near}_v{a} - {late}/2*{near}_pull*{near}_{a})" for a in AXES}
    return before, within


def _at_the_tag(sat: str, shift: str, steps: bool) -> dict[str, str]:
    if not shift:
        return {f"{sat}_{a}": a for a in AXES} | {f"{sat}_v{a}": f"v{a}" for a in AXES}
    return {names(sat, True): f"at({shift})" if steps else f"at({shift}, order=2)"}
