"""Functions from outside in a scenario: the kinds of the package and files of data beside the scenario, never code."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from piazzi.model.definitions import name_of
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
    from piazzi.earth.sensors.turning import EarthVelocity, Spin
    from piazzi.earth.tabulated import Body, Rotation
    from piazzi.outside.interpolation import Interpolation
    from piazzi.outside.table import Table as Samples

    if isinstance(function, Gravity) and isinstance(function.model, str | Path):
        out: dict[str, Any] = {"kind": "gravity", "model": str(function.model), "degree": function.degree}
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
    if isinstance(function, Rotation):
        out = {"kind": "rotation", "from": function.from_, "to": function.to}
        return out if function.eop is None else out | {"eop": written_orientation(function.eop)}
    if isinstance(function, Body):
        out = {"kind": "body", "body": function.name, "center": function.center}
        return out if function.kernel is None else out | {"kernel": str(function.kernel)}
    if isinstance(function, EarthVelocity):
        return {"kind": "earth_velocity"}
    if isinstance(function, Spin):
        out = {"kind": "spin", "frame": function.frame}
        return out if function.eop is None else out | {"eop": written_orientation(function.eop)}
    raise ValueError(f"function {type(function).__name__} cannot be written to a file: it is known in Python only")


def _written_field(function: Any) -> dict[str, Any]:
    """A field as far as it is used, in numbers: the tide and the date are in them already."""
    field, N = function.field, function.degree
    c, s = (table[: N + 1, : N + 1].tolist() for table in (field.c, field.s))
    about = {"name": field.name, "gm": field.gm, "radius": field.radius, "tide_system": field.tide_system}
    numbers = {**about, "source": field.source, "c": c, "s": s}
    return {"kind": "gravity", "numbers": numbers, "gradient_degree": function.gradient_degree, "on": function.on}


def written_orientation(eop: Any) -> Any:
    """Constants, or the file that a table is from; raises ValueError for a table that is from none."""
    from piazzi.earth.defaults import WITHIN_THE_DAY
    from piazzi.earth.eop import EOP
    from piazzi.earth.subdaily import SubdailyEOP

    if isinstance(eop, SubdailyEOP):
        if eop.eop is None:
            return WITHIN_THE_DAY
        daily = written_orientation(eop.eop)
        return f"{WITHIN_THE_DAY}:{daily}" if isinstance(daily, str) else daily | {WITHIN_THE_DAY: True}
    if isinstance(eop, EOP):
        return vars(eop)
    if not Path(eop.source).is_file():
        raise ValueError(f"Earth orientation of {eop.source!r} cannot be written to a file: there is no such file")
    return str(Path(eop.source).absolute())


def _path(table: Table, text: str) -> Path:
    """A file beside the scenario."""
    return table.faults.folder / text


def _gravity(table: Table, epoch: Epoch | None) -> Any:
    from piazzi.earth.gravity import Gravity

    model: Any = table.text("model", "EGM2008") or "EGM2008"
    is_file = "." in model or "/" in model
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


def _rotation(table: Table, epoch: Epoch | None) -> Any:
    from piazzi.earth.tabulated import Rotation

    given, wanted = table.text("from"), table.text("to")
    for key, frame in (("from", given), ("to", wanted)):
        if frame is None:
            table.fault(key, "is missing: the name of a frame, such as 'GCRF' or 'ITRF'")
    if given is None or wanted is None or epoch is None:
        return _undated(table, epoch)
    from piazzi.earth.defaults import read_data

    eop = table.raw("eop")
    return Rotation(given, wanted, epoch, None if eop is None else read_data("eop", eop, table.faults.folder))


def _body(table: Table, epoch: Epoch | None) -> Any:
    from piazzi.earth.tabulated import Body

    name = table.text("body")
    if name is None:
        table.fault("body", "is missing: the name of a body, such as 'sun'")
    kernel, center = table.text("kernel"), table.text("center", "earth")
    if name is None or center is None or epoch is None:
        return _undated(table, epoch)
    return Body(name, epoch, None if kernel is None else _path(table, kernel), center)


def _earth_velocity(table: Table, epoch: Epoch | None) -> Any:
    from piazzi.earth.sensors.turning import EarthVelocity

    return _undated(table, epoch) if epoch is None else EarthVelocity(epoch)


def _spin(table: Table, epoch: Epoch | None) -> Any:
    from piazzi.earth.defaults import read_data
    from piazzi.earth.sensors.turning import Spin

    frame, eop = table.text("frame", "ITRF"), table.raw("eop")
    if frame is None or epoch is None:
        return _undated(table, epoch)
    return Spin(frame, epoch, None if eop is None else read_data("eop", eop, table.faults.folder))


def _undated(table: Table, epoch: Epoch | None) -> None:
    if epoch is None:
        table.fault("kind", "needs dates: give the scenario an epoch, such as epoch = '2016-02-13T16:00:00 UTC'")


KINDS: Mapping[str, Reader] = {
    "gravity": _gravity,
    "table": _samples,
    "interpolation": _interpolation,
    "rotation": _rotation,
    "body": _body,
    "earth_velocity": _earth_velocity,
    "spin": _spin,
}
