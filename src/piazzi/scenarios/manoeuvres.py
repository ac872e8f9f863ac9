"""Manoeuvres of a scenario file: a time, what is added to which states, and how far that may have been off."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from piazzi.problem import Manoeuvre
from piazzi.scenarios.equations import Physics
from piazzi.scenarios.faults import shown
from piazzi.scenarios.quantities import SPREADS, read_spread
from piazzi.scenarios.table import Table
from piazzi.text import nearest
from piazzi.units import Units

VELOCITY = "velocity"


def read_manoeuvres(table: Table, physics: Physics, units: Units) -> list[Manoeuvre]:
    """The manoeuvres under [[manoeuvres]], those that are sound."""
    found = [_manoeuvre(entry, physics, units) for entry in table.array("manoeuvres")]
    return [m for m in found if m is not None]


def _manoeuvre(table: Table, physics: Physics, units: Units) -> Manoeuvre | None:
    states = named_states(table, physics)
    time = table.number("time", units.time())
    if table.raw("time") is None:
        table.fault("time", "is missing")
    if table.raw("delta_v") is None:
        table.fault("delta_v", "is missing")
    factors = physics.factors(states)
    delta = table.vector("delta_v", states) if states else None
    spread = read_spread(table, states, factors, missing=0.0) if states and any(k in table for k in SPREADS) else None
    table.finish((*SPREADS, "delta_v"))
    if time is None or delta is None:
        return None
    return Manoeuvre(time, delta * factors, spread, tuple(states))


def named_states(table: Table, physics: Physics) -> Sequence[str]:
    """States under the key "states": those of a group (default "velocity"), or those named; none after a fault."""
    given = VELOCITY if table.raw("states") is None else table.raw("states")
    if isinstance(given, str):
        if given not in physics.groups:
            table.fault("states", f"is {shown(given)}, which is not a group{nearest(given[:60], physics.groups)}")
        return physics.groups.get(given, ())
    if not isinstance(given, list) or not given or not all(isinstance(name, str) for name in given):
        table.fault("states", f"must be a group or a list of states, not {shown(given)}")
        return ()
    unknown = [name for name in given if name not in physics.estimated]
    if unknown:
        table.fault("states", f"names {shown(unknown[0])}, which is not a state{nearest(unknown[0][:60], physics.estimated)}")
    return () if unknown else given


def write_manoeuvre(manoeuvre: Manoeuvre) -> dict[str, Any]:
    """The table that `read_manoeuvres` reads back."""
    states = manoeuvre.states if isinstance(manoeuvre.states, str) else list(manoeuvre.states)
    out: dict[str, Any] = {"time": float(manoeuvre.time), "states": states}
    out["delta_v"] = np.asarray(manoeuvre.delta_v, dtype=float).reshape(-1).tolist()
    if manoeuvre.covariance is not None:
        spread = np.asarray(manoeuvre.covariance, dtype=float)
        out["covariance" if spread.ndim == 2 else "variance"] = spread.tolist()
    return out
