"""Delay of radio signals in the neutral atmosphere: at the zenith by Saastamoinen, mapped by Niell or by GMF."""

from __future__ import annotations

from functools import cache
from importlib.resources import files

import numpy as np

from piazzi.arrays import Array
from piazzi.earth.epoch import Epoch
from piazzi.earth.formula import Formula

saastamoinen = Formula(
    ("latitude", "height", "pressure", "temperature", "vapour"),
    {
        "hydrostatic": "2.2768e-5*pressure/(1 - 0.00266*cos(2*latitude) - 2.8e-7*height)",
        "wet": "2.277e-5*(1255/temperature + 0.05)*vapour",
    },
    ("hydrostatic", "wet"),
    "Saastamoinen 1972 as by Davis et al. 1985, Radio Science 20, 1593",
)
# Continued fractions of Marini in Herring's form; the correction for height is that of Niell 1996
mapping = Formula(
    ("elevation", "height", "ah", "bh", "ch", "aw", "bw", "cw"),
    {
        "s": "sin(elevation)",
        "dry": "(1 + ah/(1 + bh/(1 + ch)))/(s + ah/(s + bh/(s + ch)))",
        "raised": "1/s - (1 + 2.53e-5/(1 + 5.49e-3/(1 + 1.14e-3)))/(s + 2.53e-5/(s + 5.49e-3/(s + 1.14e-3)))",
        "map_hydrostatic": "dry + 1e-3*height*raised",
        "map_wet": "(1 + aw/(1 + bw/(1 + cw)))/(s + aw/(s + bw/(s + cw)))",
    },
    ("map_hydrostatic", "map_wet"),
    "Niell 1996, J. Geophys. Res. 101(B2), 3227",
)

# Niell 1996, tables 3 and 4, at latitudes 15, 30, 45, 60, 75: hydrostatic mean a, b, c; its yearly wave a, b, c; wet a, b, c
_LATITUDES = np.radians([15.0, 30.0, 45.0, 60.0, 75.0])
_NIELL = np.array([
    [1.2769934e-3, 1.2683230e-3, 1.2465397e-3, 1.2196049e-3, 1.2045996e-3],
    [2.9153695e-3, 2.9152299e-3, 2.9288445e-3, 2.9022565e-3, 2.9024912e-3],
    [62.610505e-3, 62.837393e-3, 63.721774e-3, 63.824265e-3, 64.258455e-3],
    [0.0, 1.2709626e-5, 2.6523662e-5, 3.4000452e-5, 4.1202191e-5],
    [0.0, 2.1414979e-5, 3.0160779e-5, 7.2562722e-5, 11.723375e-5],
    [0.0, 9.0128400e-5, 4.3497037e-5, 84.795348e-5, 170.37206e-5],
    [5.8021897e-4, 5.6794847e-4, 5.8118019e-4, 5.9727542e-4, 6.1641693e-4],
    [1.4275268e-3, 1.5138625e-3, 1.4572752e-3, 1.5007428e-3, 1.7599082e-3],
    [4.3472961e-2, 4.6729510e-2, 4.3908931e-2, 4.4626982e-2, 5.4736038e-2],
])  # fmt: skip


def niell_coefficients(latitude: float, epoch: Epoch) -> dict[str, float]:
    """Coefficients ah, bh, ch, aw, bw, cw of `mapping` at a latitude (rad) and a date; Niell 1996."""
    at = [float(np.interp(abs(latitude), _LATITUDES, row)) for row in _NIELL]
    wave = np.cos(_phase(epoch) + (np.pi if latitude < 0.0 else 0.0))
    a, b, c = (float(mean - swing * wave) for mean, swing in zip(at[:3], at[3:6], strict=True))
    return {"ah": a, "bh": b, "ch": c, "aw": at[6], "bw": at[7], "cw": at[8]}


def gmf_coefficients(latitude: float, longitude: float, epoch: Epoch) -> dict[str, float]:
    """Coefficients ah, bh, ch, aw, bw, cw of `mapping` at a place (rad) and a date; Boehm et al. 2006, GRL 33, L07304."""
    waves = _harmonics(latitude, longitude)
    table = _gmf_table()
    ah, ah_swing, aw, aw_swing = (float(waves @ table[2 * i : 2 * i + 2].ravel()) * 1e-5 for i in range(4))
    yearly = float(np.cos(_phase(epoch)))
    turn, swing, least = (np.pi, 0.007, 0.002) if latitude < 0.0 else (0.0, 0.005, 0.001)
    ch = 0.062 + ((np.cos(_phase(epoch) + turn) + 1.0) * swing / 2.0 + least) * (1.0 - np.cos(latitude))
    return {
        "ah": ah + ah_swing * yearly,
        "bh": 0.0029,
        "ch": float(ch),
        "aw": aw + aw_swing * yearly,
        "bw": 0.00146,
        "cw": 0.04391,
    }


def _phase(epoch: Epoch) -> float:
    """The season: 2 pi a year, zero on 28 January."""
    mjd = sum(epoch.jd("TT")) - 2400000.5
    return float(2.0 * np.pi * (mjd - 44239.0 + 1.0 - 28.0) / 365.25)


def _harmonics(latitude: float, longitude: float) -> Array:
    """P_nm(sin latitude) cos m longitude, then with sin, to degree 9 by degree and order; Legendre functions not normalised."""
    sine, cosine = np.sin(latitude), np.cos(latitude)
    p = np.zeros((10, 10))
    p[0, 0] = 1.0
    for n in range(1, 10):
        p[n, n] = (2 * n - 1) * cosine * p[n - 1, n - 1]
        for m in range(n):
            below = p[n - 2, m] if n > 1 else 0.0
            p[n, m] = ((2 * n - 1) * sine * p[n - 1, m] - (n + m - 1) * below) / (n - m)
    rows, columns = np.tril_indices(10)
    values, turns = p[rows, columns], columns * longitude
    return np.concatenate([values * np.cos(turns), values * np.sin(turns)])


@cache
def _gmf_table() -> Array:
    """Cosine and sine coefficients, in turn, of the mean and the yearly wave of ah, then of aw: (8, 55), in 1e-5."""
    text = files("piazzi.earth").joinpath("data", "gmf.txt").read_text(encoding="utf-8")
    rows = [[float(cell) for cell in row.split()] for row in text.splitlines() if not row.startswith("#")]
    return np.array(rows).T
