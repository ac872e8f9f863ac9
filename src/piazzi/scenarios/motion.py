"""What moves states besides their equations, in a scenario file: the integrator, manoeuvres, Gauss-Markov accelerations."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields
from typing import Any

import numpy as np

from piazzi import kernels
from piazzi.kernels import Integrator
from piazzi.problem import Manoeuvre
from piazzi.scenarios.equations import Physics
from piazzi.scenarios.table import Table
from piazzi.scenarios.values import SPREADS, read_spread
from piazzi.text import nearest, shown
from piazzi.units import Units

INTEGRATORS: Mapping[str, type[Integrator]] = {
    "constant-acceleration": kernels.ConstantAcceleration,
    "taylor": kernels.ConstantAcceleration,
    "euler": kernels.Euler,
    "midpoint": kernels.Midpoint,
    "heun": kernels.Heun,
    "ralston": kernels.Ralston,
    "rk4": kernels.RungeKutta4,
    "dopri5": kernels.DormandPrince5,
    "rk8": kernels.RungeKutta8,
    "gauss-jackson": kernels.GaussJackson,
    "runge-kutta": kernels.RungeKutta,
    "adaptive": kernels.DormandPrince,
    "kepler": kernels.Kepler,
    "discrete": kernels.Discrete,
}
VELOCITY = "velocity"


def read_integrator(table: Table, units: Units) -> Integrator | None:
    """The integrator of a table such as ``{method = "rk4", substeps = 10}``; None where it says nothing or is faulty."""
    method = table.text("method", choices=list(INTEGRATORS))
    if method is None:
        if not table.raw("method") and table.data:
            table.fault("", f"needs a method: one of {', '.join(INTEGRATORS)}")
        return None
    kind = INTEGRATORS[method]
    settings = {field.name: _setting(table, field.name, units) for field in fields(kind)}
    table.finish()
    with table.faults.at(table.path):
        try:
            return kind(**{k: v for k, v in settings.items() if v is not None})
        except (TypeError, ArithmeticError) as error:
            raise ValueError(f"settings of {method!r} cannot be used: {shown(str(error))}") from None
    return None


def write_integrator(integrator: Integrator) -> dict[str, Any]:
    """The table that `read_integrator` reads back to an equal integrator; raises ValueError for one that has no name."""
    for method, kind in INTEGRATORS.items():
        if type(integrator) is kind:
            settings = {f.name: getattr(integrator, f.name) for f in fields(kind)}
            return {"method": method, **{k: _listed(v) for k, v in settings.items() if v is not None}}
    raise ValueError(f"integrator {type(integrator).__name__} cannot be written to a file; {', '.join(INTEGRATORS)} can")


def _setting(table: Table, name: str, units: Units) -> Any:
    """The value of an option, in SI."""
    value = table.raw(name)
    if isinstance(value, bool):
        table.fault(name, f"must not be {shown(value)}")
        return None
    if name == "max_step":
        return table.number(name, units.time(), positive=True)
    if name == "mu" and not isinstance(value, str):
        return table.number(name, units.unit("length**3/time**2").factor, positive=True)
    return _plain(value)


def _plain(value: Any) -> Any:
    """Lists as tuples, so that settings hash."""
    return tuple(_plain(v) for v in value) if isinstance(value, list) else value


def _listed(value: Any) -> Any:
    return [_listed(v) for v in value] if isinstance(value, tuple) else value


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


def read_gauss_markov(table: Table, physics: Physics, units: Units) -> dict[str, Any] | None:
    """What `with_gauss_markov` takes, as the section [gauss_markov] says, in SI; None after noting every fault."""
    for key in ("sigma", "time_constant"):
        if table.raw(key) is None:
            table.fault(key, "is missing")
    states = named_states(table, physics)
    constant = table.number("time_constant", units.time(), positive=True)
    sigma = _sigma(table, states)
    table.finish()
    if not states or sigma is None or constant is None:
        return None
    rates = [s * f / units.time() for s, f in zip(sigma, physics.factors(states), strict=True)]
    return {"sigma": rates, "time_constant": constant, "states": tuple(states)}


def _sigma(table: Table, states: Sequence[str]) -> list[float] | None:
    """One number for all states, or one for each."""
    given = table.raw("sigma")
    if isinstance(given, list | dict):
        vector = table.vector("sigma", states) if states else None
        return None if vector is None else vector.tolist()
    number = table.number("sigma", positive=True)
    return None if number is None else [number] * len(states)
