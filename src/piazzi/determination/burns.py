"""Manoeuvres as users and files give them: when, how much along which axes, for how long, and how far they may be off."""

from __future__ import annotations

import csv
import os
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np

from piazzi.determination.words import date, pairs, quantity
from piazzi.earth import Epoch
from piazzi.earth.rotation import TURNING, frame_named
from piazzi.opening import opened
from piazzi.text import nearest, one_line
from piazzi.units import positive_duration

ORBIT = {"RTN": "RTN", "RSW": "RTN", "RIC": "RTN", "QSW": "RTN", "TNW": "TNW"}
KEYS = ("dv", "axes", "sigma", "for", "engine")
EXAMPLE = "'2026-11-03T04:12:00Z dv=0,0.3,0m/s axes=RTN sigma=0.05m/s for=600s'"
SHARE, LEAST = 0.1, 0.01  # of its size, and m/s: how far a manoeuvre may be off of which nobody says it
UNPLANNED = 1.0  # m/s: likewise of one that nobody knows but the date of
LARGEST = 2**22  # bytes of a file of manoeuvres


@dataclass(frozen=True)
class Burn:
    """A manoeuvre.

    Parameters
    ----------
    epoch : of ignition; of an impulse its middle
    dv : (3,), m/s along the axes
    axes : RTN or TNW of the orbit, wherever it is, or an inertial frame
    sigma : (3,), m/s, of what is estimated of `dv`; zeros, where it is known
    scale : sigma of the thrust's scale, which is estimated in place of `dv` where this is not zero
    duration : s, 0 for an impulse
    engine : whose thrust has one scale in all its arcs; "" for a scale of its own
    assumed : whether nobody said how far it may be off
    """

    epoch: Epoch
    dv: tuple[float, float, float] = (0.0, 0.0, 0.0)
    axes: str = "RTN"
    sigma: tuple[float, float, float] = (UNPLANNED, UNPLANNED, UNPLANNED)
    scale: float = 0.0
    duration: float = 0.0
    engine: str = ""
    assumed: bool = False

    @property
    def size(self) -> float:
        """What it adds to the velocity, m/s."""
        return float(np.linalg.norm(self.dv))


def burns_of(given: Any) -> tuple[Burn, ...]:
    """Manoeuvres of text, files (CSV, OPM, OCM) and `Burn`s, in order of time.

    Raises
    ------
    OSError
        Where a file cannot be read.
    ValueError
        For what is wrong with them.
    """
    found: list[Burn] = []
    for one in [given] if isinstance(given, str | os.PathLike | Burn) else given or ():
        if isinstance(one, Burn):
            found.append(one)
        elif isinstance(one, str) and "=" in one:
            found += [_of_text(line) for line in one.splitlines() if line.strip()]
        elif isinstance(one, str | os.PathLike):
            found += _of_file(Path(one))
        else:
            raise ValueError(f"--manoeuvre: {one_line(repr(one), 60)} is neither text such as {EXAMPLE} nor a file")
    return tuple(sorted(found, key=lambda burn: (burn.epoch.whole, burn.epoch.fraction)))


def _of_text(text: str) -> Burn:
    when, _, rest = text.strip().partition(" ")
    try:
        return _burn(date(when, "date"), pairs(rest, "manoeuvre", KEYS, EXAMPLE))
    except ValueError as error:
        raise ValueError(f"--manoeuvre {one_line(text.strip(), 80)}: {error}") from None


def _burn(epoch: Epoch, said: Mapping[str, str]) -> Burn:
    """The manoeuvre of its words."""
    if "dv" not in said:
        raise ValueError(f"it has no dv: write such as {EXAMPLE}")
    dv = _three(said["dv"], "m/s", "dv")
    duration = positive_duration(said["for"], "for", plain=False) if "for" in said else 0.0
    return _judged(epoch, dv, axes_named(said.get("axes", "RTN")), duration, said.get("sigma"), said.get("engine", ""))


def _judged(epoch: Epoch, dv: Any, axes: str, duration: float, sigma: str | None, engine: str) -> Burn:
    """The manoeuvre, with what is estimated of it: a share is one of the thrust's scale, and usual for arcs."""
    size = float(np.linalg.norm(dv))
    zeros = (0.0, 0.0, 0.0)
    if sigma is None:
        if (duration or engine) and size:
            return Burn(epoch, dv, axes, zeros, SHARE, duration, engine, True)
        own = max(SHARE * size, LEAST) if size else UNPLANNED
        return Burn(epoch, dv, axes, (own, own, own), 0.0, duration, engine, True)
    if sigma.endswith("%"):
        share = 0.01 * quantity(sigma[:-1], "", "sigma")
        if not (share > 0 and size):
            raise ValueError(f"sigma is {sigma}; a share must be positive, of a dv that is not zero")
        return Burn(epoch, dv, axes, zeros, share, duration, engine)
    if engine:
        raise ValueError(f"engine={engine}: thrusts of an engine have one scale; write its sigma as a share, such as sigma=5%")
    spread = _three(sigma, "m/s", "sigma")
    if min(spread) < 0:
        raise ValueError(f"sigma is {sigma}; it must not be negative")
    return Burn(epoch, dv, axes, spread, 0.0, duration)


def _three(text: str, unit: str, what: str) -> tuple[float, float, float]:
    """Three numbers with one unit behind the last, or one for all of a sigma."""
    parts = text.split(",")
    joined = re.sub(r"^[-+\d.eE]+", "", parts[-1]) if parts else ""
    if len(parts) == 1 and what == "sigma":
        parts = parts * 3
    if len(parts) != 3:
        raise ValueError(f"{what} is {one_line(text, 60)!r}; write three numbers and their unit, such as {what}=0,0.3,0{unit}")
    a, b, c = (quantity(part if part.endswith(joined) else part + joined, unit, what) for part in parts)
    return a, b, c


def axes_named(text: str) -> str:
    """RTN or TNW, or the name of a frame that does not turn; raises ValueError for another."""
    name = text.upper().removesuffix("_INERTIAL").removesuffix("_ROTATING")
    if name in ORBIT:
        return ORBIT[name]
    try:
        frame = frame_named(text)
    except ValueError:
        raise ValueError(
            f"axes {one_line(text, 40)!r} are not known{nearest(name[:40], [*ORBIT, 'GCRF', 'EME2000'])}"
        ) from None
    if frame in TURNING:
        raise ValueError(f"axes {frame} turn with the Earth: give dv along RTN, TNW or an inertial frame")
    return frame


def _of_file(path: Path) -> list[Burn]:
    with opened(path) as file:
        data = file.read(LARGEST + 1)
    if len(data) > LARGEST:
        raise ValueError(f"{path}: a file of manoeuvres is not longer than {LARGEST} bytes")
    text = data.decode("utf-8", errors="replace")
    if "CCSDS_OCM_VERS" in text[:2000]:
        from piazzi.determination.burns_ocm import burns_of_ocm

        found = [_of_row(row, f"{path}, line {line}") for line, row in burns_of_ocm(text, str(path))]
    elif text.lstrip()[:1] == "<" or "CCSDS_" in text[:2000]:
        found = _of_ephemeris(path)
    else:
        found = list(_of_csv(text, path))
    if not found:
        raise ValueError(f"{path}: there is no manoeuvre in it")
    return found


def _of_ephemeris(path: Path) -> list[Burn]:
    """Manoeuvres of an OPM."""
    from piazzi.formats import read_ephemeris

    burns = [burn for arc in read_ephemeris(path).arcs for burn in arc.burns]
    return [_judged(b.epoch, b.delta_v, axes_named(b.frame), b.duration, None, "") for b in burns]


def _of_csv(text: str, path: Path) -> Iterable[Burn]:
    """Rows of a table with the columns time, dv (or dv_1, dv_2, dv_3), axes, sigma, for, engine."""
    reader = csv.DictReader(StringIO(text), skipinitialspace=True)
    known = ("time", *KEYS, "dv_1", "dv_2", "dv_3")
    for name in reader.fieldnames or ():
        if (name or "").strip() not in known:
            raise ValueError(f"{path}, line 1: unknown column {one_line(str(name), 40)!r}{nearest(str(name)[:40], known)}")
    for row in reader:
        yield _of_row(
            {key.strip(): value.strip() for key, value in row.items() if key and isinstance(value, str) and value.strip()},
            f"{path}, line {reader.line_num}",
        )


def _of_row(row: dict[str, str], where: str) -> Burn:
    try:
        if "time" not in row:
            raise ValueError("it has no time")
        parts = [row.pop(f"dv_{i}", "") for i in (1, 2, 3)]
        if all(parts):
            a, b, c = (quantity(part, "m/s", "dv") for part in parts)
            row["dv"] = f"{a!r},{b!r},{c!r}m/s"
        return _burn(date(row.pop("time"), "time"), row)
    except ValueError as error:
        raise ValueError(f"{where}: {error}") from None
