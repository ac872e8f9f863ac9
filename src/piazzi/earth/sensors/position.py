"""Positions and velocities as they are fixed on board or by others."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from piazzi.earth.rotation import frame_named
from piazzi.earth.sensors.instrument import Instrument, picked, with_parameters
from piazzi.earth.sensors.text import AXES, length, names
from piazzi.earth.sensors.turning import Spin
from piazzi.earth.tabulated import Rotation

LEVER = ("radial", "along", "cross")


def position(
    name: str = "position",
    *,
    frame: str = "GCRF",
    velocity: bool = False,
    lever: bool = False,
    time_bias: bool = False,
    biases: Mapping[str, str] | Sequence[str] = (),
    parameters: Mapping[str, str] | Sequence[str] = (),
) -> Instrument:
    """A sensor of position (m), and of velocity (m/s, relative to the axes).

    Parameters
    ----------
    name : of the sensor
    frame : whose axes components are along; those of ITRF turn with the Earth
    velocity : whether velocity is measured too
    lever : whether what is measured stands off the centre of mass: numbers ``lever_radial``, ``lever_along`` and
        ``lever_cross`` (m), along the axes of the orbit
    time_bias : whether clocks are off: the number ``time_bias`` (s) is what their times are late by
    biases : stations or passes whose biases are parameters ``position_x_bias_NAME`` ...; see `range`
    parameters : its own numbers that are parameters of the model; see `range`

    Raises
    ------
    ValueError
        Where the frame is not known.
    """
    frame = frame_named(frame)
    definitions: dict[Any, str] = {}
    numbers = {f"lever_{axis}": 0.0 for axis in LEVER} if lever else {}
    place, speed = list(AXES), [f"v{a}" for a in AXES]
    if time_bias:
        definitions[names("fix", True)] = "at(-time_bias, order=2)"
        place, speed = [f"fix_{a}" for a in AXES], [f"fix_v{a}" for a in AXES]
        numbers["time_bias"] = 0.0
    if lever:
        definitions |= _lever(place, speed)
        place = [f"{p} + arm_{a}" for p, a in zip(place, AXES, strict=True)]
        speed = [f"{v} + arm_v{a}" for v, a in zip(speed, AXES, strict=True)]
    makers: dict[str, Any] = {}
    if frame != "GCRF":
        more, makers, place, speed = _turned(frame, "t - time_bias" if time_bias else "t", place, speed, velocity)
        definitions |= more
    equations: dict[str, str] = {}
    roles: dict[str, str] = {}
    measured = {f"position_{a}": p for a, p in zip(AXES, place, strict=True)}
    measured |= {f"velocity_{a}": v for a, v in zip(AXES, speed, strict=True)} if velocity else {}
    for component, value in measured.items():
        text, own, needs = picked(f"{component}_bias", biases)
        equations[component] = f"{value} + {component}_bias{text}"
        numbers |= own | {f"{component}_bias": 0.0}
        roles |= needs
    units = {component: "m" if component.startswith("position") else "m/s" for component in equations}
    numbers, roles = with_parameters(numbers, roles, parameters)
    return Instrument(name, equations, (), units, definitions=definitions, defaults=numbers, roles=roles, makers=makers)


def _turned(
    frame: str, instant: str, place: list[str], speed: list[str], velocity: bool
) -> tuple[dict[str, str], dict[str, Any], list[str], list[str]]:
    """Definitions and functions that turn a place and a velocity into axes that turn themselves, and the names of both."""
    text: dict[str, str] = {}
    makers: dict[str, Any] = {}
    turn = "fixed" if frame == "ITRF" else f"to_{frame.lower()}"
    if frame != "ITRF":  # that turn is the forces' own
        makers[turn] = Turn(frame)
    if velocity:
        makers[f"spin_{frame.lower()}"] = _Spin(frame)
        text[names("spin")] = f"spin_{frame.lower()}({instant})"
        text |= {f"still_{a}": p for a, p in zip(AXES, place, strict=True)}
        for v, (a, b, c) in zip(speed, (("x", "y", "z"), ("y", "z", "x"), ("z", "x", "y")), strict=True):
            text[f"still_v{a}"] = f"{v} - (spin_{b}*still_{c} - spin_{c}*still_{b})"
        text[", ".join(f"turned_v{a}" for a in AXES)] = f"{turn}({instant}, {', '.join(f'still_v{a}' for a in AXES)})"
    text[names("turned")] = f"{turn}({instant}, {', '.join(place)})"
    return text, makers, [f"turned_{a}" for a in AXES], [f"turned_v{a}" for a in AXES]


def _lever(place: Sequence[str], speed: Sequence[str]) -> dict[str, str]:
    """The arm along the axes of the orbit, and what its turning adds to velocity."""
    p, v = dict(zip(AXES, place, strict=True)), dict(zip(AXES, speed, strict=True))
    text = {f"n_{a}": f"{p[b]}*{v[c]} - {p[c]}*{v[b]}" for a, b, c in ("xyz", "yzx", "zxy")}
    text |= {"n_h": length("n"), "n_r2": " + ".join(f"{p[a]}**2" for a in AXES), "n_r": "sqrt(n_r2)"}
    text |= {f"arm_t{a}": f"(n_{b}*{p[c]} - n_{c}*{p[b]})/(n_h*n_r)" for a, b, c in ("xyz", "yzx", "zxy")}
    text |= {f"arm_{a}": f"lever_radial*{p[a]}/n_r + lever_along*arm_t{a} + lever_cross*n_{a}/n_h" for a in AXES}
    return text | {f"arm_v{a}": f"(n_{b}*arm_{c} - n_{c}*arm_{b})/n_r2" for a, b, c in ("xyz", "yzx", "zxy")}


class Turn:
    """Makes the rotation from GCRF."""

    def __init__(self, frame: str) -> None:
        self.frame = frame

    def __call__(self, epoch: Any, eop: Any) -> Rotation:
        return Rotation("GCRF", self.frame, epoch, eop)


class _Spin(Turn):
    def __call__(self, epoch: Any, eop: Any) -> Any:
        return Spin(self.frame, epoch, eop)
