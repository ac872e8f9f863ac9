"""What data are used: the file of each kind, how far it reaches, what its age costs, and where it comes from."""

from __future__ import annotations

import datetime as dt
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from piazzi.earth import finding
from piazzi.earth.eop import GROUND_SPEED, mjd_text, tables
from piazzi.earth.epoch import Epoch
from piazzi.earth.fields import read_gravity
from piazzi.earth.ilrs import SOURCE
from piazzi.earth.observatories import mpc_date
from piazzi.earth.space_weather import read_space_weather
from piazzi.earth.station_files import read_stations

EOP_ADDRESS = "https://datacenter.iers.org/data/9/finals2000A.all"
WEATHER_ADDRESS = "https://celestrak.org/SpaceData/SW-All.csv"
KERNEL_ADDRESS = "https://naif.jpl.nasa.gov/pub/naif/generic_kernels/spk/planets/de440s.bsp"
LEAP_ADDRESS = "https://hpiers.obspm.fr/iers/bul/bulc/Leap_Second.dat"
MPC_ADDRESS = "https://www.minorplanetcenter.net/iau/lists/ObsCodes.html"
STATIONS_ADDRESS = "https://cddis.nasa.gov/archive/slr/products/resource/"
FIELD_ADDRESS = "https://icgem.gfz.de"
ADDRESSES = {"eop": EOP_ADDRESS, "weather": WEATHER_ADDRESS, "kernel": KERNEL_ADDRESS}


@dataclass(frozen=True)
class Entry:
    """One kind of data.

    Parameters
    ----------
    kind : eop, leap seconds, weather, kernel, stations, field
    file : its path, or where in the package it is; "" for none
    last : the last date that it has, "" where it has none
    predicted : the first day that is predicted, "" for none
    cost : what its age, or doing without, costs
    address : where it can be got from
    """

    kind: str
    file: str
    last: str
    predicted: str
    cost: str
    address: str


def prediction_error(days: float) -> float:
    """Metres on the ground by which UT1 and pole that were predicted so many days ahead are off (one sigma).

    Bulletin A of the IERS: 0.00025 s times days to the power of 0.75 for UT1, 0.00068 arcsec times days to 0.80 for the pole.
    """
    days = max(days, 0.0)
    return float(np.hypot(GROUND_SPEED * 2.5e-4 * days**0.75, np.radians(6.8e-4 * days**0.80 / 3600.0) * 6378137.0))


def inventory(now: Epoch | None = None) -> tuple[Entry, ...]:
    """What is used of every kind of data, at a date: today's by default.

    Raises ValueError where a file in the folders of data is of a kind but cannot be read.
    """
    today = _mjd(now)
    return (_eop(today), _leap_seconds(today), _weather(today), _kernel(), *_stations(), *_fields())


def _mjd(now: Epoch | None) -> float:
    epoch = Epoch(dt.datetime.now(dt.UTC)) if now is None else now
    return epoch.reading("UTC").day


def _eop(today: float) -> Entry:
    table = tables()
    age = today - table.measured
    if today > table.mjd[-1]:
        cost = f"ended {today - table.mjd[-1]:.0f} days ago: {prediction_error(age):.0f} m on the ground or more"
    else:
        cost = f"measured to {age:.0f} days ago: {prediction_error(age):.1f} m on the ground today" if age > 0 else "up to date"
    first = mjd_text(table.measured + 1.0)
    return Entry("eop", table.source, mjd_text(table.mjd[-1]), first, cost, EOP_ADDRESS)


def _leap_seconds(today: float) -> Entry:
    """The list that ERFA has; how long it is known to be complete is said by the file of the package `astropy-iers-data`."""
    import astropy_iers_data as package
    import erfa

    text = Path(package.IERS_LEAP_SECOND_FILE).read_text(encoding="utf-8")
    match = re.search(r"File expires on (\d+ \w+ \d{4})", text)
    expires = dt.datetime.strptime(match[1], "%d %B %Y").date() if match else dt.date.min
    last = erfa.leap_seconds.get()[-1]
    listed = [row.split() for row in text.splitlines() if row.strip() and not row.startswith("#")]
    complete = int(float(listed[-1][4])) == int(last["tai_utc"])
    known = complete and today <= (expires - dt.date(1858, 11, 17)).days
    cost = "none is announced" if known else "one that is missing moves dates in UTC by 1 s, 8 km along a low orbit"
    begun = f"{int(last['year'])}-{int(last['month']):02d}-01"
    return Entry("leap seconds", f"pyerfa, the last one before {begun}", expires.isoformat(), "", cost, LEAP_ADDRESS)


def _weather(today: float) -> Entry:
    path = next(finding.found("weather"), None)
    if path is None:
        return Entry("weather", "", "", "", "drag by NRLMSIS asks for one", WEATHER_ADDRESS)
    table = read_space_weather(path)
    age = today - table.measured
    cost = "density off by 20 to 50 % where predicted" if age > 1.0 else "up to date"
    return Entry("weather", str(path), mjd_text(table.mjd[-1]), mjd_text(table.measured + 1.0), cost, WEATHER_ADDRESS)


def _kernel() -> Entry:
    path = next(finding.found("kernel"), None)
    if path is None:
        return Entry("kernel", "", "", "", "series: Sun to 11 km, Moon to 29 km, planets to 1e3 to 1e6 km", KERNEL_ADDRESS)
    return Entry("kernel", str(path), kernel_end(path), "", "none", KERNEL_ADDRESS)


def kernel_end(path: Path) -> str:
    """The last date of a kernel that all its bodies have, "" without jplephem to read it."""
    from piazzi.earth.bodies import kernel_segments

    try:
        ends = [float(segment.end_jd) for segment in kernel_segments(path)]
    except ModuleNotFoundError:
        return ""
    return mjd_text(min(ends) - 2400000.5)


def _stations() -> list[Entry]:
    entries = [
        Entry("stations", f"package: ILRS sites, {SOURCE}", "2020-04-28", "", "later sites are not in it", STATIONS_ADDRESS)
    ]
    if (dated := mpc_date()) is not None:
        entries.append(
            Entry("stations", "package: observatory codes of the MPC", dated, "", "later codes are not in it", MPC_ADDRESS)
        )
    for path in finding.found("stations"):
        try:
            count = f"{len(read_stations(path))} stations"
        except ValueError as error:
            if "eccentricities only" not in str(error):
                raise
            count = "eccentricities"
        entries.append(Entry("stations", str(path), "", "", f"{count}; used where it is named", ""))
    return entries


def _fields() -> list[Entry]:
    entries = [Entry("field", "package: EGM2008 to degree 120", "", "", "none", FIELD_ADDRESS)]
    for path in finding.found("field"):
        field = read_gravity(path)
        entries.append(Entry("field", str(path), "", "", f"{field.name} to degree {field.degree}; used where it is named", ""))
    return entries
