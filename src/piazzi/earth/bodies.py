"""Sun, Moon and planets: positions and velocities on the axes of the GCRF, by series or from a JPL kernel.

The series are those of ERFA: Earth and Sun by `epv00` (VSOP2000), the Moon by `moon98` (Meeus 1998), the planets by `plan94`
(Simon et al. 1994).  The guide to bodies and tides says how far they are off; a kernel is a file of the user's.
"""

from __future__ import annotations

import struct
import warnings
from collections.abc import Iterable
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from piazzi.arrays import Array
from piazzi.earth import scales
from piazzi.earth.epoch import Epoch, pairs
from piazzi.earth.finding import check_kernel
from piazzi.text import nearest


class EphemerisWarning(UserWarning):
    """Bodies are where a series has them, which is not near enough for everything."""


AU = 149597870700.0  # m, IAU 2012 resolution B2
_PLANETS = {"mercury": 1, "venus": 2, "mars": 4, "jupiter": 5, "saturn": 6, "uranus": 7, "neptune": 8}
# numbers of NAIF; of planets with moons, that of the barycentre, which kernels have
_NAIF = {"sun": 10, "moon": 301, "earth": 399, **_PLANETS, "pluto": 9}
BODIES = tuple(_NAIF)
# km, the most from 1960 to 2050 against DE440; of planets and the Earth from the Sun, of the Moon from the Earth
SERIES_ERROR = {
    "mercury": 1144, "venus": 3174, "earth": 11, "moon": 29, "mars": 26825, "jupiter": 172458, "saturn": 535849,
    "uranus": 960113, "neptune": 250583,
}  # fmt: skip
_MINOR = 2000000  # and the number of a minor planet
# what jplephem raises over a damaged file, besides ValueError
_DAMAGED = (ValueError, IndexError, KeyError, TypeError, OverflowError, MemoryError, AssertionError, struct.error)


def body(
    name: str, epoch: Epoch | Iterable[Epoch], center: str = "earth", kernel: str | Path | None = None
) -> tuple[Array, Array]:
    """Where a body is seen from another, at one instant or at K of them, without light time.

    Parameters
    ----------
    name : sun, moon, earth, or a planet (with its moons: their barycentre); pluto in kernels only
    epoch : the instant, or K of them
    center : the body that it is seen from
    kernel : a binary SPK file of JPL, such as DE440, for which the extra ``jpl`` is needed; default the series

    Returns
    -------
    position : (3,) or (K, 3), m, on the axes of the GCRF
    velocity : (3,) or (K, 3), m/s

    Raises
    ------
    ValueError
        Where a body is not known, or the kernel does not have it or the date; its span is said.
    """
    for known in (name, center):
        if known not in _NAIF:
            raise ValueError(f"body {known!r} is not known{nearest(known, BODIES)}")
    whole, fraction = pairs(epoch)
    if name == center:
        return np.zeros((*whole.shape, 3)), np.zeros((*whole.shape, 3))
    tdb = scales.days(*scales.normalized(whole, fraction - scales.offset("TDB", whole, fraction)))
    if kernel is not None:
        there, here = (_from_kernel(Path(kernel), _NAIF[known], *tdb) for known in (name, center))
    else:
        there, here = (_by_series(known, *tdb) for known in (name, center))
        if "moon" in (name, center) and "earth" in (name, center):  # no detour by the Sun, which would cost digits
            there, here = (_moon(*tdb) if known == "moon" else 0.0 * there for known in (name, center))
    return there[..., 0, :] - here[..., 0, :], there[..., 1, :] - here[..., 1, :]


def asteroid(number: int, epoch: Epoch | Iterable[Epoch], kernel: str | Path) -> Array:
    """Position of a minor planet from the Sun, (3,) or (K, 3), m on the axes of the ICRF; `kernel` is one of JPL that has it.

    Raises ValueError where it does not have the body or the date.
    """
    whole, fraction = pairs(epoch)
    tdb = scales.days(*scales.normalized(whole, fraction - scales.offset("TDB", whole, fraction)))
    return np.asarray(_from_kernel(Path(kernel), _MINOR + number, *tdb, root=_NAIF["sun"])[..., 0, :])


def _by_series(name: str, one: Array, two: Array) -> Array:
    """Position (m) and velocity (m/s), (..., 2, 3), from the Sun."""
    import erfa

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", erfa.ErfaWarning)  # "date outside 1900-2100": the error is stated in the guide
        if name == "sun":
            return np.zeros((*np.shape(one + two), 2, 3))
        if name in ("earth", "moon"):
            earth = _metres(erfa.epv00(one, two)[0])
            return earth + _moon(one, two) if name == "moon" else earth
        if name not in _PLANETS:
            raise ValueError(f"{name} has no series; give a JPL kernel that has it")
        bias = erfa.bp06(2451545.0, 0.0)[0]  # GCRF to EME2000, on whose axes the series are
        return np.asarray(_metres(erfa.plan94(one, two, _PLANETS[name])) @ bias)


def _moon(one: Array, two: Array) -> Array:
    import erfa

    return _metres(erfa.moon98(one, two))


def _metres(pv: Any) -> Array:
    """Astronomical units, and those per day, in m and m/s."""
    return np.stack([np.asarray(pv["p"]) * AU, np.asarray(pv["v"]) * (AU / scales.DAY)], -2)


def _from_kernel(path: Path, target: int, one: Array, two: Array, root: int = 0) -> Array:
    """Position (m) and velocity (m/s), (..., 2, 3), from the barycentre of the solar system: a sum over links of the kernel."""
    total = np.zeros((*np.shape(one + two), 2, 3))
    while target != root:
        links = [link for link in _segments(path) if link.target == target]
        if not links:
            raise ValueError(f"{path.name} has no body {_name(target)}; it has {_contents(path)}")
        held = np.zeros(np.shape(one + two), dtype=bool)
        state = np.zeros((*held.shape, 2, 3))
        for link in links:
            inside = (one + two >= link.start_jd) & (one + two <= link.end_jd) & ~held
            if np.any(inside) and link.center == links[0].center:
                try:
                    p, v = link.compute_and_differentiate(np.asarray(one)[inside], np.asarray(two)[inside])
                except _DAMAGED as error:
                    raise ValueError(f"{path.name}: {_name(target)} cannot be read: {error}") from None
                state[inside] = np.stack([p.T * 1e3, v.T * (1e3 / scales.DAY)], -2)
                held |= inside
        if not np.all(held):
            raise ValueError(_outside(path, target, links, float((one + two)[~held].flat[0])))
        total, target = total + state, int(links[0].center)
    return total


def _outside(path: Path, target: int, links: list[Any], wanted: float) -> str:
    first, last = min(link.start_jd for link in links), max(link.end_jd for link in links)
    dates = [Epoch.from_jd(jd, 0.0, "TDB").to("TDB", digits=0) for jd in (wanted, first, last)]
    return f"{path.name} has {_name(target)} from {dates[1]} to {dates[2]}, not at {dates[0]}"


def _name(target: int) -> str:
    names = {number: name for name, number in _NAIF.items()}
    return names.get(target, str(target))


def _contents(path: Path) -> str:
    return ", ".join(sorted({_name(int(link.target)) for link in _segments(path)}))


def _segments(path: Path) -> list[Any]:
    try:
        return kernel_segments(path)
    except ModuleNotFoundError:
        raise ValueError("reading a JPL kernel needs jplephem: pip install 'piazzi[jpl]'") from None


def kernel_segments(path: Path) -> list[Any]:
    """Segments of a binary SPK file; raises ValueError for another file, ModuleNotFoundError without jplephem."""
    import jplephem  # noqa: F401

    try:
        return _opened(path, path.stat().st_mtime_ns)
    except _DAMAGED as error:
        raise ValueError(
            f"{path.name} cannot be read as a binary SPK kernel of JPL: {str(error) or type(error).__name__}"
        ) from None


@lru_cache(maxsize=8)
def _opened(path: Path, changed: int) -> list[Any]:
    from jplephem.spk import SPK

    check_kernel(path)  # jplephem would go in circles
    return list(SPK.open(str(path)).segments)
