"""The half of a scenario file that is numbers: prior, noise, stations and parameters, in SI."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from piazzi.model import Model
from piazzi.problem import Gaussian, ProcessNoise, Station
from piazzi.problem.checks import Array, covariance
from piazzi.problem.constants import constant_name
from piazzi.scenarios.earth_sensors import PLACE, read_place
from piazzi.scenarios.equations import Physics
from piazzi.scenarios.orbit_prior import AXES, names_orbit, read_orbit, to_states
from piazzi.scenarios.orbit_prior import STATES as ORBIT
from piazzi.scenarios.quantities import read_schedule
from piazzi.scenarios.table import Table
from piazzi.text import shown
from piazzi.units import ONE, Units, is_quantity, size_of

if TYPE_CHECKING:
    from piazzi.earth import Epoch

FIRST = "first"  # measurement: where a prior stands that goes with any recording
SPREADS = ("sigma", "variance", "covariance")


def read_spread(
    table: Table, names: Sequence[str], factors: Sequence[float], *, definite: bool = False, missing: float | None = None
) -> Array | None:
    """Covariance matrix (n, n) in SI from one of the keys sigma, variance and covariance; None where that is faulty."""
    given = [key for key in SPREADS if key in table]
    if len(given) != 1:
        which = "has neither" if not given else f"has {' and '.join(given)}"
        table.fault("", f"{which}: give one of {', '.join(SPREADS)}" if given else f"needs one of {', '.join(SPREADS)}")
        return None
    key, scale = given[0], np.asarray(factors, dtype=float)
    if key == "covariance":
        value = table.matrix(key, names)
        out = None if value is None else value * np.outer(scale, scale)
    else:
        vector = table.vector(key, names, missing=missing)
        if vector is not None and (vector < 0).any():
            i = int(np.argmax(vector < 0))
            table.fault(key, f"of {names[i]!r} is {vector[i]:g}; it must not be negative")
            return None
        with np.errstate(over="ignore"):
            out = None if vector is None else np.diag((vector * scale) ** 2 if key == "sigma" else vector * scale**2)
    if out is None:
        return None
    with table.faults.at(table.at(key)):
        return covariance(out, len(names), "the matrix", names, definite=definite)
    return None


def read_prior(
    table: Table, physics: Physics, truth: Table, units: Units, start: float | None, epoch: Epoch | None = None
) -> tuple[Gaussian | None, float | None]:
    """Belief about the states, and its time; ``mean = "truth"`` is the perfect guess.

    The time is `start` where none is given, and None for ``time = "first"``: the first measurement, whenever that is.
    """
    if isinstance(table.raw("time"), str):
        table.text("time", choices=(FIRST,))
        time = None
    else:
        time = table.number("time", units.time()) if "time" in table else start
    P6: Array | None = None
    if names_orbit(table):
        orbit, P6, time = read_orbit(table, physics, units, epoch, time)
        mean = None if orbit is None else _with_orbit(table, physics, orbit)
    else:
        mean = _mean(table, physics, truth)
    P = _prior_covariance(table, physics, mean, P6)
    table.finish((*SPREADS, "axes"))
    return (None if mean is None or P is None else Gaussian(mean, P)), time


def _mean(table: Table, physics: Physics, truth: Table) -> Array | None:
    """A number for every state, in SI."""
    if table.raw("mean") is None:
        table.fault("mean", "is missing: give a number for every state")
    source, key = (truth, "state") if table.raw("mean") == "truth" else (table, "mean")
    if source is truth and not isinstance(truth.raw("state"), list | Mapping):
        table.fault("mean", 'is "truth", so truth.state must give numbers')
        source = Table({}, "", table.faults)
    mean = source.vector(key, physics.states)
    return None if mean is None else np.asarray(mean * physics.factors(physics.states))


def _with_orbit(table: Table, physics: Physics, orbit: Array) -> Array | None:
    """The orbit's six numbers, and those of further states from the mean."""
    others = [state for state in physics.states if state not in ORBIT]
    rest: Array | None = np.zeros(0)
    if others and any(key in table for key in ("a", "file")):
        rest = table.vector("mean", others)
        if rest is None and "mean" not in table:
            table.fault("mean", f"is missing: the orbit does not say {others[0]!r}")
    elif others:
        whole = table.vector("mean", physics.states)
        rest = None if whole is None else whole[[physics.states.index(s) for s in others]]
    if rest is None:
        return None
    found = dict(zip(ORBIT, orbit, strict=True)) | dict(zip(others, rest * physics.factors(others), strict=True))
    return np.array([found[state] for state in physics.states])


def _prior_covariance(table: Table, physics: Physics, mean: Array | None, P6: Array | None) -> Array | None:
    """The covariance in SI: that of the file unless the section has one, along the axes that it names."""
    states = physics.states
    given = any(key in table for key in SPREADS)
    if not given and P6 is not None and tuple(states) == ORBIT:
        return P6
    P = read_spread(table, states, physics.factors(states))
    axes = table.text("axes", "states", AXES)
    if P is None or mean is None or axes in (None, "states"):
        return P
    if not {*ORBIT} <= {*states} or physics.forces is None:
        table.fault("axes", f"is {axes}, which only orbits of [earth] have")
        return None
    where = [states.index(state) for state in ORBIT]
    whole = np.eye(len(states))
    with table.faults.at(table.at("axes")):
        whole[np.ix_(where, where)] = to_states(mean[where], str(axes))
        out = whole @ P @ whole.T
        return np.asarray(0.5 * (out + out.T))
    return None


def read_noise(table: Table, physics: Physics) -> ProcessNoise | None:
    """Process noise of the states, or of everything that is estimated; names that a table leaves out have none."""
    names = physics.states
    everything = physics.estimated
    for value in map(table.raw, SPREADS):
        whole = isinstance(value, list) and len(value) == len(everything)
        if whole or (isinstance(value, Mapping) and not set(everything[len(names) :]).isdisjoint(value)):
            names = everything
    per = table.text("per", "second", ("second", "step"))
    method = table.text("method", "integral", ("integral", "scaled"))
    axes = table.text("axes", "states", ("states", "orbit"))
    Q = read_spread(table, names, physics.factors(names), missing=0.0)
    table.finish(SPREADS)
    if Q is None or per is None or method is None or axes is None:
        return None
    return ProcessNoise(Q, per, method, axes)  # type: ignore[arg-type]


def read_station(table: Table, physics: Physics, units: Units, epoch: Epoch | None) -> Station | None:
    """A station: its name, sensor, noise, own numbers and schedule."""
    sensors = list(physics.components)
    name = table.text("name")
    if name is None and table.raw("name") is None:
        table.fault("name", "is missing")
    elif not name:
        table.fault("name", "must be a name")
    sensor = table.text("sensor", sensors[0] if len(sensors) == 1 else None, sensors)
    if "sensor" not in table and len(sensors) > 1:
        table.fault("sensor", f"is missing: one of {', '.join(sensors)}")
    if sensor is not None and not sensors:
        table.fault("sensor", f"is {shown(sensor)}, but there are no sensors")
    if sensor not in physics.components:
        if isinstance(table.raw("noise"), Mapping):
            table.table("noise").finish(SPREADS)
        table.finish(("noise", "numbers", "every", "from", "until", *PLACE))
        return None
    components, own = physics.components[sensor], physics.numbers[sensor]
    if not isinstance(table.raw("noise"), Mapping):
        example = [1.0] * len(components) if len(components) > 1 else 1.0
        table.fault("noise", f"must be a table, such as {{ sigma = {example} }}")
        R = None
    else:
        noise = table.table("noise")
        R = read_spread(noise, list(components), [u.factor for u in components.values()], definite=True)
        noise.finish(SPREADS)
    before = len(table.faults)
    given = table.table("numbers")
    considered: list[str] = []
    local, place = read_place(table, physics.instruments.get(str(sensor)), epoch)
    usual = physics.defaults.get(str(sensor), {})
    usual = usual | {key: value for key, value in local.items() if key in usual}
    numbers = {
        key: usual[key] if key in usual and key not in given else _own_number(key, given, own[key].factor, considered)
        for key in own
    }
    schedule = read_schedule(table, units, epoch, physics.schedules.get(str(sensor)))
    uncertain = [key for key, value in numbers.items() if isinstance(value, Gaussian)]
    physics.units |= {constant_name(key, name): own[key] for key in uncertain if name}
    for key in own:
        if key not in given and key not in usual:
            table.fault("numbers", f"has no value for {key!r}, which sensor {sensor!r} uses")
    given.finish()
    table.finish()
    if R is None or not name or len(table.faults) > before:
        return None
    return Station(name, sensor, R, {k: v for k, v in numbers.items() if v is not None}, considered, schedule, place)


def _own_number(name: str, table: Table, factor: float, considered: list[str]) -> Any:
    """A station's number, or a Gaussian for one that is estimated or, noted in `considered`, considered."""
    if not isinstance(table.raw(name), Mapping):
        return table.number(name, factor)
    inner = table.table(name)
    value = inner.number("value", factor)
    if "value" not in inner:
        inner.fault("value", "is missing")
    role = inner.text("role", "estimated", ("estimated", "considered"))
    P = read_spread(inner, [name], [factor])
    inner.finish(("role", *SPREADS[:2]))
    if role == "considered":
        considered.append(name)
    return None if value is None or P is None else Gaussian([value], P)


def read_stations(file: Table, physics: Physics, units: Units, epoch: Epoch | None = None) -> list[Station | None]:
    """All stations, None for those that are faulty."""
    stations = [read_station(table, physics, units, epoch) for table in file.array("stations")]
    seen: set[str] = set()
    for i, station in enumerate(stations):
        if station is not None and station.name in seen:
            file.faults.add(f"stations[{i}].name", f"is {shown(station.name)}, which is also the name of another station")
        seen |= {station.name} if station is not None else set()
    return stations


def read_parameters(table: Table, physics: Physics, model: Model | None) -> dict[str, Any]:
    """Values of the parameters: numbers, or a Gaussian for those that are estimated or considered."""
    roles = {p.name: p.role for p in model.parameters} if model else {}
    return {name: _parameter(name, table, physics, roles.get(name, "")) for name in table.data}


def _parameter(name: str, table: Table, physics: Physics, role: str) -> Any:
    factor = physics.units.get(name, ONE).factor
    if is_quantity(table.raw(name)):
        return size_of(table.raw(name)) * factor
    if not isinstance(table.raw(name), Mapping):
        return table.number(name, factor)
    inner = table.table(name)
    value = inner.number("value", factor)
    if "value" not in inner:
        inner.fault("value", "is missing")
    spread = [key for key in SPREADS[:2] if key in inner]
    role = inner.text("role", "fixed") or role
    if role == "fixed" and spread:
        inner.fault(spread[0], 'belongs to a parameter with role = "estimated" or "considered"; this one is fixed')
    P = None if role == "fixed" else read_spread(inner, [name], [factor])
    inner.finish(("role", "unit", *SPREADS[:2]))
    return value if role == "fixed" or value is None or P is None else Gaussian([value], P)
