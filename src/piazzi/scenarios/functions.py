"""Functions from outside in a scenario: the kinds of the package and files of data beside the scenario, never code."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from piazzi.model.definitions import name_of
from piazzi.scenarios.earth_functions import KINDS as RECIPES
from piazzi.scenarios.earth_functions import reader, write_recipe
from piazzi.scenarios.table import Table
from piazzi.text import nearest, shown

if TYPE_CHECKING:
    from piazzi.earth import Epoch

    Reader = Callable[[Table, "Epoch | None"], Any]


def read_functions(table: Table, epoch: Epoch | None) -> dict[str, Any]:
    """The functions of a scenario by name; faults are noted with their place."""
    out = {}
    for name, inner in table.tables():
        with table.faults.at(table.at(name)):
            name_of(name, "function")
            kind = inner.text("kind")
            if kind is None:
                inner.fault("kind", f"is missing: one of {', '.join(KINDS)}")
            elif kind not in KINDS:
                inner.fault("kind", f"is {shown(kind)}, which is no kind of function{nearest(kind[:60], KINDS)}")
            else:
                out[name] = KINDS[kind](inner, epoch)
                inner.finish()
    return {name: function for name, function in out.items() if function is not None}


def write_function(function: Any) -> dict[str, Any]:
    """The table that `read_functions` reads back; raises ValueError for a function that files cannot hold."""
    from piazzi.earth.gravity import Gravity
    from piazzi.outside.interpolation import Interpolation
    from piazzi.outside.table import Table as Samples

    if isinstance(function, Gravity) and isinstance(function.model, str | Path):
        model = str(function.model)
        model = str(Path(model).absolute()) if _is_file(model) else model
        out: dict[str, Any] = {"kind": "gravity", "model": model, "degree": function.degree}
        return out | {"gradient_degree": function.gradient_degree, "on": function.on}
    if isinstance(function, Gravity):
        return _written_field(function)
    if isinstance(function, Samples):
        out = {"kind": "table", "times": function.times.tolist(), "values": function.values.tolist(), "terms": function.terms}
        return out if function.error is None else out | {"error": function.error}
    if isinstance(function, Interpolation):
        nodes = {name: x.tolist() for name, x in zip("xy", function.nodes, strict=False)}
        out = {"kind": "interpolation", **nodes, "values": function.values.tolist(), "outside": list(function.outside)}
        return out if function.error is None else out | {"error": function.error}
    recipe = write_recipe(function)
    if recipe is not None:
        return recipe
    raise ValueError(f"function {type(function).__name__} cannot be written to a file: it is known in Python only")


def _written_field(function: Any) -> dict[str, Any]:
    """A field as far as it is used, in numbers: the tide and the date are in them already."""
    field, N = function.field, function.degree
    c, s = (table[: N + 1, : N + 1].tolist() for table in (field.c, field.s))
    about = {"name": field.name, "gm": field.gm, "radius": field.radius, "tide_system": field.tide_system}
    numbers = {**about, "source": field.source, "c": c, "s": s}
    return {"kind": "gravity", "numbers": numbers, "gradient_degree": function.gradient_degree, "on": function.on}


def _is_file(model: str) -> bool:
    """Whether that is a file of a field, not the name of one."""
    return "." in model or "/" in model


def _path(table: Table, text: str) -> Path:
    """A file beside the scenario."""
    return table.faults.folder / text


def _gravity(table: Table, epoch: Epoch | None) -> Any:
    from piazzi.earth.gravity import Gravity

    model: Any = table.text("model", "EGM2008") or "EGM2008"
    is_file = _is_file(model)
    if "numbers" in table:
        is_file, model = False, _field(table.table("numbers"))
    given = {key: table.raw(key) for key in ("degree", "gradient_degree", "on") if key in table}
    return Gravity(_path(table, model) if is_file else model, **given)


def _field(table: Table) -> Any:
    """The field that `_written_field` wrote."""
    import numpy as np

    from piazzi.earth.fields import GravityField

    about = {key: table.text(key, "") for key in ("name", "tide_system", "source")}
    c, s = (np.array(table.raw(key), dtype=float) for key in "cs")
    if c.ndim != 2 or c.shape != s.shape or len(c) != c.shape[-1]:
        raise ValueError(f"coefficients c and s have shapes {c.shape} and {s.shape}; they must be square and alike")
    return GravityField(gm=table.number("gm") or 0.0, radius=table.number("radius") or 0.0, c=c, s=s, **about)  # type: ignore[arg-type]


def _samples(table: Table, epoch: Epoch | None) -> Any:
    from piazzi.outside.table import Table as Samples

    options = {key: table.raw(key) for key in ("error", "terms") if key in table}
    file = table.text("file")
    if file is not None:
        return Samples.read(_path(table, file), **options)
    if "times" not in table or "values" not in table:
        table.fault("", "has no samples: give file = a CSV, or times and values")
        return None
    return Samples(table.raw("times"), table.raw("values"), **options)


def _interpolation(table: Table, epoch: Epoch | None) -> Any:
    from piazzi.outside.interpolation import Interpolation

    options = {key: table.raw(key) for key in ("outside", "error") if key in table}
    file = table.text("file")
    if file is not None:
        return Interpolation.read(_path(table, file), **options)
    if "x" not in table or "values" not in table:
        table.fault("", "has no nodes: give file = a CSV, or x, y for two variables, and values")
        return None
    x, values = table.raw("x"), table.raw("values")
    return Interpolation((x, table.raw("y")) if "y" in table else x, values, **options)


KINDS: Mapping[str, Reader] = {
    "gravity": _gravity,
    "table": _samples,
    "interpolation": _interpolation,
    **{name: reader(name) for name in RECIPES},
}
