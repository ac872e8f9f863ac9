"""Biases of star catalogues, taken off directions that were measured against them.

Source: Eggl, Farnocchia, Chamberlin and Chesley, Star catalog position and proper motion corrections in asteroid astrometry II,
Icarus 339 (2020) 113596: file ``bias.dat``.  A line is a pixel of a HEALPix map in the order of rings (Gorski et al., ApJ 622
(2005) 759); four numbers of each catalogue are dRA cos(Dec) and dDec at J2000 in arcsec, and their rates in mas a year.
"""

from __future__ import annotations

import math
import os
import re
from dataclasses import replace

import numpy as np

from piazzi.arrays import Array
from piazzi.formats.observations import Observations
from piazzi.formats.source import read_bytes

CATALOGUES = tuple("abcdegijlmnopqrtuvwLNQRSUY")  # of the file, by the Minor Planet Center's letters
_ADES = {
    "USNOA1": "a", "USNOSA1": "b", "USNOA2": "c", "USNOSA2": "d", "UCAC1": "e", "Tyc2": "g", "GSC1.1": "i", "GSC1.2": "j",
    "ACT": "l", "GSCACT": "m", "SDSS8": "n", "USNOB1": "o", "PPM": "p", "UCAC4": "q", "UCAC2": "r", "PPMXL": "t", "UCAC3": "u",
    "NOMAD": "v", "CMC14": "w", "2MASS": "L", "SDSS7": "N", "CMC15": "Q", "SSTRC4": "R", "URAT1": "S", "Gaia1": "U",
    "UCAC5": "Y",
}  # fmt: skip
_ARCSECOND = math.pi / 648000.0
_YEAR = 31557600.0  # s


def debiased(rows: Observations, path: str | os.PathLike[str]) -> Observations:
    """Directions less the bias of their catalogue there and then; those of catalogues that the file does not have stay.

    Raises
    ------
    OSError
        Where the file cannot be read.
    ValueError
        With file and line, for one that is no such table.
    """
    name = os.fspath(path)
    sides, first, lines = _table(read_bytes(path), name)
    codes = np.array([_ADES.get(str(text), str(text)) for text in rows.extra["catalogue"]])
    declination, ascension = _partners(rows)
    mine = np.flatnonzero((declination >= 0) & np.isin(codes, CATALOGUES))
    value = rows.value.copy()
    pixels = pixel_of(sides, rows.value[ascension[mine]], rows.value[declination[mine]])
    known: dict[int, Array] = {}
    years = (rows.epoch.whole + rows.t) / _YEAR
    for i, pixel in zip(mine.tolist(), pixels.tolist(), strict=True):
        if pixel not in known:
            known[pixel] = _numbers(lines[first + pixel], name, first + pixel + 1)
        bias = known[pixel][4 * CATALOGUES.index(codes[i]) :][:4]
        east, north = _ARCSECOND * (bias[:2] + 1e-3 * years[i] * bias[2:])
        value[i] -= east / math.cos(rows.value[declination[i]]) if ascension[i] == i else north
    all_, done = int(np.count_nonzero(declination >= 0)), len(mine)
    text = f"biases of star catalogues are taken off {done // 2} of {all_ // 2} directions ({os.path.basename(name)})"
    return replace(rows, value=value, assumed=(*rows.assumed, text))


def _partners(rows: Observations) -> tuple[Array, Array]:
    """For each row of a direction the rows of its declination and its right ascension, -1 where there is none."""
    right = np.flatnonzero(rows.of_kind("right_ascension")[:-1] & rows.of_kind("declination")[1:])
    declination, ascension = np.full(len(rows), -1), np.full(len(rows), -1)
    declination[right] = declination[right + 1] = right + 1
    ascension[right] = ascension[right + 1] = right
    return declination, ascension


def _table(data: bytes, name: str) -> tuple[int, int, list[bytes]]:
    """Pixels along a side, the index of the first line of numbers, and all lines."""
    lines = data.rstrip().split(b"\n")
    first = next((i for i, line in enumerate(lines) if not line.startswith(b"!")), len(lines))
    match = re.search(rb"NSIDE\s*=\s*(\d{1,5})", b"\n".join(lines[:first]))
    sides = int(match[1]) if match else 0
    if not sides or sides & (sides - 1):
        raise ValueError(f"{name}: line 1: no line of the head says NSIDE=, a power of two: this is no table of biases")
    if len(lines) - first != 12 * sides**2:
        raise ValueError(f"{name}: there are {len(lines) - first} lines of pixels; NSIDE={sides} has {12 * sides**2}")
    return sides, first, lines


def _numbers(line: bytes, name: str, number: int) -> Array:
    try:
        found = np.array([float(word) for word in line.split()])
    except ValueError:
        raise ValueError(f"{name}: line {number}: there is a word that is no number") from None
    if len(found) != 4 * len(CATALOGUES) or not np.isfinite(found).all():
        raise ValueError(f"{name}: line {number}: there are {len(found)} numbers; 26 catalogues have {4 * len(CATALOGUES)}")
    return found


def pixel_of(sides: int, longitude: Array, latitude: Array) -> Array:
    """Pixels (K,) of directions on a HEALPix map with so many pixels along a side, in the order of rings."""
    z = np.sin(latitude)
    turn = np.mod(longitude, 2.0 * math.pi) / (0.5 * math.pi)  # quarters, 0 to 4
    return np.asarray(np.where(np.abs(z) <= 2.0 / 3.0, _belt(sides, z, turn), _cap(sides, z, turn)))


def _belt(sides: int, z: Array, turn: Array) -> Array:
    """Pixels between the caps, by the lines that rise and fall through a place."""
    rising = np.floor(sides * (0.5 + turn - 0.75 * z)).astype(np.int64)
    falling = np.floor(sides * (0.5 + turn + 0.75 * z)).astype(np.int64)
    ring = sides + 1 + rising - falling  # from the northernmost of the belt
    shift = 1 - ring % 2
    along = np.mod((rising + falling - sides + shift + 1) // 2, 4 * sides)
    return np.asarray(2 * sides * (sides - 1) + (ring - 1) * 4 * sides + along)


def _cap(sides: int, z: Array, turn: Array) -> Array:
    """Pixels about a pole, where a ring has four pixels more than the one before."""
    part = turn - np.floor(turn)
    reach = sides * np.sqrt(3.0 * (1.0 - np.abs(z)))
    rising, falling = np.floor(part * reach).astype(np.int64), np.floor((1.0 - part) * reach).astype(np.int64)
    ring = rising + falling + 1
    along = np.minimum(np.floor(turn * ring).astype(np.int64), 4 * ring - 1)
    north = 2 * ring * (ring - 1) + along
    return np.asarray(np.where(z > 0, north, 12 * sides**2 - 2 * ring * (ring + 1) + along))
