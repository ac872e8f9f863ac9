"""Where a fit begins: elements or a state as text, a file of orbits, an earlier determination, or the fixes themselves."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from piazzi.determination.centres import centre_of
from piazzi.determination.words import date, pairs, quantity
from piazzi.earth import Epoch, transform
from piazzi.earth.rotation import frame_named
from piazzi.earth.subdaily import WITHIN_THE_DAY
from piazzi.formats import Arc, Ephemeris, read_ephemeris
from piazzi.formats.ephemeris import MeanElements
from piazzi.opening import opened
from piazzi.orbit import Keplerian, orbit_axes, sgp4_states
from piazzi.orbit.interpolation import interpolated
from piazzi.problem.checks import Array

SCHEMA = "piazzi.determine/1"
ELEMENTS = ("a", "e", "i", "raan", "argp")
ANOMALIES = {"nu": "true", "E": "eccentric", "M": "mean"}
CARTESIAN = {"x": "m", "y": "m", "z": "m", "vx": "m/s", "vy": "m/s", "vz": "m/s"}
EXAMPLE = "a=7078km e=0.001 i=98.2deg raan=10deg argp=0deg nu=0deg epoch=2026-11-03T04:12:00Z frame=GCRF"
LARGEST = 2**24  # bytes of an earlier determination


@dataclass(frozen=True, eq=False)
class Guess:
    """A state to begin from: position (3,) m and velocity (3,) m/s on the axes of the GCRF at an instant.

    `source` says where it came from, `assumed` what was taken where nothing was said, `orbits` what else fits, `about` what it
    goes about.
    """

    epoch: Epoch
    position: Array
    velocity: Array
    source: str
    assumed: tuple[str, ...] = ()
    orbits: Any = None
    about: str = "earth"

    def __post_init__(self) -> None:
        for name in ("position", "velocity"):
            values = np.array(getattr(self, name), dtype=float)
            if values.shape != (3,) or not np.isfinite(values).all():
                raise ValueError(f"{self.source}: {name} is {values.tolist()}; it must be three finite numbers")
            values.setflags(write=False)
            object.__setattr__(self, name, values)
        distance = float(np.linalg.norm(self.position))
        centre = centre_of(self.about)
        if not centre.nearest < distance < centre.farthest:
            raise ValueError(
                f"{self.source}: it is {distance / 1e3:,.0f} km from the centre of the {self.about.title()}, "
                "which is no orbit about it"
            )
        if float(np.linalg.norm(np.cross(self.position, self.velocity))) < 1e-3 * distance:
            raise ValueError(f"{self.source}: it moves along a straight line through the centre of the {self.about.title()}")

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self.epoch, self.position, self.velocity, self.source, self.assumed, self.orbits, self.about)

    @property
    def state(self) -> Array:
        """Position and velocity, (6,)."""
        return np.concatenate([self.position, self.velocity])


def guess_of(given: Any, near: Epoch, chosen: str | None = None, about: str = "earth", where: str = "--guess") -> Guess:
    """The guess that a user gives: text, a path, a `Guess`, an ephemeris, or what has a ``to_dict`` of a determination.

    Parameters
    ----------
    given : see above
    near : the first measurement; of a file with many states the one there, or the nearest
    chosen : name of the object in a file of several
    about : what elements and states of text are about
    where : what messages call the text

    Raises
    ------
    ValueError
        With what is wrong.
    OSError
        Where a file cannot be read.
    """
    if isinstance(given, Guess):
        return given
    if hasattr(given, "to_dict"):
        given = given.to_dict()
    if isinstance(given, Mapping):
        return _of_determination(given, "guess")
    if isinstance(given, (Ephemeris, Arc, MeanElements)):
        return _of_orbit(given, near, chosen, "guess", about)
    text = os.fspath(given)
    return _of_text(text, about, where) if "=" in text and not os.path.exists(text) else _of_file(text, near, chosen, about)


def _of_text(text: str, about: str, where: str) -> Guess:
    known = (*ELEMENTS, *ANOMALIES, *CARTESIAN, "epoch", "frame")
    found = pairs(text, where, known, f'"{EXAMPLE}"')
    cartesian, elements = [n for n in CARTESIAN if n in found], [n for n in (*ELEMENTS, *ANOMALIES) if n in found]
    if cartesian and elements:
        raise ValueError(f"{where} has both {cartesian[0]} and {elements[0]}: give a state or elements, not both")
    if "epoch" not in found:
        raise ValueError(f"{where}: of which date is it? Add such as epoch=2026-11-03T04:12:00Z")
    epoch = date(found["epoch"], f"{where}: epoch")
    frame = frame_named(found.get("frame", "GCRF"))
    if cartesian:
        _complete(cartesian, tuple(CARTESIAN), where)
        values = np.array([quantity(found[n], unit, f"{where}: {n}") for n, unit in CARTESIAN.items()])
        r, v = values[:3], values[3:]
    else:
        r, v = _of_elements(found, centre_of(about).mu, where)
    who = "the guess" if where == "--guess" else where
    assumed = () if "frame" in found else (f"{who} is in the {centre_of(about).frame} (frame=...)",)
    r, turned = transform(r, v, frame, "GCRF", epoch, WITHIN_THE_DAY)
    return Guess(epoch, r, np.asarray(turned), where, assumed, about=about)


def _of_elements(found: Mapping[str, str], mu: float, where: str) -> tuple[Array, Array]:
    _complete([n for n in ELEMENTS if n in found], ELEMENTS, where)
    anomalies = [n for n in ANOMALIES if n in found]
    if len(anomalies) != 1:
        raise ValueError(f"{where} has {' and '.join(anomalies) or 'no anomaly'}: give one of nu, E and M")
    units = ("m", "", "deg", "deg", "deg", "deg")
    values = [quantity(found[n], u, f"{where}: {n}") for n, u in zip((*ELEMENTS, anomalies[0]), units, strict=True)]
    try:
        return Keplerian(anomaly=ANOMALIES[anomalies[0]]).to_state(np.array(values), mu)
    except ValueError as error:
        raise ValueError(f"{where} is no orbit: {error}") from None


def _complete(have: list[str], wanted: tuple[str, ...], where: str) -> None:
    missing = [n for n in wanted if n not in have]
    if missing:
        raise ValueError(f'{where} has no {", ".join(missing)}: write such as "{EXAMPLE}"')


def _of_file(path: str, near: Epoch, chosen: str | None, about: str) -> Guess:
    with opened(path) as file:
        start = file.read(512)
        if start.lstrip().startswith(b"{"):
            return _of_determination(_json(start + file.read(LARGEST), path), path)
    return _of_orbit(read_ephemeris(path), near, chosen, path, about)


def _json(content: bytes, path: str) -> Mapping[str, Any]:
    try:
        found = json.loads(content)
    except (ValueError, RecursionError) as error:
        raise ValueError(f"{path}: no JSON of a determination: {one_error(error)}") from None
    return found if isinstance(found, dict) else {}


def one_error(error: BaseException) -> str:
    """What an error says, on one line."""
    return " ".join(str(error).split()) or type(error).__name__


def _of_determination(found: Mapping[str, Any], path: str) -> Guess:
    if found.get("schema") != SCHEMA:
        raise ValueError(f"{path}: the schema is {str(found.get('schema'))[:60]!r}, not {SCHEMA!r}: a guess is an orbit")
    try:
        epoch, frame = date(str(found["epoch"]), f"{path}: epoch"), frame_named(str(found["frame"]))
        names = [str(n) for n in found["names"]]
        mean = np.array([float(found["mean"][names.index(n)]) for n in CARTESIAN])
    except (KeyError, TypeError, ValueError, IndexError) as error:
        raise ValueError(f"{path}: the determination has no state: {one_error(error)}") from None
    r, v = transform(mean[:3], mean[3:], frame, "GCRF", epoch, WITHIN_THE_DAY)
    return Guess(epoch, r, np.asarray(v), path, about=str(found.get("about", "earth")))


def _of_orbit(orbit: Any, near: Epoch, chosen: str | None, path: str, about: str) -> Guess:
    if isinstance(orbit, MeanElements):
        return _of_mean(orbit, near, path)
    arcs: tuple[Arc, ...] = (orbit,) if isinstance(orbit, Arc) else _arcs(orbit, chosen, path)
    if not arcs:
        mean = [m for m in orbit.mean if chosen in (None, m.name, m.identifier)]
        return _of_mean(min(mean, key=lambda m: abs(m.epoch - near)), near, path)
    arc = min(arcs, key=lambda one: _away(one, near))
    if arc.centre not in (None, about.upper()):
        raise ValueError(f"{path}: positions of {arc.called} are about {arc.centre}, not the {about.title()}")
    if arc.frame is None:
        raise ValueError(f"{path}: the file does not say in which axes its positions are")
    kept = np.isfinite(arc.position).all(axis=1)
    t, order = np.unique(arc.t[kept], return_index=True)
    if not len(t):
        raise ValueError(f"{path}: there is no position of {arc.called} in it")
    at = float(np.clip(near - arc.epoch, t[0], t[-1]))
    r, v = arc.position[kept][order], arc.velocity[kept][order]
    known = bool(np.isfinite(v).all())
    if len(t) == 1:
        if not known:
            raise ValueError(f"{path}: one position without a velocity is no orbit")
        position, velocity = r[0], v[0]
    else:
        found = interpolated(t, r, v if known else None, np.array([at]), arc.degree)
        position, velocity = found.r[0], found.v[0]
    epoch = arc.epoch + at
    turned = transform(position, velocity, arc.frame, "GCRF", arc.frame_epoch or epoch, WITHIN_THE_DAY)
    return Guess(epoch, turned[0], np.asarray(turned[1]), path, about=about)


def _arcs(found: Ephemeris, chosen: str | None, path: str) -> tuple[Arc, ...]:
    objects = found.objects
    if chosen is not None:
        arcs = found.of(chosen)
        if not arcs and not any(chosen in (m.name, m.identifier) for m in found.mean):
            if len(objects) > 1:
                raise ValueError(f"{path} has no {chosen}; it has {_listed(objects)}")
            return found.arcs
        return arcs
    if len(objects) > 1:
        raise ValueError(f"{path} has {_listed(objects)}: say which one with --object")
    return found.arcs


def _listed(names: tuple[str, ...]) -> str:
    more = f" and {len(names) - 8} more" if len(names) > 8 else ""
    return f"{len(names)} objects, {', '.join(names[:8])}{more}"


def _away(arc: Arc, near: Epoch) -> float:
    t = near - arc.epoch
    return max(float(arc.t.min()) - t, t - float(arc.t.max()), 0.0) if len(arc) else np.inf


def _of_mean(mean: MeanElements, near: Epoch, path: str) -> Guess:
    """By the theory at the first measurement; a covariance is none of these elements'."""
    r, v = sgp4_states(mean, near, "GCRF")
    return Guess(near, r, v, path)


def from_fixes(epoch: Epoch, t: Array, position: Array) -> Guess | None:
    """The guess that fixes give by themselves: a polynomial through the first of them, (N,) s and (N, 3) m in the GCRF.

    None where they are too few, or too far apart, for one.
    """
    t, first = np.unique(t, return_index=True)
    position = position[first]
    if len(t) < 3:
        return None
    angle = np.arccos(np.clip(_cosines(position), -1.0, 1.0))
    near = np.flatnonzero(angle < 0.8)
    if not len(near) or angle[near[0]] >= 0.8 or near[0] + 1 >= len(t):
        return None
    k = int(near[0])
    stop = k + 1
    while stop < min(k + 9, len(t)) and angle[stop - 1] < 0.8:
        stop += 1
    at = t[k:stop]
    if len(at) < 3:
        return None
    middle = len(at) // 2
    velocity = interpolated(at, position[k:stop], None, at[middle : middle + 1], len(at) - 1).v[0]
    place = position[k + middle]
    orbit_axes(place, velocity)
    return Guess(epoch + float(at[middle]), place, velocity, "the fixes")


def _cosines(position: Array) -> Array:
    unit = position / np.linalg.norm(position, axis=1)[:, None]
    return np.asarray(np.sum(unit[1:] * unit[:-1], axis=1))


def is_file(given: Any) -> bool:
    """Whether a guess names a file."""
    return isinstance(given, (str, Path)) and not ("=" in str(given) and not os.path.exists(given))
