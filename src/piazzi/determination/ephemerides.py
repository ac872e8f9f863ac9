"""`ephemeris`: where and when an orbit is seen from a station, and how sure that is."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from piazzi.determination.course import Course, course_of
from piazzi.determination.looking import LIT, LONGEST, SAMPLES, Observer, observer, seen, where
from piazzi.determination.passing import Instant, Passage, passages, span_of
from piazzi.earth import Epoch, Station
from piazzi.earth.constants import ASTRONOMICAL_UNIT
from piazzi.earth.stepping import longest_step
from piazzi.evaluate.grids import Grid
from piazzi.evaluate.quantities import finite, number
from piazzi.evaluate.tabled import Tabled
from piazzi.problem.checks import Array
from piazzi.text import brief, printable
from piazzi.units import positive_duration

if TYPE_CHECKING:
    import xarray

SCHEMA = "piazzi.ephemeris/1"
STEP = 60.0  # s
MOST, SHOWN = 10**6, 60  # rows that are made, and that a terminal shows
_FIRST_UTC = Epoch("1960-01-02T00:00:00 TT")
_LIGHT = {"earth": "", "sun": "from the Sun\n[deg]"}
UNITS = {
    "right_ascension": "rad", "declination": "rad", "azimuth": "rad", "elevation": "rad", "range": "m", "range_rate": "m/s",
    "frequency": "Hz", "rate": "rad/s", "position_angle": "rad", "sun_elevation": "rad", "moon_elevation": "rad", "shadow": "",
    "ellipse_major": "rad", "ellipse_minor": "rad", "ellipse_position_angle": "rad", "along_track_sigma": "s",
    "elongation": "rad",
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class Sky(Tabled):
    """What a station sees of an orbit.

    Attributes
    ----------
    course, station : of what, from where
    angles, axes : of right ascension and declination
    t : (K,), s past `course.epoch`, at the reception
    columns : by name (K,), SI and radians (`UNITS`); `shadow` is 0 in sunlight, 1 in half-shadow, 2 in full shadow; about the
        Sun there is `elongation` from it in its place
    passes : above the mask of the station, where they were asked for
    span : first and last instant that were looked at
    """

    course: Course
    station: Station
    angles: str
    axes: str
    t: Array
    columns: Mapping[str, Array]
    passes: tuple[Passage, ...] | None
    span: tuple[Epoch, Epoch]

    __repr__ = brief

    @property
    def epochs(self) -> list[Epoch]:
        """Of the rows."""
        return [self.course.epoch + float(x) for x in self.t]

    @property
    def scale(self) -> str:
        """That dates are told in: UTC, and before there was one UT1."""
        return "UTC" if self.span[0] > _FIRST_UTC else "UT1"

    def __getitem__(self, name: str) -> Array:
        return self.columns[name]

    def off(self, right_ascension: float, declination: float, row: int = 0) -> Array:
        """Another place seen from that of a row (2,), rad on the sky: east and north."""
        ours, east, north = _towards(self.columns["right_ascension"][row], self.columns["declination"][row])
        there, _, _ = _towards(right_ascension, declination)
        flat = np.array([east @ there, north @ there])
        size = float(np.linalg.norm(flat))
        return flat * (np.arctan2(size, ours @ there) / size) if size else flat

    def covariance(self, row: int = 0) -> Array:
        """Covariance (2, 2) of the place of a row, rad^2 on the sky, to the east and to the north; KeyError without one."""
        angle = float(self.columns["ellipse_position_angle"][row])
        axes = np.array([[np.sin(angle), np.cos(angle)], [np.cos(angle), -np.sin(angle)]])
        size = np.array([self.columns["ellipse_major"][row], self.columns["ellipse_minor"][row]]) / 3.0
        return np.asarray(axes.T * size**2 @ axes)

    def chi_square(self, right_ascension: float, declination: float, row: int = 0) -> float:
        """Squared distance of another place in sigma: it is inside the ellipse of 95 % below 5.99."""
        off = self.off(right_ascension, declination, row)
        return float(off @ np.linalg.solve(self.covariance(row), off))

    def to_dict(self) -> dict[str, Any]:
        """As JSON has it."""
        columns = {
            name: [LIT[int(v)] for v in values] if name == "shadow" else [finite(v) for v in values.tolist()]
            for name, values in self.columns.items()
        }
        latitude, longitude, height = self.station.place(self.span[0])
        return {
            "schema": SCHEMA, "object": self.course.name, "source": self.course.source, "station": self.station.name,
            "latitude": latitude, "longitude": longitude, "height": height, "angles": self.angles, "axes": self.axes,
            "first": str(self.span[0]), "last": str(self.span[1]), "times": [str(epoch) for epoch in self.epochs],
            "about": self.course.centre.name,
            "columns": columns, "units": {name: UNITS[name] for name in columns},
            "assumed": list(self.course.assumed),
            "passes": None if self.passes is None else [self._passed(one) for one in self.passes],
        }  # fmt: skip

    def _passed(self, one: Passage) -> dict[str, Any]:
        return {
            name: self._instant(at) for name, at in (("rise", one.rise), ("culmination", one.culmination), ("set", one.set))
        }

    def _instant(self, at: Instant | None) -> dict[str, Any] | None:
        if at is None:
            return None
        return {"time": str(self.course.epoch + at.time), "azimuth": at.azimuth, "elevation": at.elevation}

    def to_dataset(self) -> xarray.Dataset:
        """Columns over time, seconds of TT past the epoch in the attributes."""
        import xarray as xr

        facts = {key: value for key, value in self.to_dict().items() if isinstance(value, (str, float))}
        variables = {name: ("time", values, {"units": UNITS[name]}) for name, values in self.columns.items()}
        return xr.Dataset(variables, {"time": ("time", self.t, {"units": "s"})}, facts | {"epoch": self.course.epoch.exact()})

    def write(self, path: Any) -> None:
        """Write .csv, .nc or .cpf, whole or not at all."""
        from piazzi.determination.sky_files import write

        write(self, path)

    def grids(self) -> list[Grid]:
        """One table: of passes, or of rows."""
        return [_passes_grid(self) if self.passes is not None else _rows_grid(self)]

    def sentences(self) -> list[str]:
        """What was assumed."""
        return [f"Assumed: {printable(text)}." for text in self.course.assumed]

    def headlines(self) -> list[str]:
        """What is seen from where, and what the directions are."""
        on = "" if self.axes == "GCRF" else f" of {self.axes}"
        return [
            f"{self.course.name or 'the object'} from {self.station.name}: {self.angles} right ascension and declination{on}; "
            f"azimuth and elevation without refraction; {self.span[0]} to {self.span[1]}"
        ]


def ephemeris(
    orbit: Any,
    station: Any,
    when: Any = "tonight",
    *,
    step: Any = STEP,
    passes: bool = False,
    stations: Any = None,
    mask: float | None = None,
    frequency: float | None = None,
    angles: str = "astrometric",
    axes: str = "GCRF",
    object: str | None = None,  # noqa: A002  # as everywhere
    forces: Any = None,
    about: str = "earth",
    now: Epoch | None = None,
) -> Sky:
    """Where and when an orbit is seen from a station, by the sensors that tracking is fitted with.

    Rows are dated at the reception; range is the length of the signal's way down, range-rate its rate.

    Parameters
    ----------
    orbit : a `Determination`, its JSON or .nc; a file (OEM, OPM, OCM, SP3, CPF, TLE, OMM); elements or a state as text
    station : its name, an `earth.Station`, or ``"lat=50.1deg lon=8.6deg height=100m"``
    when : "tonight" (the Sun 6 degrees down, from `now`), ``"A .. B"``, ``"A .. +6h"``, a date, or two of them
    step : between rows, seconds or such as "30s"
    passes : find passes above the mask; rows are their culminations
    stations : files, lists, "ilrs" (the default)
    mask : lowest elevation of passes, rad; default that of the station
    frequency : that the satellite sends at, Hz
    angles, axes : of right ascension and declination: "astrometric", "geocentric" or "apparent", and a frame
    object : name, in a file of several
    forces : of an orbit that is given by one state, as `determine` takes them; default by height
    about : what elements or a state of text go about, "earth" or "sun"; a determination says it itself
    now : for "tonight"; default the clock

    Raises
    ------
    ValueError
        With what is wrong; also where the orbit is not known at some time.
    OSError
        Where a file cannot be read.
    """
    place = where(station, stations)
    first, last = span_of(when, place, now=now)
    width = positive_duration(step, "--step") if isinstance(step, str) else float(step)
    if not width > 0.0:
        raise ValueError(f"step is {width:g} s; it must be positive")
    if mask is not None and not (passes and -np.pi / 2 <= mask < np.pi / 2):
        size = f"is {np.degrees(mask):g} deg; an elevation is from -90 to below 90 deg"
        raise ValueError(f"--mask {size if passes else 'is of passes: add --passes'}")
    if frequency is not None and not 0.0 < frequency < np.inf:
        raise ValueError(f"--frequency is {frequency:g} Hz; it must be positive")
    if not passes and (last - first) / width > MOST:
        raise ValueError(f"--when with --step {width:g} s makes {(last - first) / width:,.0f} rows; at most {MOST:,} are made")
    course = course_of(orbit, first, chosen=object, forces=forces, about=about)
    begin, end = first - course.epoch, last - course.epoch
    if passes and not end > begin:
        raise ValueError(f"--when {when!r} is an instant; passes need a span")
    course.check(np.array([begin, end]))
    given = observer(course, place, angles=angles, axes=axes, frequency=frequency)
    found = None
    if passes:
        looks = _looks(given, begin, end, width)
        found = tuple(passages(given.mount_between(looks), looks, place.mask if mask is None else mask))
        t = np.array([one.culmination.time for one in found])
    else:
        t = begin + width * np.arange(int((end - begin) / width + 1e-9) + 1)
    return Sky(course, place, angles, axes, t, seen(given, t) if len(t) else {}, found, (first, last))


def _looks(given: Observer, begin: float, end: float, width: float) -> Array:
    """Times at which passes are looked for: as near to each other as the orbit is fast at its pericentre."""
    r, v = np.split(given.course.beliefs(np.array([begin]))[0][0], 2)
    about_the_sun = given.course.centre.name == "sun"  # where it is the Earth that turns
    step = min(width, LONGEST if about_the_sun else longest_step(r, v, SAMPLES))
    return np.linspace(begin, end, max(int(np.ceil((end - begin) / step)), 2) + 1)


def _clock(sky: Sky, t: float) -> str:
    return (sky.course.epoch + t).to(sky.scale).split()[0].split(".")[0].replace("T", " ")


def _towards(right_ascension: float, declination: float) -> tuple[Array, Array, Array]:
    """Unit vectors towards a place, east and north there."""
    c, s, cd, sd = np.cos(right_ascension), np.sin(right_ascension), np.cos(declination), np.sin(declination)
    return np.array([cd * c, cd * s, sd]), np.array([-s, c, 0.0]), np.array([-sd * c, -sd * s, cd])


def _degrees(value: float) -> str:
    return f"{np.degrees(value):.2f}"


def _motion(rate: float) -> str:
    """Arcseconds a second, with a decimal, or three digits where that would be none."""
    value = float(np.degrees(rate)) * 3600
    return f"{value:.1f}" if value >= 1.0 else number(value, 3)


def _light(sky: Sky, i: int) -> str:
    """Whether the Sun shines on a satellite, or how far from it a body is on the sky."""
    return LIT[int(sky.columns["shadow"][i])] if "shadow" in sky.columns else _degrees(sky.columns["elongation"][i])


def _passes_grid(sky: Sky) -> Grid:
    rows = []
    for one in sky.passes or ():
        cells = []
        for at in (one.rise, one.culmination, one.set):
            cells += ["-", "-"] if at is None else [_clock(sky, at.time), f"{np.degrees(at.azimuth):.1f}"]
        i = int(np.argmin(np.abs(sky.t - one.culmination.time)))
        high, sun = f"{np.degrees(one.culmination.elevation):.1f}", _degrees(sky.columns["sun_elevation"][i])
        rows.append((*cells, high, sun, _light(sky, i)))
    heads = (
        f"rise\n[{sky.scale}]",
        "az\n[deg]",
        f"culmination\n[{sky.scale}]",
        "az\n[deg]",
        f"set\n[{sky.scale}]",
        "az\n[deg]",
        "highest\n[deg]",
        "Sun\n[deg]",
        _LIGHT[sky.course.centre.name],
    )
    return Grid(f"Passes: {len(rows)}", heads, tuple(rows))


def _rows_grid(sky: Sky) -> Grid:
    c = sky.columns
    unit, metres, far = ("au", ASTRONOMICAL_UNIT, "{:.6f}") if sky.course.centre.name == "sun" else ("km", 1e3, "{:.3f}")
    heads = [
        f"time\n[{sky.scale}]",
        "RA\n[deg]",
        "Dec\n[deg]",
        "az\n[deg]",
        "el\n[deg]",
        f"range\n[{unit}]",
        "rate\n[km/s]",
        "motion\n[arcsec/s]",
    ]
    heads += ["Sun\n[deg]", _LIGHT[sky.course.centre.name]]
    heads += ["3 sigma\n[arcsec]", "along\n[s]"] if "ellipse_major" in c else []
    heads += ["frequency\n[Hz]"] if "frequency" in c else []
    rows = []
    for i in range(min(len(sky.t), SHOWN)):
        cells = [_clock(sky, float(sky.t[i])), f"{np.degrees(c['right_ascension'][i]):.4f}"]
        cells += [f"{np.degrees(c['declination'][i]):.4f}", _degrees(c["azimuth"][i]), _degrees(c["elevation"][i])]
        cells += [far.format(c["range"][i] / metres), f"{c['range_rate'][i] / 1e3:.4f}", _motion(float(c["rate"][i]))]
        cells += [_degrees(c["sun_elevation"][i]), _light(sky, i)]
        if "ellipse_major" in c:
            axes = " x ".join(number(np.degrees(c[f"ellipse_{k}"][i]) * 3600, 2) for k in ("major", "minor"))
            cells += [axes, number(c["along_track_sigma"][i], 2)]
        cells += [f"{c['frequency'][i]:.1f}"] if "frequency" in c else []
        rows.append(tuple(cells))
    more = f", the first {SHOWN} of {len(sky.t):,}" if len(sky.t) > SHOWN else ""
    return Grid(f"Ephemeris{more}", tuple(heads), tuple(rows))
