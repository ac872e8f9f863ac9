"""What satellites measure to one another: pseudoranges from navigation satellites, ranges between two orbits."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

from piazzi.earth.forces import STATES, Forces
from piazzi.earth.sensors.instrument import Instrument, one_of
from piazzi.earth.sensors.light import C, Light
from piazzi.earth.sensors.ray import Ray, ray_of
from piazzi.earth.sensors.text import AXES, names
from piazzi.model import Model, Sensor
from piazzi.model.pruning import used_definitions

_WORD = re.compile(r"(?<![\w.])[A-Za-z]\w*")
SECOND = tuple(f"{state}2" for state in STATES)


def pseudorange(
    *,
    name: str = "pseudorange",
    relativity: bool = False,
    biases: Mapping[str, str] | Sequence[str] = (),
    parameters: Mapping[str, str] | Sequence[str] = ("clock", "clock_rate"),
    visible: Sequence[str] = ("clear",),
) -> Instrument:
    """A sensor of the pseudorange (m) that a receiver on the satellite measures to a navigation satellite.

    Each navigation satellite is a station whose `place` is its orbit, a table of position and velocity (m, m/s, GCRF); times
    of rows are those of reception.  The receiver's clock is ahead by ``clock + clock_rate*t`` (m, m/s), which are parameters of
    the model, estimated; stations give ``emitter_clock`` and ``emitter_clock_rate``, by which theirs is ahead, and
    ``pseudorange_bias``.

    Parameters
    ----------
    name : of the sensor
    relativity : whether the gravity of the Earth delays the signal (Shapiro)
    biases, parameters : as `range` takes them
    visible : rules of when it is measured in simulations: ``"clear"`` of the Earth between the two
    """
    ray = ray_of("one-way", "reception", relativity=relativity, aboard=True)
    ray.numbers |= dict.fromkeys(("clock", "clock_rate", "emitter_clock", "emitter_clock_rate"), 0.0)
    value = f"{ray.length} + clock + clock_rate*t - emitter_clock - emitter_clock_rate*t"
    value = ray.biased(value, "pseudorange", biases)
    priors = {"clock": (0.0, 3e5), "clock_rate": (0.0, 3e2)}  # a millisecond, a microsecond a second
    asked = {*parameters} & {*priors}
    units = {key: unit for key, unit in (("clock", "m"), ("clock_rate", "m/s")) if key in asked}
    return ray.instrument(
        name, {"pseudorange": value}, parameters, visible, units={"pseudorange": "m"}, number_units=units, priors=priors
    )


def satellite_range(
    path: str = "two-way",
    *,
    name: str = "satellite_range",
    biases: Mapping[str, str] | Sequence[str] = (),
    parameters: Mapping[str, str] | Sequence[str] = (),
) -> Instrument:
    """A sensor of the range (m) between the two satellites of `two_satellites`, as the first receives it.

    Parameters
    ----------
    path : "two-way", there and back, the mean of both; or "one-way", from the second
    name : of the sensor
    biases, parameters : as `range` takes them, for ``satellite_range_bias`` (m)

    Raises
    ------
    ValueError
        For a path that there is not.
    """
    one_of(path, ("one-way", "two-way"), "path")
    far = {f"{names('first', True)}, {names('second', True)}": "at(-down, order=2)"}
    roots = {"down": _root("down", far, "second", {a: a for a in AXES})}
    if path == "two-way":
        roots["up"] = _root("up", {names("back"): "at(-down - up, order=2)"}, "second", {a: f"back_{a}" for a in AXES})
    ray = Ray(Light({}, roots, ()), "t")
    mean = "down_rho" if path == "one-way" else "(down_rho + up_rho)/2"
    value = ray.biased(mean, "satellite_range", biases)
    return ray.instrument(name, {"satellite_range": value}, parameters, units={"satellite_range": "m"})


def two_satellites(
    forces: Forces,
    sensors: Sensor | Sequence[Sensor] = (),
    parameters: Mapping[str, str] | Iterable[str] = (),
    own: Sequence[str] = (),
) -> Model:
    """The model of two satellites under the same forces: states x ... vz, and those of the second x2 ... vz2.

    Parameters
    ----------
    forces : on both
    sensors : that see either; those of `piazzi.earth.sensors` see the first, but for `satellite_range`
    parameters : as `Forces.model` takes them
    own : parameters of the forces that the second has for itself, such as ``cr_a_m``: its is ``cr_a_m2``

    Raises
    ------
    ValueError
        As `Forces.model` does; also where `own` is no parameter of the forces.
    """
    for name in own:
        one_of(name, forces.parameters, "own")
    given = [sensors] if isinstance(sensors, Sensor) else list(sensors)
    needed = used_definitions(forces.definitions, forces.dynamics.values())
    second = {name: f"{name}2" for name in (*STATES, *own)}
    while more := [left for left, text in needed.items() if left not in second and second.keys() & set(_WORD.findall(text))]:
        second |= {name: f"{name}2" for left in more for name in (left, *_WORD.findall(left))}

    def turned(text: str) -> str:
        return _WORD.sub(lambda found: second.get(found[0], found[0]), text)

    beside = {turned(left): turned(text) for left, text in needed.items() if turned(left) != left}
    dynamics = forces.dynamics | {turned(state): turned(text) for state, text in forces.dynamics.items()}
    roles = dict(parameters) if isinstance(parameters, Mapping) else dict.fromkeys(parameters, "fixed")
    roles = dict.fromkeys((f"{name}2" for name in own), "fixed") | roles
    called = {name: signature for s in given for name, signature in getattr(s, "signatures", {}).items()}
    asked = [role for s in given for role in getattr(s, "parameters", {}).items()]
    base = forces.model((), {**dict(asked), **roles})
    wanted = used_definitions(forces.definitions, [*forces.dynamics.values(), *(n for s in given for n in s.free_names)])
    return replace(
        base,
        states=(*STATES, *SECOND),
        dynamics=tuple(dynamics[state] for state in (*STATES, *SECOND)),
        sensors=tuple(given),
        groups={"position": (*STATES[:3],), "velocity": (*STATES[3:],)},
        units={state: base.unit(state.removesuffix("2")) for state in (*STATES, *SECOND)},
        definitions={**wanted, **beside},
        functions={**dict(base.functions), **called},
    )


def _root(light_time: str, definitions: Mapping[str, str], far: str, near: Mapping[str, str]) -> dict[str, Any]:
    rho = "sqrt(" + " + ".join(f"({far}_{a} - {near[a]})**2" for a in AXES) + ")"
    own = {**definitions, f"{light_time}_rho": rho}
    return {"root": f"{light_time}_rho/{C} - {light_time}", "iterations": 3, "definitions": own}
