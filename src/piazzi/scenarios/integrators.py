"""The integrators that a file can name: one table, so that a new one is one line."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from typing import Any

from piazzi.kernels import Discrete, Integrator, RungeKutta4, Taylor
from piazzi.scenarios.faults import shown
from piazzi.scenarios.table import Table
from piazzi.scenarios.units import Units

INTEGRATORS: Mapping[str, type[Integrator]] = {
    "taylor": Taylor,
    "rk4": RungeKutta4,
    "discrete": Discrete,
}
IN_SECONDS = ("max_step",)


def read_integrator(table: Table, units: Units) -> Integrator | None:
    """The integrator of a table such as ``{method = "rk4", substeps = 10}``; None where it says nothing or is faulty."""
    method = table.text("method", choices=list(INTEGRATORS))
    if method is None:
        if not table.raw("method") and table.data:
            table.fault("", f"needs a method: one of {', '.join(INTEGRATORS)}")
        return None
    kind = INTEGRATORS[method]
    settings: dict[str, Any] = {}
    for field in fields(kind):
        if field.name in IN_SECONDS:
            settings[field.name] = table.number(field.name, units.time(), positive=True)
        else:
            settings[field.name] = _plain(table.raw(field.name))
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


def _plain(value: Any) -> Any:
    """Lists as tuples, so that settings hash; booleans are no numbers here."""
    return tuple(_plain(v) for v in value) if isinstance(value, list) else value


def _listed(value: Any) -> Any:
    return [_listed(v) for v in value] if isinstance(value, tuple) else value
