"""Sites of the International Laser Ranging Service, in the package: places, velocities and eccentricities by date."""

from __future__ import annotations

from functools import cache
from importlib.resources import files

from piazzi.earth.epoch import Epoch
from piazzi.earth.sinex import Sinex, stations_of
from piazzi.earth.stations import Coordinates, Eccentricity, StationList

SOURCE = "SLRF2014 of 2020-04-28"
REFERENCE = "2010-01-01T00:00:00 UTC"


def pack(sinex: Sinex) -> str:
    """The text that the package has of what a SINEX file says: one row for a site, its coordinates, and its eccentricities.

    Places to 0.1 mm at the reference epoch, velocities to 0.01 mm/year.  Eccentricities that follow one another and are the
    same are one row.
    """
    rows: list[str] = []
    for site, coordinates in sinex.coordinates.items():
        rows.append(f"S {site} {sinex.descriptions.get(site, '')}".rstrip())
        for c in coordinates:
            if c.reference != Epoch(REFERENCE):
                raise ValueError(f"site {site} is of {c.reference}, not of {REFERENCE}")
            numbers = " ".join([*(f"{v:.4f}" for v in c.position), *(f"{v:.5f}" for v in c.velocity)])
            rows.append(f"C {c.point} {_packed(c.since)} {_packed(c.until)} {numbers}")
        last = None
        for e in sinex.eccentricities.get(site, ()):
            here = (e.point, e.up, e.north, e.east)
            if here != last:
                rows.append(f"E {e.point} {_packed(e.since)} {e.up:.10g} {e.north:.10g} {e.east:.10g}")
            last = here
    return "\n".join(rows) + "\n"


def _packed(epoch: Epoch | None) -> str:
    if epoch is None:
        return "-"
    date, clock = epoch.to("UTC").removesuffix(" UTC").split("T")
    return date if clock == "00:00:00" else f"{date}T{clock}"


@cache  # of few dates: those of earthquakes
def _unpacked(text: str) -> Epoch | None:
    return None if text == "-" else Epoch(f"{text} UTC")


@cache
def _sinex() -> Sinex:
    sinex, site, reference = Sinex({}, {}, {}), "", Epoch(REFERENCE)
    text = files("piazzi.earth").joinpath("data", "ilrs.txt").read_text(encoding="utf-8")
    for row in text.splitlines():
        kind, *cells = row.split()
        if kind == "S":
            site = cells[0]
            sinex.descriptions[site] = " ".join(cells[1:])
        elif kind == "C":
            x, y, z, vx, vy, vz = (float(cell) for cell in cells[3:])
            spans = _unpacked(cells[1]), _unpacked(cells[2])
            row_of = Coordinates((x, y, z), (vx, vy, vz), reference, *spans, cells[0])
            sinex.coordinates.setdefault(site, []).append(row_of)
        elif kind == "E":
            up, north, east = (float(cell) for cell in cells[2:])
            offset = Eccentricity(up, north, east, _unpacked(cells[1]), None, cells[0])
            sinex.eccentricities.setdefault(site, []).append(offset)
    return sinex


def ilrs_eccentricities() -> dict[str, list[Eccentricity]]:
    """Eccentricities of the sites of the ILRS, by site."""
    return _sinex().eccentricities


@cache
def ilrs_stations() -> StationList:
    """Sites of the ILRS with places, velocities and eccentricities by date: SLRF2014 and the ILRS eccentricities of 2020-04-20.

    Post-seismic motion is not in it: sites that had an earthquake may be off by centimetres in the years after.
    """
    return StationList(tuple(stations_of(_sinex(), SOURCE)))
