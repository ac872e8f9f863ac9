"""The header of a table of measurements: what its columns are, and in which units."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Mapping, Sequence

from piazzi.formats.kinds import KINDS
from piazzi.tables.cells import STATION, TIME, split
from piazzi.tables.names import IGNORE, SECONDS, WEEK, parts, renamed
from piazzi.text import is_number, nearest
from piazzi.units import Units

PEOPLE = (STATION, "object")
WEATHER = ("pressure", "temperature", "humidity")
LATITUDE = ("latitude", "longitude", "height")
FIX = ("x", "y", "z", "vx", "vy", "vz")
SIGMA = "sigma "
MEASURED = tuple(kind for kind in KINDS if not KINDS[kind].auxiliary)
SHORT: Mapping[str, str] = {"az": "azimuth", "el": "elevation", "ra": "right_ascension", "dec": "declination"}
KNOWN = (TIME, *PEOPLE, *KINDS, *(SIGMA + kind for kind in MEASURED))
_LETTERS = re.compile(r"(\d{1,4})-(\d{1,4})", re.ASCII)  # columns of letters, from one to another
_UNITS = re.compile(rb"\[[^\[\]\n]*\]")
_CELLS = re.compile(rb"[,;\t]|\s+")


class Header:
    """Takes the header of one table, and remembers what it said.

    Attributes
    ----------
    factors : what turns numbers of a column into SI, by our name
    unitless : our names of columns whose kind has a unit, and that name none
    strange : names of columns that mean nothing here
    """

    def __init__(self, columns: Mapping[str, str]) -> None:
        self.columns = {_sigma(ours): theirs for ours, theirs in columns.items()}
        self.factors: dict[str, float] = {}
        self.unitless: list[str] = []
        self.strange: list[str] = []
        self.header: list[str] = []
        self._theirs: dict[str, str] = {}

    def named(self, header: list[str]) -> list[str]:
        """Our names of the columns, "" for those that are left out; raises ValueError for what does not fit."""
        self.header = header
        said = {parts(name)[0] for pair in self.columns.items() for name in pair}
        plain = [name if parts(name)[0] in said else _written_out(name, header) for name in map(_sigma, header)]
        out = renamed(plain, KNOWN, self.columns, "is nothing that is measured")
        ours, ignored = [TIME, WEEK, SECONDS, *KNOWN], self.columns.get(IGNORE, "").split(",")
        labels = [name if parts(name)[0] == TIME else parts(name)[0] for name in out]
        for name, label, theirs in zip(out, labels, header, strict=True):
            bare = parts(name)[0]
            if bare not in ours:
                self.strange += [theirs] if parts(theirs)[0] not in ignored else []
            elif bare not in (TIME, *PEOPLE, WEEK, SECONDS):
                self._unit(label, parts(name)[1], theirs)
        kept = [label if parts(name)[0] in ours else "" for name, label in zip(out, labels, strict=True)]
        self._check([parts(name)[0] for name in kept])
        return kept

    def theirs(self, label: str) -> str:
        """What the file calls a column, without its unit."""
        return self._theirs.get(label, label)

    def unit(self, label: str) -> str:
        """The SI unit of a column."""
        return KINDS[label.removeprefix(SIGMA)].unit

    def hint(self) -> str:
        """How to name columns, for a table that has none of ours."""
        near = nearest(parts(self.header[-1])[0][:40], MEASURED) if self.header else ""
        return f'; the file has {", ".join(self.header)[:200]}: say what they are, as --columns "time=T range=RNG[km]"{near}'

    def _check(self, labels: Sequence[str]) -> None:
        if not {*MEASURED} & {*labels}:
            raise ValueError(f"there is no column of measurements{self.hint()}")
        if TIME not in labels and not {WEEK, SECONDS} <= {*labels}:
            raise ValueError(
                f"there is no column {TIME!r}, and none of week and sow; the file has {', '.join(self.header)[:200]}: "
                'say which it is, as --columns "time=T"'
            )

    def _unit(self, label: str, text: str, theirs: str) -> None:
        own = self.unit(label)
        self._theirs[label] = parts(theirs)[0]
        if not text:
            if own:
                self.unitless.append(label)
            return
        if text == own:
            return
        try:
            told, mine = Units().unit(text), Units().unit(own or "1")
        except ValueError as error:
            raise ValueError(f"column {theirs[:60]!r}: {error}") from None
        if told.powers != mine.powers:
            hours = "; hours of right ascension are 15 deg each: give degrees" if text in ("h", "hour") else ""
            raise ValueError(f"column {theirs[:60]!r} has no unit of its kind: {label} is in {own or 'no unit'}{hours}")
        self.factors[label] = told.factor


def _sigma(name: str) -> str:
    """``sigma_x`` as ``sigma x``."""
    return SIGMA + name[len(SIGMA) :] if name.startswith("sigma_") else name


def _written_out(name: str, header: Sequence[str] = ()) -> str:
    """A name with what `SHORT` stands for, where no other column is called so."""
    label, unit = parts(name)
    sigma, kind = (SIGMA, label[len(SIGMA) :]) if label.startswith(SIGMA) else ("", label)
    written = sigma + SHORT.get(kind.casefold(), kind)
    if written == label or written in (parts(_sigma(other))[0] for other in header):
        return name
    return f"{written}[{unit}]" if unit else written


def looks(head: bytes) -> bool:
    """Whether the first bytes of a file are a header with a time and something that is measured."""
    for line in head.removeprefix(b"\xef\xbb\xbf").split(b"\n"):
        if line.strip() and not line.startswith(b"#"):
            cells = _CELLS.split(_UNITS.sub(b"", line))  # a unit may have blanks, as in time[s past DATE]
            names = {parts(_written_out(cell.decode("latin-1").strip(' "\r')))[0].casefold() for cell in cells}
            timed = TIME in names or {WEEK, SECONDS} <= names
            return timed and not names.isdisjoint(MEASURED)
    return False


def content_of(data: bytes, columns: Mapping[str, str]) -> tuple[bytes, list[str] | None]:
    """The text, and names of its columns where its first line has none: numbers of cells, or of letters of the lines."""
    letters = {label: match for theirs in columns.values() if (match := _LETTERS.fullmatch(label := parts(theirs)[0]))}
    if letters:
        return _cut(data, letters), list(letters)
    if not columns:
        return data, None
    cells = next(csv.reader([split(data).first.decode("utf-8", "replace")]), [])
    if not any(is_number(cell) for cell in cells):
        return data, None
    return data, [str(i) for i in range(1, len(cells) + 1)]


def _cut(data: bytes, letters: Mapping[str, re.Match[str]]) -> bytes:
    """Cells of the letters of each line, from one to another; lines without a number in them are left out."""
    ends = [(int(match[1]) - 1, int(match[2])) for match in letters.values()]
    for label, (a, b) in zip(letters, ends, strict=True):
        if not 0 <= a < b:
            raise ValueError(f"columns: letters {label} do not go forwards from 1 on")
    out = io.StringIO()
    table = csv.writer(out, lineterminator="\n")
    for text in data.decode("utf-8", "replace").split("\n"):
        cells = [text[a:b].strip() for a, b in ends]
        if text.startswith("#") or not any(is_number(cell) for cell in cells):
            out.write("\n")
        else:
            table.writerow(cells)
    return out.getvalue().encode()
