"""How the Earth is turned: UT1 and the pole, day by day, from the files of the IERS, or held constant.

Tables hold one value per day at 0h UTC.  Between them UT1 - TAI (which has no leap seconds), the pole and its offsets follow
the polynomial through the four nearest days, as in Lagrange interpolation of degree 3; IERS Conventions 2010, 5.5.1.  What
moves both within the day is added by `subdaily`.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

import numpy as np

from piazzi.arrays import Array
from piazzi.earth import scales
from piazzi.earth.delta_t import MODEL, delta_t, delta_t_error
from piazzi.earth.finding import found
from piazzi.earth.scales import Pole
from piazzi.opening import opened
from piazzi.text import brief, is_number

ARCSEC = np.pi / 648000.0
SECULAR_POLE = ((0.0550, 0.001677), (0.3205, 0.003460))  # x and y in 2000.0 (") and per year: IERS Conventions, update of 2018
GROUND_SPEED = 465.0  # m/s that a place on the equator moves: what a second of UT1 costs
UT1_DRIFT = 1e-3  # s/day by which UT1 may part from its last known rate, from the record since 1962


_POINT, _MINUS, _DIGIT = ord("."), 1, 2
_KIND = np.full(256, 3, dtype=np.uint8)  # of characters, in the order that they have in a number: blank, minus, digit; no other
_KIND[ord(" ")], _KIND[ord("-")], _KIND[ord("0") : ord("9") + 1] = 0, _MINUS, _DIGIT


class EOPWarning(UserWarning):
    """The orientation of the Earth is not known at this date, or only predicted."""


@dataclass(frozen=True)
class EOP:
    """Earth orientation held constant: UT1 - UTC in seconds; pole and celestial pole offsets (IAU 2006/2000A) in arcseconds."""

    ut1_utc: float = 0.0
    xp: float = 0.0
    yp: float = 0.0
    dx: float = 0.0
    dy: float = 0.0

    def __post_init__(self) -> None:
        for name, limit, unit in (
            ("ut1_utc", 1.0, "s"),
            ("xp", 2.0, "arcsec"),
            ("yp", 2.0, "arcsec"),
            ("dx", 1.0, "arcsec"),
            ("dy", 1.0, "arcsec"),
        ):
            if not abs(getattr(self, name)) <= limit:
                raise ValueError(f"{name} is {getattr(self, name)!r} {unit}; it lies within {limit:g} {unit} of zero")

    def ut1_tai(self, whole: Array, fraction: Array) -> Array:
        """UT1 - TAI in seconds, (K,)."""
        day, seconds, part = scales.reading("UTC", whole, fraction)
        return np.asarray(self.ut1_utc - scales.tai_utc(day, seconds + part))

    def ut1_rate(self, whole: Array, fraction: Array) -> Array:
        """Seconds of UT1 - TAI per second: none."""
        return np.zeros(np.shape(whole))

    def pole(self, whole: Array, fraction: Array) -> Pole:
        """The constant pole at instants."""
        values = np.array([self.xp, self.yp, self.dx, self.dy]) * ARCSEC
        shape = (*np.shape(whole), 4)
        return Pole(np.broadcast_to(values, shape), np.zeros(shape))


@dataclass(frozen=True, eq=False)
class EOPTable:
    """Daily values from a file of the IERS.

    Parameters
    ----------
    mjd : (D,), days of UTC without gaps
    ut1_tai : (D,), s
    pole : (D, 4), xp, yp, dX, dY in radians; dX, dY against IAU 2006/2000A
    source : where the values are from
    measured : last day whose UT1 was measured; later ones are predictions
    """

    mjd: Array
    daily_ut1_tai: Array
    daily_pole: Array
    source: str
    measured: float
    _warned: list[bool] = field(default_factory=list, repr=False)

    __repr__ = brief

    def _at(self, whole: Array, fraction: Array, early: bool = False) -> tuple[Array, Array, Array]:
        """First of the four days that an instant lies in the middle of, days since that day, and days past the table's end."""
        tai_day, seconds, part = scales.reading("TAI", whole, fraction)
        utc = tai_day + (seconds + part) / scales.DAY - _tai_utc(tai_day) / scales.DAY
        beyond = np.maximum(utc - self.mjd[-1], self.mjd[0] - utc)
        if np.any(beyond > 0.0) and (early or np.any(utc > self.mjd[-1])):
            self._warn(float(utc.flat[int(np.argmax(beyond))]), float(np.max(beyond)))
        inside = np.clip(utc, self.mjd[0], self.mjd[-1])
        first = np.clip(np.floor(inside) - 1.0, self.mjd[0], self.mjd[-1] - 3.0)
        return (first - self.mjd[0]).astype(int), inside - first, utc - inside

    def ut1_tai(self, whole: Array, fraction: Array) -> Array:
        """UT1 - TAI in seconds, (K,): by the table, before it by a model of Delta T, after it at the rate of its last year."""
        first, u, past = self._at(whole, fraction)
        value = _cubic(self.daily_ut1_tai, first, u)[0]
        value = value + np.where(past > 0.0, past * self._last_rate, 0.0)
        if np.any(past < 0.0):
            early = delta_t(np.where(past < 0.0, decimal_year(whole), 1970.0))
            value = np.where(past < 0.0, scales.TT_TAI - early, value)
        return np.asarray(value)

    def ut1_rate(self, whole: Array, fraction: Array) -> Array:
        """Seconds of UT1 - TAI per second, (K,)."""
        first, u, past = self._at(whole, fraction)
        slope = _cubic(self.daily_ut1_tai, first, u)[1]
        slope = np.where(past > 0.0, self._last_rate, np.where(past < 0.0, 0.0, slope))
        return np.asarray(slope / scales.DAY)

    def pole(self, whole: Array, fraction: Array) -> Pole:
        """Pole and celestial pole offsets at instants; the nearest day's outside of the table, none before 1962."""
        first, u, past = self._at(whole, fraction, early=True)
        values, rates = _cubic(self.daily_pole, first, u)
        inside = (past == 0.0)[..., None]
        return Pole(np.where((past < 0.0)[..., None], 0.0, values), np.where(inside, rates, 0.0) / scales.DAY)

    @property
    def _last_rate(self) -> float:
        year = min(365, len(self.mjd) - 1)
        return float(self.daily_ut1_tai[-1] - self.daily_ut1_tai[-1 - year]) / year

    def _warn(self, utc: float, beyond: float) -> None:
        if self._warned:
            return
        self._warned.append(True)
        day = mjd_text(utc)
        if utc < self.mjd[0]:
            error = float(delta_t_error(np.array(decimal_year(np.array((utc - 51544.5) * scales.DAY)))))
            known = f"begin at {mjd_text(self.mjd[0])}; UT1 is from {MODEL}, without polar motion"
            cost = error * GROUND_SPEED + 15.0
        else:
            known = f"end at {mjd_text(self.mjd[-1])}; UT1 goes on at the rate of their last year"
            cost = beyond * UT1_DRIFT * GROUND_SPEED
        text = f"{day}: Earth orientation tables ({self.source}) {known}: up to {cost:.0f} m on the ground"
        warnings.warn(text, EOPWarning, stacklevel=4)


def _tai_utc(tai_day: Array) -> Array:
    return scales.tai_utc(np.maximum(tai_day, scales.UTC_BEGINS), np.zeros_like(tai_day))


def decimal_year(whole: Array) -> Array:
    """Julian years with decimals at seconds of TT past J2000.0."""
    return np.asarray(2000.0 + np.asarray(whole) / (365.25 * scales.DAY))


def mjd_text(mjd: float) -> str:
    """The date of a Modified Julian Day as YYYY-MM-DD."""
    import erfa

    year, month, day, _ = erfa.jd2cal(2400000.5, np.floor(mjd))
    return f"{int(year):04d}-{int(month):02d}-{int(day):02d}"


def _cubic(daily: Array, first: Array, u: Array) -> tuple[Array, Array]:
    """Value and daily rate of the cubic through four days from `first`, `u` days after the first."""
    u = u[..., None] if daily.ndim > 1 else u
    y0, y1, y2, y3 = (daily[first + i] for i in range(4))
    d1, d2, d3 = y1 - y0, (y2 - 2.0 * y1 + y0) / 2.0, (y3 - 3.0 * y2 + 3.0 * y1 - y0) / 6.0  # Newton's forward differences
    value = y0 + u * (d1 + (u - 1.0) * (d2 + (u - 2.0) * d3))
    rate = d1 + (2.0 * u - 1.0) * d2 + (3.0 * u * u - 6.0 * u + 2.0) * d3
    return value, rate


def read_eop(path: str | Path) -> EOPTable:
    """Earth orientation from a file: finals2000A, EOP 20 C04 or EOP 14 C04, or IERS Bulletin B, told apart by content.

    Raises ValueError with the file and the line where a value cannot be read, and OSError where the file cannot be opened.
    """
    path = Path(path)
    with opened(path) as file:
        lines = file.read().splitlines()
    if any(b"C04" in line for line in lines[:20]):
        return _c04(lines, path)
    if lines and len(lines[0]) >= 187 and is_number(lines[0][7:15]):
        return _finals(lines, path)
    raise ValueError(f"{path.name}: neither finals2000A nor EOP C04; both are files of the IERS")


def _raw(lines: list[bytes]) -> Array:
    """Characters of lines, (D, longest), with zeros behind short ones."""
    return np.array(lines, dtype=bytes).view(np.uint8).reshape(len(lines), -1)


def _columns(raw: Array, numbers: Array, spans: tuple[tuple[int, int], ...], path: Path) -> Array:
    """Numbers in fixed columns of lines, (D, columns); messages name the lines by their numbers in the file."""
    return np.stack([_decimals(raw[:, a:b], numbers, path) for a, b in spans], axis=1)


def _decimals(cells: Array, numbers: Array, path: Path) -> Array:
    """One column of numbers, (D,): in all bits what `float` makes of each cell."""
    if not len(cells):
        return np.zeros(0)
    at = int(np.argmax((cells == _POINT).all(axis=0)))
    rest = np.delete(cells, at, axis=1)
    kind = _KIND[rest]
    # blanks, at most one minus, digits, the point in one place: whole numbers below 2^53 over a power of ten, rounded once
    ordered = at and (np.diff(kind.astype(np.int8)) >= 0).all() and (kind[:, -1] == _DIGIT).all()
    if ordered and ((kind == _MINUS).sum(axis=1) < 2).all():
        whole = np.where(kind == _DIGIT, rest - ord("0"), 0) @ 10.0 ** np.arange(rest.shape[1])[::-1]
        return np.asarray(np.where((kind == _MINUS).any(axis=1), -1.0, 1.0) * whole / 10.0 ** (rest.shape[1] - at))
    texts = [bytes(cell).rstrip(b"\0") for cell in cells]
    try:
        return np.array([float(text) for text in texts])
    except ValueError:
        number, cell = next((n, text) for n, text in zip(numbers.tolist(), texts, strict=True) if not is_number(text))
        raise ValueError(f"{path.name}, line {number}: {cell.decode('ascii', 'replace').strip()!r} is not a number") from None


def _table(values: Array, path: Path, measured: float, dxdy_unit: float) -> EOPTable:
    """The table of rows of mjd, xp, yp, UT1-UTC, dX, dY, which have to be days in a row."""
    mjd = values[:, 0]
    if len(mjd) < 4 or np.any(np.diff(mjd) != 1.0):
        gap = mjd[int(np.argmax(np.diff(mjd) != 1.0))] if len(mjd) > 1 else float("nan")
        raise ValueError(f"{path.name}: days must follow one another, at least four; after MJD {gap:g} one is missing")
    ut1_tai = values[:, 3] - scales.tai_utc(mjd, np.zeros_like(mjd))
    pole = values[:, [1, 2, 4, 5]] * ARCSEC * np.array([1.0, 1.0, dxdy_unit, dxdy_unit])
    return EOPTable(mjd, ut1_tai, pole, str(path), measured)


def _c04(lines: list[bytes], path: Path) -> EOPTable:
    raw = _raw(lines)
    rows = np.flatnonzero((raw[:, :4] - ord("0") < 10).all(axis=1))
    if len(rows) and len(lines[rows[0]]) < 150:
        raise ValueError(f"{path.name}, line {rows[0] + 1}: a row of EOP C04 has at least 150 characters")
    values = _columns(raw[rows], rows + 1, ((16, 26), (26, 38), (38, 50), (50, 62), (62, 74), (74, 86)), path)
    return _table(values, path, float(values[-1, 0]) if len(values) else np.nan, 1.0)


def _finals(lines: list[bytes], path: Path) -> EOPTable:
    raw = _raw(lines)
    rows = np.flatnonzero((raw[:, 58:68] > ord(" ")).any(axis=1))
    raw = raw[rows]
    for a, b in ((97, 106), (116, 125)):  # offsets of the pole are not predicted as far as UT1: none is taken there
        raw[~(raw[:, a:b] > ord(" ")).any(axis=1), a:b] = np.frombuffer(b"0.000".rjust(b - a), np.uint8)
    values = _columns(raw, rows + 1, ((7, 15), (18, 27), (37, 46), (58, 68), (97, 106), (116, 125)), path)
    measured = values[raw[:, 57] == ord("I"), 0]
    return _table(values, path, float(measured.max()) if len(measured) else np.nan, 1e-3)


@cache
def tables() -> EOPTable:
    """The tables that are used: EOP 20 C04 from 1962, then finals2000A with its predictions of a year.

    They are those of the package `astropy-iers-data`, and after them a file in the folders of data (`finding.data_folders`)
    that was measured for longer.
    """
    import astropy_iers_data as package

    known = joined(read_eop(package.IERS_B_FILE), read_eop(package.IERS_A_FILE))
    for path in found("eop"):
        other = read_eop(path)
        if other.measured > known.measured and other.mjd[0] <= known.measured + 1.0:
            known = joined(known, other)
    return known


def joined(table: EOPTable, later: EOPTable) -> EOPTable:
    """A table to its last measured day, and another from there."""
    keep, take = table.mjd <= table.measured, later.mjd > table.measured
    return EOPTable(
        np.concatenate([table.mjd[keep], later.mjd[take]]),
        np.concatenate([table.daily_ut1_tai[keep], later.daily_ut1_tai[take]]),
        np.concatenate([table.daily_pole[keep], later.daily_pole[take]]),
        f"{table.source}, {later.source}",
        later.measured,
    )
