"""Sensors of satellites and their stations in a scenario: ``kind`` of [sensors.NAME], ``site`` of [[stations]]."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from inspect import signature
from typing import TYPE_CHECKING, Any

from piazzi.model import Sensor
from piazzi.model.definitions import Definition
from piazzi.model.functions import ROOT
from piazzi.scenarios.quantities import quantity
from piazzi.scenarios.table import Faults, Table
from piazzi.text import nearest, shown
from piazzi.units import ONE, Unit, Units

if TYPE_CHECKING:
    from piazzi.earth import Epoch
    from piazzi.earth.sensors import Instrument

KINDS = (
    "position", "range", "range_rate", "azimuth_elevation", "right_ascension_declination", "frequency", "radar_delay",
    "radar_doppler", "returned_frequency", "carrier_phase", "pseudorange",
)  # fmt: skip
DIMENSIONS = {"m": "length", "m/s": "length/time", "rad": "angle"}
AXES = ("up", "north", "east")
ABOUT = ("earth", "sun")
PLACE = ("site", "orbit", "place", "weather", "tides")


def read_instrument(name: str, table: Table) -> Instrument | None:
    """The sensor of a ``kind`` with its options; None after a fault."""
    from piazzi.earth import sensors

    kind = table.text("kind", choices=KINDS)
    if kind not in KINDS:
        return None
    make = getattr(sensors, kind)
    known = [key for key in signature(make).parameters if key not in ("name", "transmitter")]
    options = {key: table.raw(key) for key in table.data if key not in ("kind", "numbers", "every", "from", "until")}
    for key in [key for key in options if key not in known]:
        table.fault(key, f"is no option of {kind}{nearest(key[:60], known)}")
        del options[key]
    try:
        made: Instrument = make(**options, name=name)
        return made
    except (TypeError, ValueError) as error:
        table.fault("", str(error))
    return None


def units_of(instrument: Instrument, units: Units) -> dict[str, Unit]:
    """The unit of every component: the file's for lengths, speeds and angles, else SI."""
    found = dict(instrument.units)
    return {c: units.unit(DIMENSIONS[found[c]]) if found[c] in DIMENSIONS else ONE for c in instrument.components}


def plain_sensor(instrument: Instrument, labels: Mapping[str, str]) -> Sensor:
    """The same as an ordinary sensor, as files hold it."""
    roots = {d.names[0]: _root(d) for d in instrument.definitions if d.function == ROOT}
    return Sensor(
        instrument.name,
        dict(zip(instrument.components, instrument.equations, strict=True)),
        instrument.angles,
        labels,
        {},
        {", ".join(d.names): d.text for d in instrument.definitions if d.function != ROOT},
        instrument.visible,
        roots,
        instrument.on_sky,
    )


def _root(d: Definition) -> dict[str, Any]:
    own = {", ".join(i.names): i.text for i in d.inner}
    return {"root": d.texts[0], "start": d.texts[1], "iterations": d.iterations, "definitions": own}


def read_place(table: Table, instrument: Instrument | None, epoch: Epoch | None) -> tuple[dict[str, float], Any]:
    """Numbers that follow from where a station is, and the table of its place; nothing where it says no site."""
    given = [key for key in PLACE if table.raw(key) is not None]
    if not given:
        return {}, None
    if epoch is None:
        table.fault(given[0], "needs dates: give the scenario an epoch, such as epoch = '2016-02-13T16:00:00 UTC'")
        return {}, None
    with table.faults.at(table.path):
        if "place" in table:
            return {}, _place_of(table.raw("place"), epoch)
        if "orbit" in table:
            return {}, _orbit(table, epoch)
        if "site" not in table or instrument is None:
            table.fault(given[0], "is of a station with a site, whose sensor has a kind")
            return {}, None
        station, weather = _site(table), _weather(table)
        if station is None:
            return {}, None
        tides = table.flag("tides", True) is not False
        found = instrument.at(station, epoch, 1.0, name=table.text("name"), weather=weather, tides=tides)
        usual = dict(instrument.defaults)
        return {key: value for key, value in found["numbers"].items() if value != usual[key]}, found["place"]
    return {}, None


def read_true_place(table: Table, entry: Table, instrument: Instrument | None, epoch: Epoch | None) -> Any:
    """Where a station really is: ``place``, or ``moved`` off what its entry says; None where it is there."""
    if "place" in table:
        return read_place(table, instrument, epoch)[1]
    if "moved" not in table:
        return None
    inner = table.table("moved")
    off = {key: quantity(inner, key, Units(), "length") or 0.0 for key in AXES}
    inner.finish(AXES)
    _, place = read_place(Table(entry.data, entry.path, Faults()), instrument, epoch)  # its faults are noted already
    if not hasattr(place, "station"):
        table.fault("moved", "is of a station with a site, whose sensor has a kind")
        return None
    return replace(place, station=place.station.moved(**off))


def _orbit(table: Table, epoch: Epoch) -> Any:
    """The place of a satellite that ``orbit`` says by elements at the scenario's epoch; None after a fault."""
    from piazzi.earth import gravity_field
    from piazzi.orbit.orbit_place import OrbitPlace
    from piazzi.scenarios.orbit_prior import ANOMALIES, ELEMENTS, of_elements

    inner, gm = table.table("orbit"), gravity_field("EGM2008").gm
    r, v = of_elements(inner, Units(), gm)
    inner.finish((*ELEMENTS, *ANOMALIES))
    return None if r is None else OrbitPlace((*r.tolist(), *v.tolist()), epoch, gm)


def _site(table: Table) -> Any:
    """The station that ``site`` is: a name of the ILRS, or a table as in a file of stations."""
    from piazzi.earth import ilrs_stations
    from piazzi.earth.station_files import station_of
    from piazzi.earth.stations import warn_of_place

    site = table.raw("site")
    if isinstance(site, Mapping):
        station = station_of({"name": table.text("name") or "station", **site}, table.at("site"))
        warn_of_place(station, table.at("site"))
        return station
    known = ilrs_stations()
    if not isinstance(site, str) or site not in known:
        hint = nearest(str(site)[:60], list(known))
        table.fault("site", f"is {shown(site)}, which is no site of the ILRS{hint}; or give latitude, longitude and height")
        return None
    return known[site]


def _weather(table: Table) -> Any:
    """Weather of ``weather``, None where there is none."""
    from piazzi.earth import Weather

    given = table.raw("weather")
    if given is None:
        return None
    inner = table.table("weather")
    found = {key: inner.number(key) for key in ("pressure", "temperature", "humidity") if key in inner}
    inner.finish()
    return Weather(**{key: value for key, value in found.items() if value is not None})


def write_place(place: Any) -> dict[str, Any]:
    """The table that `read_place` reads back; raises ValueError for a place that files cannot hold."""
    from piazzi.earth.tabulated import Place
    from piazzi.orbit.orbit_place import OrbitPlace
    from piazzi.outside.table import Table as Samples
    from piazzi.scenarios.earth_functions import written_orientation
    from piazzi.scenarios.functions import write_function

    if isinstance(place, Samples):
        return write_function(place)
    if isinstance(place, OrbitPlace):
        return {"kind": "orbit", "state": list(place.state), "gm": place.gm}
    if not isinstance(place, Place):
        raise ValueError(f"place {type(place).__name__} cannot be written to a file: it is known in Python only")
    station = place.station
    out: dict[str, Any] = {"kind": "centre" if station is None else "station", "tides": place.tides, "about": place.about}
    if station is not None:
        markers = [_dated(c, {"position": list(c.position), "velocity": list(c.velocity)}) for c in station.coordinates]
        offsets = [_dated(e, {"up": e.up, "north": e.north, "east": e.east}) for e in station.eccentricities]
        out |= {"name": station.name, "coordinates": markers, "eccentricities": offsets}
    return out if place.eop is None else out | {"eop": written_orientation(place.eop)}


def _dated(item: Any, out: dict[str, Any]) -> dict[str, Any]:
    """What holds between two dates, with them."""
    dates = {key: getattr(item, key, None) for key in ("since", "until", "reference")}
    return {**out, "point": item.point, **{key: date.exact() for key, date in dates.items() if date is not None}}


def _place_of(given: Any, epoch: Epoch) -> Any:
    """The place that `write_place` wrote; raises ValueError where it is none."""
    from pathlib import Path

    from piazzi.earth import Coordinates, Eccentricity, Place, Station
    from piazzi.earth import Epoch as Instant
    from piazzi.earth.defaults import read_data
    from piazzi.orbit.orbit_place import OrbitPlace
    from piazzi.outside.table import Table as Samples

    if not isinstance(given, Mapping):
        raise ValueError(f"place is {shown(given)}; it must be a table")
    if given.get("kind") == "orbit":
        return OrbitPlace(tuple(map(float, given["state"])), epoch, float(given["gm"]))
    if given.get("kind") == "table":
        return Samples(given["times"], given["values"], given.get("error"), given["terms"])

    def dated(row: Mapping[str, Any]) -> dict[str, Any]:
        return {key: Instant(value) if key in ("since", "until", "reference") else value for key, value in row.items()}

    station = None
    if given.get("kind") != "centre":
        markers = tuple(Coordinates(**dated(row)) for row in given.get("coordinates", ()))
        offsets = tuple(Eccentricity(**dated(row)) for row in given.get("eccentricities", ()))
        station = Station(str(given.get("name", "")), markers, offsets)
    eop = None if given.get("eop") is None else read_data("eop", given["eop"], Path())
    about = given.get("about", "earth")
    if about not in ABOUT:
        raise ValueError(f"place: about is {shown(about)}{nearest(str(about)[:60], ABOUT)}")
    return Place(station, epoch, eop, bool(given.get("tides", True)), about)
