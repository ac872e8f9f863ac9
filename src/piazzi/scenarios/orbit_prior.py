"""The prior of an orbit about the Earth: by elements, in other frames, from a file, and sigmas along axes of the orbit."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from piazzi.problem.checks import Array
from piazzi.scenarios.equations import Physics
from piazzi.scenarios.quantities import quantity
from piazzi.scenarios.table import Table
from piazzi.units import Units

if TYPE_CHECKING:
    from piazzi.earth import Epoch

STATES = ("x", "y", "z", "vx", "vy", "vz")
ELEMENTS = {"a": "length", "e": "", "i": "angle", "raan": "angle", "argp": "angle"}
ANOMALIES = {"nu": "true", "E": "eccentric", "M": "mean"}
KEYS = (*ELEMENTS, *ANOMALIES, "frame", "file", "object")
AXES = ("states", "RTN", "TNW")


def names_orbit(table: Table) -> bool:
    """Whether the section says its mean as an orbit."""
    return any(key in table for key in KEYS)


def read_orbit(
    table: Table, physics: Physics, units: Units, epoch: Epoch | None, time: float | None
) -> tuple[Array | None, Array | None, float | None]:
    """Mean (6,) and covariance (6, 6), which only files have, on the axes of the GCRF, and the time; None after a fault."""
    if physics.forces is None or epoch is None:
        table.fault("", "names an orbit, which needs [earth] and an epoch")
        for key in KEYS:
            table.raw(key)
        return None, None, time
    if "file" in table:
        return _of_file(table, epoch, time)
    if time is None:
        table.fault("time", "must be a number where the prior is an orbit")
        return None, None, None
    if any(key in table for key in (*ELEMENTS, *ANOMALIES)):
        r, v = of_elements(table, units, physics.forces.forces.field.gm)
    else:
        state = table.vector("mean", physics.states)
        if state is None:
            return None, None, time
        r, v = np.split((state * physics.factors(physics.states))[[physics.states.index(s) for s in STATES]], 2)
    if r is None:
        return None, None, time
    from piazzi.earth import transform

    with table.faults.at(table.at("frame")):
        r, turned = transform(r, v, table.text("frame", "GCRF") or "GCRF", "GCRF", epoch + time)
        return np.concatenate([r, np.asarray(turned)]), None, time
    return None, None, time


def of_elements(table: Table, units: Units, gm: float) -> tuple[Any, Any]:
    """Position and velocity of elements, (None, None) after a fault."""
    from piazzi.orbit import Keplerian

    found = [key for key in ANOMALIES if key in table]
    if len(found) != 1:
        table.fault("", f"has {' and '.join(found) or 'no anomaly'}: give one of {', '.join(ANOMALIES)}")
    if table.raw("mean") is not None and not isinstance(table.raw("mean"), dict):
        table.fault("mean", "stands beside elements, which say position and velocity")
    values = []
    for key in (*ELEMENTS, *found[:1]):
        kind = ELEMENTS.get(key, "angle")
        values.append(quantity(table, key, units, kind) if kind else table.number(key))
        if key not in table:
            table.fault(key, "is missing: an orbit has a, e, i, raan, argp and one of nu, E, M")
    if len(found) != 1 or None in values:
        return None, None
    with table.faults.at(table.path):
        return Keplerian(anomaly=ANOMALIES[found[0]]).to_state(np.array(values), gm)
    return None, None


def _of_file(table: Table, epoch: Epoch, time: float | None) -> tuple[Array | None, Array | None, float | None]:
    """The state of a file, and its covariance where it has one, at its own time."""
    from piazzi.orbit.starting import start_of

    name, chosen = table.text("file"), table.text("object")
    for key in KEYS:
        if key in table and key not in ("file", "object"):
            table.fault(key, "stands beside file, which has the orbit")
    if name is None:
        return None, None, time
    try:
        with table.faults.at(table.at("file")):
            near = epoch + time if time is not None and "time" in table else None
            start = start_of(table.faults.folder / name, near, chosen)
            return start.state, start.covariance, start.epoch - epoch
    except OSError as error:
        table.fault("file", f"{name}: {error.strerror or error}")
    return None, None, time


def to_states(state: Array, axes: str) -> Array:
    """The matrix (6, 6) that turns deviations along axes of the orbit into those of its states."""
    from piazzi.orbit import state_axes

    return np.asarray(state_axes(state[:3], state[3:], axes).T)
