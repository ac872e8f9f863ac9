"""Comma-separated text -> columns of numbers: quickly where it is regular, else with care and the line of every fault."""

from __future__ import annotations

import csv
import io
import os
import re
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from math import nan
from typing import NamedTuple

import numpy as np

from piazzi.arrays import Array
from piazzi.opening import opened
from piazzi.text import shown

STATION = "station"
TIME = "time"
MAX_BYTES = 2**32
MAX_COLUMNS = 1000
_ODD = (b'"', b"\r", b"\0")
_WORDS = (b"rue", b"RUE", b"alse", b"ALSE")  # true and false are numbers to pandas, but not to us
PIECE = 2**18  # bytes that are looked at together: what stays in a cache
LONGEST_DATE = 60
PAST = re.compile(r"time ?\[s past ([^\[\]]+)\]")
_DATE = re.compile(r"\s*(\d{4}[-/]\d|M?JD\s*\d)")
SMALL = 2**19  # bytes for which the careful way takes less time than importing pandas


class Names(NamedTuple):
    """A column of names: (J,) indices into the different ones, in the order in which they come; -1 for an empty cell."""

    code: Array
    names: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Cells:
    """A table by columns.

    Attributes
    ----------
    comments : lines that began with # above the header
    numbers : column name -> (J,) values, NaN where empty
    texts : column name -> its names, of the columns that have them
    lines : line of the file that each row is in
    dates : (J,) texts of the column of time, as bytes, where it has dates; it is not among the numbers then
    scale : what the name of that column says of the time scale, None where it says nothing
    notes : what should be said of the table
    """

    comments: tuple[str, ...]
    numbers: dict[str, Array]
    texts: Mapping[str, Names]
    lines: Sequence[int]
    dates: Array | None = None
    scale: str | None = None
    notes: tuple[str, ...] = ()

    @property
    def station(self) -> Array | None:
        """(J,) indices into `station_names`, None without such a column."""
        return self.texts[STATION].code if STATION in self.texts else None

    @property
    def station_names(self) -> tuple[str, ...]:
        """Names of the stations, none without such a column."""
        return self.texts[STATION].names if STATION in self.texts else ()

    def in_order(self, order: Array) -> Cells:
        """The same table with its rows in another order."""
        numbers = {name: column[order] for name, column in self.numbers.items()}
        texts = {name: Names(column.code[order], column.names) for name, column in self.texts.items()}
        dates = None if self.dates is None else self.dates[order]
        lines = np.asarray(self.lines)[order].tolist()
        return replace(self, numbers=numbers, texts=texts, dates=dates, lines=lines)

    def renamed(self, name: Callable[[str], str]) -> Cells:
        """The same table with other names in its columns of names."""
        texts = {column: Names(found.code, tuple(map(name, found.names))) for column, found in self.texts.items()}
        return replace(self, texts=texts)


def read_cells(path: str | os.PathLike[str], named: Callable[[list[str]], list[str]] | None = None) -> Cells:
    """All columns of a file whose first line, after comments, names them.

    Cells are separated by commas, or by what the first line has instead: semicolons, tabs or blanks.  `named` makes other
    names of the columns, "" of one that is left out.

    Raises
    ------
    OSError
        Where the file cannot be read.
    ValueError
        Where it is no table of numbers: with the line, the column and the cell.
    """
    with opened(path) as file:
        size = os.fstat(file.fileno()).st_size
        if size > MAX_BYTES:
            raise ValueError(f"it has {size:,} bytes; at most {MAX_BYTES:,} are read")
        content = file.read(2**16)
        if b"\0" in content:
            raise ValueError("it is not text: it has zero bytes")
        content += file.read()
    return cells_of(content, named)


def cells_of(
    content: bytes,
    named: Callable[[list[str]], list[str]] | None = None,
    texts: Collection[str] = (STATION,),
    header: list[str] | None = None,
) -> Cells:
    """All columns of a text, as `read_cells` takes them from a file.

    `texts` are those that hold names; `header` names the columns of a text whose first line is a row already.
    """
    comments, first, body, line, note = split(content)
    if header is None:
        header, said = since(parse_header(first, line))
        comments, line = (*said, *comments), line + 1
    else:
        body = first + b"\n" + body if body else first
    table = (body, line, header if named is None else named(header), comments, texts)
    cells = (fast(*table) if len(body) >= SMALL else None) or parse_rows(*table)
    return replace(cells, notes=(note,)) if note else cells


class Parts(NamedTuple):
    """A text as comments, the line behind them, the rows, the number of that line, and what to say of marks between cells."""

    comments: tuple[str, ...]
    first: bytes
    body: bytes
    line: int
    note: str


def split(content: bytes) -> Parts:
    """The parts of a text with commas between cells; raises ValueError where there is nothing in it."""
    rest = content.removeprefix(b"\xef\xbb\xbf")
    rest = rest.replace(b"\r\n", b"\n") if b"\r" in rest else rest
    comments: list[str] = []
    line = start = 0
    while start < len(rest):
        line += 1
        end = rest.find(b"\n", start)
        end = len(rest) if end < 0 else end
        first, start = rest[start:end], end + 1
        if first.startswith(b"#"):
            comments.append(_decoded(first[1:], line).strip())
        elif first.strip():
            first, body, note = with_commas(first, rest[start:].rstrip(b"\n"), line)
            return Parts(tuple(comments), first, body, line, note)
    raise ValueError("the file is empty: no line names its columns")


def with_commas(first: bytes, body: bytes, line: int) -> tuple[bytes, bytes, str]:
    """Header and rows with commas between cells, and what to say where others stood there.

    Raises
    ------
    ValueError
        For a comma or a quote among cells that others separate, with its line.
    """
    if b"," in first or b'"' in first:
        return first, body, ""
    mark = b";" if b";" in first else b"\t" if b"\t" in first else None
    if mark is None and len(first.split()) < 2:
        return first, body, ""
    what = {b";": "semicolons", b"\t": "tabs", None: "blanks"}[mark]
    for odd, name in ((b",", "a comma"), (b'"', "a quote")):
        if odd in body:
            at = line + 1 + body.count(b"\n", 0, body.index(odd))
            hint = "; decimals have a point" if odd == b"," else ""
            raise ValueError(f"line {at}: there is {name} among cells that {what} separate{hint}")
    note = f"{what} separate its cells"
    if mark is not None:
        return first.replace(mark, b","), body.replace(mark, b","), note
    rows = (b",".join(row.split()) for row in body.split(b"\n"))
    return b",".join(first.split()), b"\n".join(rows), note


def _decoded(content: bytes, line: int) -> str:
    """The text of bytes that begin at a line."""
    try:
        return content.decode("utf-8")
    except UnicodeDecodeError as error:
        line += content.count(b"\n", 0, error.start)
        raise ValueError(f"line {line}: it is not UTF-8 text: byte 0x{content[error.start]:02x}") from None


def parse_header(first: bytes, line: int) -> list[str]:
    """Names of the columns; raises ValueError for a line that cannot name them."""
    try:
        header = [cell.strip() for cell in next(csv.reader([_decoded(first, line)]))]
    except csv.Error as error:
        raise ValueError(f"line {line}: {error}") from None
    if len(header) > MAX_COLUMNS:
        raise ValueError(f"line {line}: there are {len(header)} columns; at most {MAX_COLUMNS} are allowed")
    for i, name in enumerate(header):
        if not name:
            raise ValueError(f"line {line}: column {i + 1} has no name")
        if not name.isprintable() or len(name) > 100:
            raise ValueError(f"line {line}: column {i + 1} cannot be called {shown(name)}")
        if name in header[:i]:
            raise ValueError(f"line {line}: two columns are called {shown(name)}")
    return header


def fast(
    body: bytes, line: int, header: list[str], comments: tuple[str, ...], texts: Collection[str] = (STATION,)
) -> Cells | None:
    """The table where every line is one regular row of plain cells, else None."""
    if any(odd in body for odd in _ODD) or not _is_regular(body, len(header)):
        return None
    import pandas as pd  # type: ignore[import-untyped,unused-ignore]

    when = dated(header, body[: body.find(b"\n")].split(b","))
    kinds = {i: str if name in texts or i == when.column else float for i, name in enumerate(header) if name}
    try:
        table = pd.read_csv(
            io.BytesIO(body), header=None, index_col=False, usecols=list(kinds), dtype=kinds, na_values=[""],
            keep_default_na=False, skip_blank_lines=False, engine="c", low_memory=False, **_exact(pd.__version__),
        )  # fmt: skip
    except (ValueError, OverflowError):  # among them all of pandas' own errors of parsing
        return None
    numbers = {name: np.ascontiguousarray(table[i], dtype=float) for i, name in enumerate(header) if kinds.get(i) is float}
    if any(_is_binary(column) for column in numbers.values()) and any(word in body for word in _WORDS):
        return None
    named: dict[str, Names] = {}
    for name in (name for name in header if name in texts):
        codes, given = pd.factorize(table[header.index(name)])
        named[name] = _merged(np.asarray(codes, dtype=np.int64), [str(name).strip() for name in given])
        if "" in named[name].names or (named[name].code < 0).any():
            return None
    dates = None
    if when.column >= 0:
        if table[when.column].isna().any():
            return None  # the careful way says in which line a date is missing
        try:
            dates = as_bytes(when.before + table[when.column].to_numpy())
        except ValueError:
            return None
    return Cells(comments, numbers, named, range(line, line + len(table)), dates, when.scale)


def _exact(version: str) -> dict[str, str]:
    """What has pandas round numbers as Python does: from 3.1 on it always does, and asking for it is deprecated."""
    major, minor = map(int, version.split(".")[:2])
    return {"float_precision": "round_trip"} if (major, minor) < (3, 1) else {}


def _is_regular(body: bytes, columns: int) -> bool:
    """Whether every line has as many cells as there are columns, and none is empty."""
    start = 0
    while start < len(body):
        end = body.find(b"\n", start + PIECE)
        end = len(body) if end < 0 else end
        if not _lines_are_regular(body[start:end], columns):
            return False
        start = end + 1
    return start == len(body) + 1  # neither empty nor ending in an empty line


def _lines_are_regular(lines: bytes, columns: int) -> bool:
    raw = np.frombuffer(lines, dtype=np.uint8)
    ends = np.append(np.flatnonzero(raw == ord("\n")), len(raw))
    starts = np.append(0, ends[:-1] + 1)
    commas = np.flatnonzero(raw == ord(","))
    if (ends == starts).any() or len(commas) != (columns - 1) * len(ends):
        return False
    table = commas.reshape(len(ends), columns - 1)
    return bool((table >= starts[:, None]).all() and (table <= ends[:, None]).all())


def _is_binary(column: Array) -> bool:
    """Whether there is nothing in a column but 0 and 1."""
    return all(bool(((part == 0) | (part == 1) | np.isnan(part)).all()) for part in (column[:100], column))


def _merged(index: Array, given: list[str]) -> Names:
    """Indices into different names where several may be the same; -1 stays."""
    names = {name: i for i, name in enumerate(dict.fromkeys(given))}
    return Names(np.array([*(names[name] for name in given), -1], dtype=np.int64)[index], tuple(names))


def parse_rows(
    body: bytes, line: int, header: list[str], comments: tuple[str, ...] = (), texts: Collection[str] = (STATION,)
) -> Cells:
    """The table row by row; raises ValueError at the first cell that does not fit."""
    text = _decoded(body, line)
    when: Dated | None = None
    dates: list[str] = []
    columns: dict[str, list[float]] = {name: [] for name in header if name and name not in texts}
    known: dict[str, dict[str, int]] = {name: {} for name in header if name in texts}
    index: dict[str, list[int]] = {name: [] for name in known}
    lines: list[int] = []
    reader = csv.reader(_split(text), strict=True)
    try:
        for row in reader:
            if not row:
                continue
            at = line + reader.line_num - 1
            if len(row) != len(header):
                cells = f"{len(row)} cell{'s' * (len(row) != 1)}"
                raise ValueError(f"line {at} has {cells}; the header names {len(header)} ({', '.join(header)[:200]})")
            when = when or dated(header, row)
            for i, (name, cell) in enumerate(zip(header, row, strict=True)):
                if not name:
                    continue
                if i == when.column:
                    dates.append(when.before + _date(cell, at))
                elif name in known:
                    index[name].append(known[name].setdefault(_name(cell, name, at), len(known[name])))
                else:
                    columns[name].append(_number(cell, name, at))
            lines.append(at)
    except csv.Error as error:
        raise ValueError(f"line {line + reader.line_num - 1}: {error}") from None
    when = when or dated(header, ())
    numbers = {name: np.array(column, dtype=float) for name, column in columns.items() if header.index(name) != when.column}
    named = {name: Names(np.array(index[name], dtype=np.int64), tuple(found)) for name, found in known.items()}
    given = as_bytes(np.array(dates, dtype=object)) if when.column >= 0 else None
    return Cells(comments, numbers, named, lines, given, when.scale)


class Dated(NamedTuple):
    """Which column holds dates, -1 for none, the scale that its name gives them, and what goes before each: MJD or JD."""

    column: int
    scale: str | None
    before: str = ""


def dated(header: Sequence[str], first: Sequence[str] | Sequence[bytes]) -> Dated:
    """Whether the column of time holds dates, by its name, as ``time[UTC]``, or else by its first cell."""
    at = next((i for i, name in enumerate(header) if name.partition("[")[0].strip() == TIME), -1)
    if at < 0:
        return Dated(-1, None)
    unit = header[at].partition("[")[2].rstrip("] ").strip()
    if unit and unit != "s":
        from piazzi.earth.scales import SCALES  # only those wait for it who may have dates

        day, _, scale = unit.upper().rpartition(" ") if " " in unit else (unit.upper(), "", "")
        if day in ("MJD", "JD") and (not scale or scale in SCALES):
            return Dated(at, scale or None, day + " ")
        if unit.upper() in SCALES:
            return Dated(at, unit.upper())
    cell = first[at] if at < len(first) else ""
    text = cell.decode("utf-8", "replace") if isinstance(cell, bytes) else cell
    return Dated(at if not unit and _DATE.match(text) else -1, None)


def as_bytes(texts: Array) -> Array:
    """Texts without blanks around them as an array of bytes; raises ValueError where one is long, or not ASCII."""
    out = np.array([text.strip() for text in texts.tolist()] or [""], dtype=np.bytes_)
    if out.dtype.itemsize > LONGEST_DATE:
        raise ValueError(f"a date has {out.dtype.itemsize} characters; at most {LONGEST_DATE} are read")
    return out[: len(texts)]


def _date(cell: str, line: int) -> str:
    """The text of a date, which may be any short one."""
    text = cell.strip()
    if not text:
        raise ValueError(f"line {line}: the time is missing; it must be a date")
    if not text.isascii() or len(text) > LONGEST_DATE:
        raise ValueError(f"line {line}: the time is {shown(cell)}; it must be a date such as 2016-02-13T16:00:00 UTC")
    return text


def _split(text: str) -> list[str]:
    """Lines with their ends, and no other kind of line end than the usual one."""
    return [part + "\n" for part in text.split("\n")]


def _name(cell: str, column: str, line: int) -> str:
    if not cell.strip():
        raise ValueError(f"line {line}: the {column} has no name")
    return cell.strip()


def since(header: list[str]) -> tuple[list[str], list[str]]:
    """The header with ``time`` for ``time[s past DATE]``, and what a comment above the table would say of it."""
    since = [(i, match[1]) for i, name in enumerate(header) if (match := PAST.fullmatch(name))]
    return [TIME if i in dict(since) else name for i, name in enumerate(header)], [f"epoch = {date}" for _, date in since]


def _number(cell: str, name: str, line: int) -> float:
    """The number in a cell, NaN in an empty one."""
    text = cell.strip()
    if not text:
        return nan
    try:
        if not text.isascii() or "_" in text:
            raise ValueError
        return float(text)
    except ValueError:
        raise ValueError(f"line {line}: {name} is {shown(cell)}; it must be a number, or empty where it is missing") from None
