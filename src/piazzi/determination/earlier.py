"""Yesterday's orbit: what was known before tonight's measurements, and which of them it has used already."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from piazzi.determination.guesses import SCHEMA, Guess
from piazzi.determination.physical import DENSITY, is_node
from piazzi.determination.words import date
from piazzi.earth import Epoch
from piazzi.earth.rotation import frame_named
from piazzi.formats import Observations
from piazzi.io import hdf5
from piazzi.opening import opened
from piazzi.orbit.axes import in_axes
from piazzi.orbit.starting import start_of
from piazzi.problem.checks import Array

AIR_THEN = "density"  # the name of the air's density at the epoch
SAME_TIME = 1.0  # s
STATES = ("x", "y", "z", "vx", "vy", "vz")
LARGEST = 2**26  # bytes of a determination
HEADER = 2**14  # bytes of a message that comments stand in
MADE_OF = "Measurements from {} to {}."  # the comment of OEM and OPM that says what was used
_MADE_OF = re.compile(r"^COMMENT Measurements from (\S+ [A-Z0-9]+) to (\S+ [A-Z0-9]+)\.\r?$", re.MULTILINE | re.ASCII)


@dataclass(frozen=True, eq=False)
class Earlier:
    """An orbit with its covariance.

    Attributes
    ----------
    epoch : of the state
    names : of the values, position and velocity first; what stays is told by names of results, which say of what it is, as
        is `density`, that of the air at the epoch
    mean, covariance : (n,) and (n, n), position and velocity in the GCRF
    used : first and last measurement that it was made of, None where nobody says it
    source : its file
    assumed : what was assumed of it
    about : what it goes about
    """

    epoch: Epoch
    mean: Array
    covariance: Array
    source: str
    names: tuple[str, ...] = STATES
    used: tuple[Epoch, Epoch] | None = None
    assumed: tuple[str, ...] = ()
    about: str = "earth"

    @property
    def guess(self) -> Guess:
        """Where to begin."""
        return Guess(self.epoch, self.mean[:3], self.mean[3:6], self.source, about=self.about)

    def place(self, name: str, t: float, first: float) -> int | None:
        """Index of a value by its name in results, None where it is not known; `t` is its epoch, `first` the first row (s).

        Of the air the first node has what was known of it, where it stands at the epoch.
        """
        if is_node(name, DENSITY):
            name = AIR_THEN if name == f"{DENSITY}1" and t <= first else ""
        return self.names.index(name) if name in self.names else None


def earlier_of(given: Any, near: Epoch, chosen: str | None = None) -> Earlier:
    """The orbit of ``--prior``.

    Parameters
    ----------
    given : a determination, its JSON or .nc; an OEM, OPM or OCM with covariances, two-line elements, or an `Ephemeris` of one
    near : the first measurement; of many states with a covariance the one that is nearest
    chosen : name of the object, in a file of several

    Raises
    ------
    ValueError
        For an orbit without a covariance, or one that was not determined.
    OSError
        Where a file cannot be read.
    """
    facts = given.to_dict() if hasattr(given, "to_dict") else given
    if isinstance(facts, str | os.PathLike):
        facts = _facts_of(facts) or facts
    name = os.fspath(given) if isinstance(given, str | os.PathLike) else "the prior"
    if isinstance(facts, Mapping):
        return _of_determination(facts, name)
    start = start_of(given, near, chosen)
    if start.covariance is None:
        raise ValueError(f"--prior {name}: {start.source} has no covariance: it can be a --guess, no prior")
    thumb = (f"the covariance of {name} is a rule of thumb, 1 km",) if "rule of thumb" in start.source else ()
    used = start.used or (_commented(given) if isinstance(given, str | os.PathLike) else None)
    return Earlier(start.epoch, start.state, start.covariance, name, used=used, assumed=thumb)


def _commented(path: str | os.PathLike[str]) -> tuple[Epoch, Epoch] | None:
    """First and last measurement by the comment of an OEM or OPM of Piazzi; None where there is not one such line."""
    with opened(path) as file:
        header = file.read(HEADER).decode("utf-8", errors="replace").split("META_START")[0]
    found = _MADE_OF.findall(header)
    if not header.startswith(("CCSDS_OEM_VERS", "CCSDS_OPM_VERS")) or len(found) != 1:
        return None
    with suppress(ValueError):
        first, last = (Epoch(text) for text in found[0])
        return (first, last) if last - first >= 0 else None
    return None


def _facts_of(path: str | os.PathLike[str]) -> Mapping[str, Any] | None:
    """The object of a determination in a file of its own; None for any other file."""
    name = os.fspath(path)
    with opened(path) as file:
        start = file.read(512)
        if start.startswith(hdf5.SIGNATURE):
            text: Any = None
        elif start.lstrip().startswith(b"{"):
            text = start + file.read(LARGEST)
        else:
            return None
    if text is None:
        with hdf5.opened(path) as root:
            text = root.attrs.get("determination")
        if not isinstance(text, str):
            raise ValueError(f"--prior {name}: the file holds no determination")
    try:
        found = json.loads(text)
    except (ValueError, RecursionError):
        found = None
    if not isinstance(found, dict):
        raise ValueError(f"--prior {name}: no JSON of a determination")
    return found


def _of_determination(facts: Mapping[str, Any], name: str) -> Earlier:
    if facts.get("schema") != SCHEMA:
        raise ValueError(f"--prior {name}: the schema is {str(facts.get('schema'))[:60]!r}, not {SCHEMA!r}")
    if not facts.get("determined"):
        raise ValueError(f"--prior {name}: that orbit is not determined: it can be a --guess, no prior")
    try:
        epoch, frame = date(str(facts["epoch"]), f"{name}: epoch"), frame_named(str(facts["frame"]))
        names = [str(n) for n in facts["names"]]
        mean, P = np.array(facts["mean"], dtype=float), np.array(facts["covariance"], dtype=float)
        if P.shape != 2 * (len(names),) or not (np.isfinite(mean).all() and np.isfinite(P).all()):
            raise ValueError("the covariance is not finite, or not of these names")
        order = [names.index(n) for n in STATES]
    except (KeyError, TypeError, ValueError) as error:
        raise ValueError(f"--prior {name}: the determination has no state with a covariance: {error}") from None
    factor, assumed = _inflated(facts, name)
    P = P * factor**2
    now = density_now(facts, epoch)
    stays = [n for i, n in enumerate(names) if n not in STATES and P[i, i] > 0 and (n == now or not is_node(n, DENSITY))]
    order += [names.index(n) for n in stays]
    J = np.eye(len(order))
    J[:6, :6] = in_axes(frame, "GCRF", [epoch])[0]
    told = (*STATES, *(AIR_THEN if n == now else n for n in stays))
    about = str(facts.get("about", "earth"))
    return Earlier(epoch, J @ mean[order], J @ P[np.ix_(order, order)] @ J.T, name, told, used_by(facts), assumed, about)


def density_now(facts: Mapping[str, Any], epoch: Epoch) -> str:
    """Name of the air's density at the epoch, "" where none of its nodes stands there."""
    with suppress(KeyError, TypeError, ValueError):
        for k, when in enumerate(facts["density"], start=1):
            if abs(Epoch(str(when)) - epoch) < SAME_TIME:
                return f"{DENSITY}{k}"
    return ""


def _inflated(facts: Mapping[str, Any], name: str) -> tuple[float, tuple[str, ...]]:
    """What sigmas are multiplied by, as in products, where that verdict called them too small."""
    with suppress(KeyError, TypeError, ValueError):
        honest = facts["verdict"]["honest"]
        factor = float(honest["figure"])
        if honest["ok"] is False and factor > 1.0:
            return factor, (f"sigmas of {name} are taken {factor:.3g} times as large, as its verdict found errors",)
    return 1.0, ()


def used_by(facts: Mapping[str, Any]) -> tuple[Epoch, Epoch] | None:
    """First and last measurement, those of the orbits that it began with among them."""
    try:
        first, last = (Epoch(str(facts["span"][key])) for key in ("first", "last"))
        before = facts.get("prior") or {}
        return (min(first, Epoch(str(before["first"]))), last) if before.get("first") else (first, last)
    except (KeyError, TypeError, ValueError):
        return None


def fresh(rows: Observations, earlier: Earlier, since: Epoch | None) -> Observations:
    """The measurements that an earlier orbit has not used, the others counted.

    Raises
    ------
    ValueError
        Where nobody says which it has used, or none is left.
    """
    if since is not None:
        old = rows.t < since - rows.epoch - 1e-9
    elif earlier.used is not None:
        first, last = (when - rows.epoch for when in earlier.used)
        old = (rows.t >= first - 1e-3) & (rows.t <= last + 1e-3)
    else:
        raise ValueError(
            f"--prior {earlier.source}: which measurements is it made of? Say from when on they are new, with --from DATE"
        )
    count = int(np.count_nonzero(old & rows.measured))
    if not (rows.measured & ~old).any():
        raise ValueError(f"--prior {earlier.source}: it has used all {count:,} measurements already: there is none that is new")
    if not count:
        return rows
    return replace(rows[~old], left_out=(*rows.left_out, (f"measurements that {earlier.source} has used already", count)))
