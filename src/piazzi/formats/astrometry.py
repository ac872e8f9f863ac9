"""How good astrometry of minor planets is where nobody says it, by station, date, technique and catalogue.

Source: Veres, Farnocchia, Chesley and Chamberlin, Statistical analysis of astrometric errors for the most productive asteroid
surveys, Icarus 296 (2017) 139, tables 2 to 5.  Values are in arcseconds, of each coordinate on the sky.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from piazzi.arrays import Array
from piazzi.formats.conventions import Conventions, with_usual_sigmas
from piazzi.formats.observations import Observations

NIGHT = 28800.0  # s without a row after which a station begins another night
FULL = 4  # rows of a night that count fully
_ARCSECOND = math.pi / 648000.0
_J2000 = 51544.5

# table 2: before and from a day (MJD) on
_BY_DATE = {"703": (56658, 1.0, 0.8), "691": (52640, 0.6, 0.5), "644": (52883, 0.6, 0.4)}
# tables 3 and 4; those of the Las Cumbres Observatory have one value
_LAS_CUMBRES = ("K91", "K92", "K93", "Q63", "Q64", "V37", "W85", "W86", "W87", "E10", "F65")
_BY_STATION: Mapping[str, float] = {
    "704": 1.0, "G96": 0.5, "F51": 0.2, "G45": 0.6, "699": 0.8, "D29": 0.75, "C51": 1.0, "E12": 0.75, "608": 0.6, "J75": 1.0,
    "645": 0.3, "673": 0.3, "689": 0.5, "950": 0.5, "H01": 0.3, "J04": 0.4, "W84": 0.5, **dict.fromkeys(_LAS_CUMBRES, 0.4),
}  # fmt: skip
# table 4: by catalogue too (values that hold for one observer of a station, not for all, are left out)
_BY_CATALOGUE: Mapping[str, Mapping[str, float]] = {
    "568": {"USNO-B": 0.5, "PPMXL": 0.2, "Gaia": 0.1}, "Y28": {"PPMXL": 0.3, "Gaia": 0.3},
    **{station: {"Gaia": 0.1} for station in ("T09", "T12", "T14")},
}  # fmt: skip
_KNOWN, _UNKNOWN = 1.0, 1.5  # other cameras, with the catalogue named or not
# table 5: by the letter of the technique; photographs by their date
_BY_TECHNIQUE: Mapping[str, float] = {"E": 0.2, "H": 0.2, "T": 0.5, "e": 0.75, "M": 2.0, "S": 1.5, "n": 1.0}
_PHOTOGRAPHS = ((11368, 10.0), (33282, 5.0), (math.inf, 2.5))  # before 1890, before 1950, since
_CAMERAS = ("C", "c", "D", "B", "V")
_MODES = {"PHO": "P", "ENC": "e", "MIC": "M", "OCC": "E", "TRA": "T"}  # of ADES; all others are cameras
_GROUPS = {"o": "USNO-B", "s": "USNO-B", "t": "PPMXL", "U": "Gaia", "V": "Gaia", "W": "Gaia", "X": "Gaia"}
_GROUPS |= {"3": "Gaia", "6": "Gaia", "USNOB1": "USNO-B", "USNOB2": "USNO-B", "PPMXL": "PPMXL"}


def weighed(rows: Observations, told: Conventions) -> Observations:
    """Directions with the sigmas of the paper where they have none, times sqrt(N/4) where a night has N > 4 of a station."""
    directions = rows.of_kind("right_ascension", "declination")
    if not (directions & np.isnan(rows.sigma)).any():
        return rows
    known: dict[tuple[str, ...], float] = {}
    arcseconds = np.full(len(rows), np.nan)
    index = np.flatnonzero(directions)
    days = (rows.epoch.whole + rows.t[index]) / 86400.0 + _J2000
    for i, day in zip(index.tolist(), days.tolist(), strict=True):
        station = rows.participants[rows.station[i]] if rows.station[i] >= 0 else ""
        arcseconds[i] = _usual(station, day, _technique(rows, i), str(rows.extra["catalogue"][i]), known)
    number = _in_night(rows, index)
    crowded = number > FULL
    arcseconds[index] *= np.sqrt(np.maximum(number / FULL, 1.0))
    least, greatest = (f"{value:.3g}" for value in (arcseconds[index].min(), arcseconds[index].max()))
    what = f"sigmas of directions: {least} to {greatest} arcsec by station, date, technique and catalogue (Veres et al. 2017)"
    if crowded.any():
        what += ", with less weight where a station has more than four rows in a night"
    return with_usual_sigmas(rows, told, arcseconds * _ARCSECOND, what)


def _technique(rows: Observations, row: int) -> str:
    """The letter of the technique; of ADES by its mode."""
    if "technique" in rows.extra:
        return str(rows.extra["technique"][row])
    if rows.place[row] >= 0 and str(rows.extra["place_axes"][row]) == "GCRF":
        return "S"
    return _MODES.get(str(rows.extra["mode"][row]), "C")


def _usual(station: str, day: float, technique: str, catalogue: str, known: dict[tuple[str, ...], float]) -> float:
    """Arcseconds of one row."""
    if technique in (*_CAMERAS, "S"):
        if station in _BY_DATE:
            change, before, since = _BY_DATE[station]
            return before if day < change else since
        if station in _BY_STATION:
            return _BY_STATION[station]
    if technique in _CAMERAS:
        group = "Gaia" if catalogue.startswith("Gaia") else _GROUPS.get(catalogue, "")
        usual = _UNKNOWN if catalogue in ("", "UNK") else _KNOWN
        return _BY_CATALOGUE.get(station, {}).get(group, usual)
    if technique in _BY_TECHNIQUE:
        return _BY_TECHNIQUE[technique]
    return next(value for end, value in _PHOTOGRAPHS if day < end)


def _in_night(rows: Observations, index: Array) -> Array:
    """How many directions a station has of an object in the night of each of these rows."""
    keys = np.stack([rows.station[index], rows.object[index], rows.kind[index]])
    order = np.lexsort([rows.t[index], *keys])
    t = rows.t[index][order]
    new = np.append(True, (np.diff(t) > NIGHT) | (np.diff(keys[:, order], axis=1) != 0).any(axis=0))
    begins = np.maximum.accumulate(np.where(new, np.arange(len(t)), 0))
    new |= np.append(False, np.diff(np.floor((t - t[begins]) / 86400.0)) > 0)  # of those in space, whose night has no end
    group = np.cumsum(new) - 1
    out = np.empty(len(index))
    out[order] = np.bincount(group)[group]
    return out


def settled(rows: Observations, told: Conventions) -> Observations:
    """Astrometry as it is used: weighed, and free of the biases of star catalogues where a file of them is named."""
    rows = weighed(rows, told)
    if not rows.of_kind("right_ascension").any():
        return rows
    file = told.option("debias")
    if file is None:
        text = "biases of star catalogues are not taken off (--debias bias.dat, of Eggl et al. 2020, does)"
        return replace(rows, assumed=(*rows.assumed, text))
    from piazzi.formats.catalogue_bias import debiased

    return debiased(rows, file)
