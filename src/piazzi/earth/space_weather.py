"""Space weather, day by day: F10.7 and Ap from the files of CelesTrak, with what of them is measured and what predicted."""

from __future__ import annotations

import datetime as dt
import warnings
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np

from piazzi.arrays import Array
from piazzi.earth.eop import mjd_text
from piazzi.earth.epoch import Epoch
from piazzi.opening import opened
from piazzi.text import brief

OBSERVED, PREDICTED, MONTHLY = 0, 1, 2
QUIET_AP = 15.0  # where a prediction has none: its mean over solar cycles
_UNIX = 40587
_UTC_BEGAN = -1262304000.0  # 1960, in seconds of TT past J2000; before, TT is half a minute off
_HEADER = "DATE,BSRN,ND,KP1"
_TYPES = {"OBS": OBSERVED, "INT": OBSERVED, "PRD": PREDICTED, "PRM": MONTHLY}
_SECTIONS = {"OBSERVED": OBSERVED, "DAILY_PREDICTED": PREDICTED, "MONTHLY_PREDICTED": MONTHLY, "MONTHLY_FIT": MONTHLY}
# text, version 1.2: ap of eight times three hours, their mean, observed F10.7 and its mean of 81 days about the day
_AP3, _AP, _F107, _F107A = tuple((46 + 4 * i, 50 + 4 * i) for i in range(8)), (78, 82), (112, 118), (118, 124)


class SpaceWeatherWarning(UserWarning):
    """Space weather of this date is predicted."""


class Indices(NamedTuple):
    """What density models take: F10.7 of the day before, its mean of 81 days, and the seven Ap of NRLMSIS.

    `ap` is the daily mean, the three hours now, 3, 6 and 9 hours before, and the means of 12 to 33 and 36 to 57 hours before.
    """

    f107: float
    f107_average: float
    ap: Array
    predicted: bool


@dataclass(frozen=True, eq=False)
class SpaceWeather:
    """Daily values from a file.

    Parameters
    ----------
    mjd : (D,), days of UTC without gaps
    f107, f107_average : (D,), observed flux at 10.7 cm in 1e-22 W/m^2/Hz, and its mean of 81 days about the day
    ap3 : (D, 8), ap of three hours each
    kind : (D,), 0 measured, 1 predicted for the day, 2 between predictions for months
    source : the file
    """

    mjd: Array
    f107: Array
    f107_average: Array
    ap3: Array
    kind: Array
    source: str
    _warned: list[bool] = field(default_factory=list, repr=False)

    __repr__ = brief

    @property
    def measured(self) -> float:
        """The last day that was measured, MJD; NaN where none was."""
        days = self.mjd[self.kind == OBSERVED]
        return float(days[-1]) if len(days) else np.nan

    def at(self, epoch: Epoch) -> Indices:
        """The indices of an instant; raises ValueError outside of the file, and warns once where they are predicted."""
        _, day, seconds, _ = epoch.reading("UTC" if epoch.whole > _UTC_BEGAN else "TT")
        i = int(day - self.mjd[0])
        if not 3 <= i < len(self.mjd):
            span = f"{mjd_text(self.mjd[0] + 3)} to {mjd_text(self.mjd[-1])}"
            raise ValueError(f"{Path(self.source).name} has space weather from {span}, not for {mjd_text(day)}")
        slots = self.ap3[: i + 1].ravel()
        now = 8 * i + min(int(seconds // 10800), 7)
        recent = [slots[now - k] for k in range(4)]
        ap = np.array([np.mean(self.ap3[i]), *recent, np.mean(slots[now - 11 : now - 3]), np.mean(slots[now - 19 : now - 11])])
        predicted = bool(self.kind[i] != OBSERVED)
        if predicted and not self._warned:
            self._warned.append(True)
            where = f"{Path(self.source).name}, measured to {mjd_text(self.measured)}"
            warnings.warn(
                f"F10.7 and Ap of {mjd_text(day)} are predicted ({where}): density may be off by 20 to 50 %",
                SpaceWeatherWarning,
                stacklevel=2,
            )
        return Indices(float(self.f107[i - 1]), float(self.f107_average[i]), ap, predicted)


class _Row(NamedTuple):
    line: int
    mjd: float
    f107: float
    average: float
    ap3: list[float]
    kind: int


def read_space_weather(path: str | Path) -> SpaceWeather:
    """F10.7 and Ap from a file of CelesTrak, CSV or text (``SW-All.csv``, ``SW-Last5Years.txt``), told apart by content.

    Predictions for months are joined by straight lines; where a prediction has no Ap it is 15.  Raises ValueError with file and
    line where a value cannot be read or a measured day is missing, and OSError where the file cannot be opened.
    """
    path = Path(path)
    with opened(path) as file:
        lines = file.read().decode("utf-8", "replace").splitlines()
    if lines and lines[0].startswith(_HEADER):
        rows = _csv(path, lines)
    elif lines and lines[0].upper().startswith("DATATYPE CSSISPACEWEATHER"):
        rows = _text(path, lines)
    else:
        raise ValueError(f"{path.name}: no space weather of CelesTrak: that begins with {_HEADER} or DATATYPE CssiSpaceWeather")
    return _daily(path, rows)


def _csv(path: Path, lines: list[str]) -> list[_Row]:
    header = lines[0].split(",")
    columns = {name: i for i, name in enumerate(header)}
    wanted = [*(f"AP{i}" for i in range(1, 9)), "AP_AVG", "F10.7_OBS", "F10.7_OBS_CENTER81", "F10.7_DATA_TYPE"]
    missing = [name for name in wanted if name not in columns]
    if missing:
        raise ValueError(f"{path.name}: no column {', '.join(missing)}")
    rows = []
    for number, line in enumerate(lines[1:], 2):
        cells = line.split(",")
        if not line.strip():
            continue
        if len(cells) != len(header):
            raise ValueError(f"{path.name}, line {number}: {len(cells)} cells, where the header has {len(header)}")
        label = cells[columns["F10.7_DATA_TYPE"]]
        if label not in _TYPES:
            raise ValueError(f"{path.name}, line {number}: data type {label!r}; there are {', '.join(_TYPES)}")
        texts = [cells[columns[name]] for name in wanted[:-1]]
        rows.append(_row(path, number, cells[0].split("-"), texts, _TYPES[label]))
    return rows


def _text(path: Path, lines: list[str]) -> list[_Row]:
    kind, rows = None, []
    for number, line in enumerate(lines, 1):
        word, _, section = line.strip().partition(" ")
        if word in ("BEGIN", "END"):
            kind = _SECTIONS.get(section.strip()) if word == "BEGIN" else None
        elif kind is not None and line.strip():
            texts = [line[a:b] for a, b in (*_AP3, _AP, _F107, _F107A)]
            rows.append(_row(path, number, [line[:4], line[4:7], line[7:10]], texts, kind))
    return rows


def _row(path: Path, number: int, date: list[str], texts: list[str], kind: int) -> _Row:
    try:
        year, month, day = (int(part) for part in date)
        mjd = float((dt.date(year, month, day) - dt.date(1970, 1, 1)).days + _UNIX)
    except (ValueError, OverflowError):
        raise ValueError(f"{path.name}, line {number}: {'-'.join(date)!r} is no date") from None
    values = [_number(path, number, text) for text in texts]
    mean = values[8] if np.isfinite(values[8]) else QUIET_AP
    if kind == OBSERVED and not np.isfinite(values[9]):
        raise ValueError(f"{path.name}, line {number}: a measured day without F10.7")
    ap3 = [mean if np.isnan(value) else value for value in values[:8]]
    average = values[10] if np.isfinite(values[10]) else values[9]
    return _Row(number, mjd, values[9], average, ap3, kind)


def _number(path: Path, number: int, text: str) -> float:
    if not text.strip():
        return np.nan
    try:
        value = float(text)
    except ValueError:
        raise ValueError(f"{path.name}, line {number}: {text.strip()!r} is not a number") from None
    if not 0.0 <= value < 2000.0:
        raise ValueError(f"{path.name}, line {number}: {text.strip()!r} is neither a flux nor an index")
    return value


def _daily(path: Path, rows: list[_Row]) -> SpaceWeather:
    kept: list[_Row] = []
    for row in rows:
        if kept and row.mjd <= kept[-1].mjd:
            if row.kind == MONTHLY:  # the month that the daily predictions end in
                continue
            raise ValueError(f"{path.name}, line {row.line}: {mjd_text(row.mjd)} comes after {mjd_text(kept[-1].mjd)}")
        if kept and row.kind != MONTHLY and row.mjd != kept[-1].mjd + 1.0:
            raise ValueError(f"{path.name}, line {row.line}: after {mjd_text(kept[-1].mjd)} a day is missing")
        kept.append(row)
    if len(kept) < 4:
        raise ValueError(f"{path.name}: {len(kept)} days; at least four are needed")
    days = np.array([row.mjd for row in kept])
    mjd = np.arange(days[0], days[-1] + 1.0)
    at = (days - days[0]).astype(int)
    ap3, kind = np.full((len(mjd), 8), QUIET_AP), np.full(len(mjd), MONTHLY, dtype=np.uint8)
    ap3[at], kind[at] = [row.ap3 for row in kept], [row.kind for row in kept]
    flux, average = (np.interp(mjd, days, [row[i] for row in kept]) for i in (2, 3))
    return SpaceWeather(mjd, flux, average, ap3, kind, str(path))
