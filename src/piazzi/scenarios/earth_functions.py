"""Functions of the Earth, the Sun and the planets in a scenario: their kinds, and the keys of each."""

from __future__ import annotations

from dataclasses import MISSING, fields
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from piazzi.earth import Epoch
    from piazzi.scenarios.table import Table


class Kind(NamedTuple):
    """A recipe: where its class is, and its fields by keys of files; that of its epoch is the scenario's."""

    module: str
    name: str
    keys: Mapping[str, str] = {}


TABULATED, CELESTIAL, TURNING = "piazzi.earth.tabulated", "piazzi.earth.celestial", "piazzi.earth.sensors.turning"
KINDS = {
    "rotation": Kind(TABULATED, "Rotation", {"from": "from_", "to": "to", "eop": "eop"}),
    "body": Kind(TABULATED, "Body", {"body": "name", "center": "center", "kernel": "kernel", "scale": "scale"}),
    "asteroid": Kind(CELESTIAL, "Asteroid", {"number": "number", "kernel": "kernel"}),
    "geodesic_precession": Kind(CELESTIAL, "GeodesicPrecession"),
    "tide": Kind("piazzi.earth.tidal_harmonics", "TidalHarmonics", {"tide": "kind", "eop": "eop"}),
    "harris-priester": Kind("piazzi.earth.atmosphere", "HarrisPriester"),
    "msis": Kind(
        "piazzi.earth.thermosphere", "Thermosphere", {"orbit": "orbit", "orbit_time": "orbit_time", "weather": "weather"}
    ),
    "earth_velocity": Kind(TURNING, "EarthVelocity"),
    "spin": Kind(TURNING, "Spin", {"frame": "frame", "eop": "eop"}),
}
FILES = ("eop", "kernel", "weather")
WORDS = {
    "from": "the name of a frame, such as 'GCRF' or 'ITRF'", "to": "the name of a frame, such as 'GCRF' or 'ITRF'",
    "frame": "the name of a frame, such as 'ITRF'", "body": "the name of a body, such as 'sun'",
    "number": "of the minor planet, such as 1", "tide": "'k1' or 'pole'", "kernel": "a file of JPL",
    "orbit": "x, y, z, vx, vy, vz in m and m/s", "weather": "a file of CelesTrak",
}  # fmt: skip
CHOICES = {"scale": ("TT", "TDB"), "tide": ("k1", "pole")}
USUAL = {"frame": "ITRF"}
STATES = ("x", "y", "z", "vx", "vy", "vz")


def write_recipe(function: Any) -> dict[str, Any] | None:
    """Its table, None for a function of another kind; raises ValueError for data that are from no file."""
    for name, kind in KINDS.items():
        if (type(function).__module__, type(function).__name__) == kind[:2]:
            given = {key: getattr(function, field) for key, field in kind.keys.items()}
            return {"kind": name, **{key: _written(key, value) for key, value in given.items() if value is not None}}
    return None


def _written(key: str, value: Any) -> Any:
    if key == "eop":
        return written_orientation(value)
    if key not in FILES:
        return list(value) if isinstance(value, tuple) else value
    path = Path(getattr(value, "source", value))
    if not path.is_file():
        raise ValueError(f"{key} of {str(path)!r} cannot be written to a file: there is no such file")
    return str(path.absolute())


def written_orientation(eop: Any) -> Any:
    """Constants, the word for the usual tables, or a file; raises ValueError for a table that is from none."""
    from piazzi.earth.defaults import DAILY, SUBDAILY
    from piazzi.earth.eop import EOP
    from piazzi.earth.subdaily import SubdailyEOP

    if eop is None:
        return DAILY
    if isinstance(eop, SubdailyEOP):
        if eop.eop is None:
            return SUBDAILY
        daily = written_orientation(eop.eop)
        return f"{SUBDAILY}:{daily}" if isinstance(daily, str) else daily | {SUBDAILY: True}
    if isinstance(eop, EOP):
        return vars(eop)
    if not Path(eop.source).is_file():
        raise ValueError(f"Earth orientation of {eop.source!r} cannot be written to a file: there is no such file")
    return str(Path(eop.source).absolute())


def reader(name: str) -> Callable[[Table, Epoch | None], Any]:
    """What reads the table of a kind."""

    def read(table: Table, epoch: Epoch | None) -> Any:
        kind = KINDS[name]
        make = getattr(import_module(kind.module), kind.name)
        own = {f.name: f for f in fields(make)}
        given: dict[str, Any] = {}
        for key, field in kind.keys.items():
            if key in table:
                given[field] = _said(table, key)
            elif key in USUAL:
                given[field] = USUAL[key]
            elif own[field].default is MISSING:
                table.fault(key, f"is missing: {WORDS[key]}")
                return None
        if "epoch" in own and epoch is None:
            table.fault("kind", "needs dates: give the scenario an epoch, such as epoch = '2016-02-13T16:00:00 UTC'")
        elif all(value is not None for value in given.values()):  # else it has its fault already
            return make(**given, **({"epoch": epoch} if "epoch" in own else {}))
        return None

    return read


def _said(table: Table, key: str) -> Any:
    """What a key says: data of a file beside the scenario, numbers or text; None after a fault."""
    from piazzi.earth.defaults import read_data

    if key in FILES:
        return read_data(key, table.raw(key), table.faults.folder)
    if key == "orbit":
        return table.vector(key, STATES)
    if key == "orbit_time":
        return table.number(key)
    return table.whole(key) if key == "number" else table.text(key, choices=CHOICES.get(key, ()))
