"""Coefficients of gravity fields: the one in the package, and files of ICGEM (.gfc) or of the EGM96 layout.

Coefficients are fully normalised (IERS Conventions 2010, eq. 6.1).  Whether the permanent tide is in C20 is part of a field:
`tide_free`, `zero_tide` or `unknown`; a force model that adds solid tides has to know (`GravityField.in_tide_system`).
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np

from piazzi.arrays import Array
from piazzi.earth.conventional import SOURCE, conventional
from piazzi.earth.epoch import Epoch
from piazzi.opening import opened
from piazzi.text import brief, finite_number

PACKAGED = ("EGM2008", "IERS2010")
HIGHEST_DEGREE = 2190
# C20 of a zero-tide field minus that of a tide-free one: A0 H0 k20, IERS Conventions 2010, eq. 6.14, with k20 = 0.30190
PERMANENT_TIDE = 4.4228e-8 * -0.31460 * 0.30190
_EGM = (3.986004415e14, 6378136.3)  # GM and radius of EGM96, whose layout has no header
_YEAR = 365.25 * 86400.0
_SIGMAS = {"no": 0, "formal": 2, "calibrated": 2, "calibrated_and_formal": 4}  # columns of errors in a row


class Term(NamedTuple):
    """One change of a coefficient in time: a rate (per year) or a wave of `period` years, between two dates."""

    kind: str
    n: int
    m: int
    c: float
    s: float
    since: float  # years of the reference date
    until: float
    period: float


@dataclass(frozen=True, eq=False)
class GravityField:
    """A spherical-harmonic field.

    Parameters
    ----------
    name : of the model
    gm : m^3/s^2
    radius : m
    c, s : (N + 1, N + 1), fully normalised coefficients by degree and order; c[0, 0] is 1
    tide_system : tide_free, zero_tide, mean_tide or unknown
    source : the file or the package
    terms : changes in time, applied by `at`
    """

    name: str
    gm: float
    radius: float
    c: Array
    s: Array
    tide_system: str
    source: str
    terms: tuple[Term, ...] = ()

    __repr__ = brief

    @property
    def degree(self) -> int:
        """The highest degree there is."""
        return len(self.c) - 1

    def truncated(self, degree: int, order: int | None = None) -> GravityField:
        """The field to a degree and order; raises ValueError beyond what there is."""
        order = degree if order is None else order
        if not 0 <= order <= degree <= self.degree:
            raise ValueError(
                f"degree {degree} and order {order} are asked for; {self.name} ({self.source}) goes to {self.degree}"
            )
        keep = np.arange(degree + 1) <= order
        c, s = (np.where(keep, table[: degree + 1, : degree + 1], 0.0) for table in (self.c, self.s))
        return replace(self, c=c, s=s)

    def in_tide_system(self, system: str) -> GravityField:
        """The field with the permanent tide in C20 (`zero_tide`) or out of it (`tide_free`); IERS Conventions 2010, 6.2.2."""
        if system not in ("tide_free", "zero_tide"):
            raise ValueError(f"tide system {system!r}: C20 is converted between tide_free and zero_tide")
        if self.tide_system not in ("tide_free", "zero_tide"):
            raise ValueError(
                f"{self.name} ({self.source}) says {self.tide_system} of its tide system: name it, tide_free or zero_tide"
            )
        step = {"tide_free": 0.0, "zero_tide": PERMANENT_TIDE}
        c = self.c.copy()
        c[2, 0] += step[system] - step[self.tide_system]
        return replace(self, c=c, tide_system=system)

    def at(self, epoch: Epoch) -> GravityField:
        """The field of a date: rates and waves of a time-variable model are summed and gone.

        Models in pieces hold the value at the edge of their first or last piece outside of them.
        """
        year = 2000.0 + (epoch - Epoch.at(0.0)) / _YEAR
        ends = [t.until for t in self.terms if t.until < math.inf]
        if ends:
            year = min(max(year, min(t.since for t in self.terms)), max(ends) - 1e-9)
        c, s = self.c.copy(), self.s.copy()
        for term in self.terms:
            if term.since <= year < term.until or term.until == math.inf:
                factor = _factor(term, year)
                c[term.n, term.m] += factor * term.c
                s[term.n, term.m] += factor * term.s
        return replace(self, c=c, s=s, terms=())


def _factor(term: Term, year: float) -> float:
    past = year - term.since
    if term.kind == "trnd":
        return past
    if term.kind == "base":
        return 1.0
    angle = 2.0 * math.pi * past / term.period
    return math.cos(angle) if term.kind == "acos" else math.sin(angle)


def gravity_field(model: str | Path, folder: Path | None = None) -> GravityField:
    """The field of that name in the package, or of a file (beside `folder`); raises ValueError where there is neither."""
    if str(model) in PACKAGED:
        return _packaged(str(model))
    path = Path(model) if folder is None else folder / model
    if not path.is_file():
        raise ValueError(f"gravity model {str(model)!r} is neither in the package ({', '.join(PACKAGED)}) nor a file at {path}")
    return read_gravity(path)


@cache
def _packaged(name: str) -> GravityField:
    import tomllib

    if name == "IERS2010":
        egm = _packaged("EGM2008")
        c, s, rates = conventional(egm.c, egm.s)
        terms = tuple(Term("trnd", *rate, 2000.0, math.inf, 1.0) for rate in rates)
        zero_tide = replace(egm, name=name, c=c, s=s, source=f"package, {SOURCE}", terms=terms, tide_system="zero_tide")
        return zero_tide.in_tide_system("tide_free")

    folder = Path(__file__).parent / "data"
    about = tomllib.loads((folder / f"{name.lower()}.toml").read_text(encoding="utf-8"))
    packed = np.load(folder / f"{name.lower()}.npy", allow_pickle=False)
    degree = int(about["degree"])
    c, s = np.zeros((2, degree + 1, degree + 1))
    rows, columns = np.tril_indices(degree + 1)
    c[rows, columns], s[rows, columns] = packed
    for table in (c, s):
        table.flags.writeable = False
    return GravityField(name, about["gm"], about["radius"], c, s, about["tide_system"], f"package, {about['source']}")


def read_gravity(path: str | Path) -> GravityField:
    """A field from an ICGEM file (.gfc, static or time-variable) or from plain rows of the EGM96 layout, told apart by content.

    Raises ValueError with the file and line where a number cannot be read, is not finite or stands twice, where the header
    lacks GM, radius or degree, or where the file ends before its degree.
    """
    path = Path(path)
    with opened(path) as file:
        lines = file.read().decode("utf-8", errors="replace").splitlines()
    ends = [i for i, line in enumerate(lines) if line.lower().startswith("end_of_head")]
    if ends:
        return _icgem(path, lines, ends[0])
    if lines and re.fullmatch(r"\s*\d+\s+\d+(\s+\S+){2,4}\s*", lines[0]):
        return _plain(path, lines)
    raise ValueError(f"{path.name}: neither an ICGEM file (no end_of_head) nor rows of degree, order, C, S")


def _header(path: Path, lines: list[str]) -> dict[str, str]:
    found: dict[str, str] = {}
    for line in lines:
        key, _, value = line.strip().partition(" ")
        if value.strip():
            found.setdefault(key.lower(), value.split()[0])
    if "gravity_constant" in found:
        found.setdefault("earth_gravity_constant", found["gravity_constant"])
    for key in ("earth_gravity_constant", "radius", "max_degree"):
        if key not in found:
            raise ValueError(f"{path.name}: the header has no {key}")
    return found


def _icgem(path: Path, lines: list[str], end: int) -> GravityField:
    head = _header(path, lines[:end])
    gm, radius = (finite_number(head[k], f"{path.name}: {k}") for k in ("earth_gravity_constant", "radius"))
    degree = _index(head["max_degree"], f"{path.name}: max_degree")
    if gm <= 0.0 or radius <= 0.0:
        raise ValueError(f"{path.name}: GM is {gm:g} and radius {radius:g}; both must be positive")
    norm = head.get("norm", "fully_normalized")
    if norm not in ("fully_normalized", "unnormalized"):
        raise ValueError(f"{path.name}: norm {norm!r} is not known; fully_normalized and unnormalized are")
    errors = head.get("errors", "no")
    if errors not in _SIGMAS:
        raise ValueError(f"{path.name}: errors {errors!r} are not known; {', '.join(_SIGMAS)} are")
    records = _records(path, lines, end + 1, _SIGMAS[errors])
    c, s, terms = _rows(path, records, degree, pieces=head.get("format", "").startswith("icgem2"))
    if norm == "unnormalized":
        c, s = c / normalisation(degree), s / normalisation(degree)
    tide = head.get("tide_system", "unknown")
    tide = tide if tide in ("tide_free", "zero_tide", "mean_tide") else "unknown"
    return GravityField(head.get("modelname", path.stem), gm, radius, c, s, tide, path.name, terms)


class _Record(NamedTuple):
    place: str
    kind: str
    n: int
    m: int
    c: float
    s: float
    rest: tuple[str, ...]  # dates and period


def _record(place: str, kind: str, words: list[str], sigmas: int) -> _Record:
    if len(words) < 4:
        raise ValueError(f"{place}: a row has degree, order, C and S; this one has {len(words)} values")
    n, m = (_index(word, place) for word in words[:2])
    c, s = (finite_number(word, place) for word in words[2:4])
    return _Record(place, kind, n, m, c, s, tuple(words[4 + sigmas :]))


def _records(path: Path, lines: list[str], start: int, sigmas: int) -> Iterator[_Record]:
    for number, line in enumerate(lines[start:], start + 1):
        kind, *words = line.split() or [""]
        if kind in ("gfc", "gfct", "trnd", "dot", "acos", "asin"):
            yield _record(f"{path.name}, line {number}", kind, words, sigmas)


def _rows(path: Path, records: Iterator[_Record], degree: int, pieces: bool = False) -> tuple[Array, Array, tuple[Term, ...]]:
    """Coefficients and their changes; `pieces`: rows that change have both ends of their validity (ICGEM format 2)."""
    c, s = np.zeros((2, degree + 1, degree + 1))
    seen = np.zeros((degree + 1, degree + 1), dtype=bool)
    terms: list[Term] = []
    reference: dict[tuple[int, int], float] = {}
    c[0, 0] = 1.0
    for r in records:
        at = r.n, r.m
        if r.m > r.n or r.n > degree:
            raise ValueError(f"{r.place}: degree {r.n}, order {r.m} in a field of degree {degree}")
        if r.kind == "gfc" or (r.kind == "gfct" and not pieces):
            if seen[at]:
                raise ValueError(f"{r.place}: degree {r.n}, order {r.m} stands twice")
            c[at], s[at] = r.c, r.s
            if r.kind == "gfct":
                reference[at] = _year(r.rest[0] if r.rest else "", r.place)
        else:
            terms.append(_term(r, pieces, reference))
        if pieces and r.kind == "gfct":
            c[at] = s[at] = 0.0
        seen[at] = True
    highest = int(np.max(np.nonzero(seen.any(axis=1))[0], initial=0))
    if highest < degree:
        raise ValueError(f"{path.name}: max_degree is {degree}, but the rows end at degree {highest}")
    return c, s, tuple(terms)


def _term(r: _Record, pieces: bool, reference: dict[tuple[int, int], float]) -> Term:
    """A row that changes a coefficient in time."""
    wanted = 2 * pieces + (r.kind in ("acos", "asin"))
    if len(r.rest) < wanted:
        raise ValueError(
            f"{r.place}: a row {r.kind} ends with {'two dates' if pieces else 'its period'}; there are {len(r.rest)} values"
        )
    period = finite_number(r.rest[-1], r.place) if r.kind in ("acos", "asin") else 1.0
    if not period > 0.0:
        raise ValueError(f"{r.place}: a wave has a period of {period:g} years")
    if pieces:
        since, until = _year(r.rest[0], r.place), _year(r.rest[1], r.place)
    elif (r.n, r.m) in reference:
        since, until = reference[r.n, r.m], math.inf
    else:
        raise ValueError(f"{r.place}: degree {r.n}, order {r.m} has no row gfct before it, so no date of reference")
    kind = {"gfct": "base", "dot": "trnd"}.get(r.kind, r.kind)
    return Term(kind, r.n, r.m, r.c, r.s, since, until, period)


def _plain(path: Path, lines: list[str]) -> GravityField:
    rows = [(number, line.split()) for number, line in enumerate(lines, 1) if line.strip()]
    records = [_record(f"{path.name}, line {number}", "gfc", words, 2) for number, words in rows]
    c, s, _ = _rows(path, iter(records), max(r.n for r in records))
    return GravityField(path.stem, *_EGM, c, s, "tide_free", path.name)


def normalisation(degree: int) -> Array:
    """Factors by which normalised coefficients are multiplied to be unnormalised, (N + 1, N + 1); 1 above the diagonal."""
    factors = np.ones((degree + 1, degree + 1))
    for n in range(degree + 1):
        for m in range(n + 1):
            log = math.lgamma(n - m + 1) - math.lgamma(n + m + 1) + math.log((2 * n + 1) * (1 if m == 0 else 2))
            factors[n, m] = math.exp(0.5 * log)
    return factors


def _index(text: str, place: str) -> int:
    if not (text.isascii() and text.isdigit() and int(text) <= HIGHEST_DEGREE):
        raise ValueError(f"{place}: {text!r} is no degree or order (0 to {HIGHEST_DEGREE})")
    return int(text)


def _year(text: str, place: str) -> float:
    """Julian years with decimals of a date written yyyymmdd or yyyymmdd.hhmm."""
    digits = text.partition(".")[0]
    if not (len(digits) == 8 and digits.isascii() and digits.isdigit()):
        raise ValueError(f"{place}: {text!r} is no date yyyymmdd")
    clock = (text.partition(".")[2] + "0000")[:4]  # hours and minutes; files write 0060 too
    if not clock.isdigit():
        raise ValueError(f"{place}: {text!r} is no date yyyymmdd.hhmm")
    try:
        day = Epoch(f"{digits[:4]}-{digits[4:6]}-{digits[6:]} TT")
    except ValueError as error:
        raise ValueError(f"{place}: {error}") from None
    seconds = 3600.0 * int(clock[:2]) + 60.0 * int(clock[2:])
    return 2000.0 + float(day - Epoch.at(0.0) + seconds) / _YEAR
