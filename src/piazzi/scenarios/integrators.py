"""The integrators that a file can name: one table, so that a new one is one line."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from typing import Any

from piazzi import kernels
from piazzi.kernels import Integrator
from piazzi.scenarios.faults import shown
from piazzi.scenarios.table import Table
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
    "runge-kutta": kernels.RungeKutta,
    "adaptive": kernels.DormandPrince,
    "kepler": kernels.Kepler,
    "discrete": kernels.Discrete,
}


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
