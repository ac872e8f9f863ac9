"""Comma-separated text -> columns of numbers: quickly where it is regular, else with care and the line of every fault."""

from __future__ import annotations

import csv
import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import nan

import numpy as np

from piazzi.problem.checks import Array

STATION = "station"
MAX_BYTES = 2**32
MAX_COLUMNS = 1000
_WIDEST = 64  # bytes of a station's name that the fast way can hold


@dataclass(frozen=True, eq=False)
class Cells:
    """A table by columns.

    Attributes
    ----------
    comments : lines that began with # above the header
    numbers : column name -> (J,) values, NaN where empty
    station : (J,) indices into `station_names`, None without such a column
    lines : line of the file that each row is in
    """

    comments: tuple[str, ...]
    numbers: dict[str, Array]
    station: Array | None
    station_names: tuple[str, ...]
    lines: Sequence[int]


def read_cells(path: str | os.PathLike[str]) -> Cells:
    """All columns of a file whose first line names them.

    Raises
    ------
    OSError
        Where the file cannot be read.
    ValueError
        Where it is no table of numbers: with the line, the column and the cell.
    """
    lines = _lines(path)
    top = 0
    while top < len(lines) and (lines[top].startswith("#") or not lines[top].strip()):
        top += 1
    if top == len(lines):
        raise ValueError("the file is empty: it has no line that names its columns")
    comments = tuple(line[1:].strip() for line in lines[:top] if line.startswith("#"))
    try:
        header = _header(next(csv.reader([lines[top]])), top + 1)
        return _fast(lines, top, header, comments) or _careful(lines, top, header, comments)
    except csv.Error as error:
        raise ValueError(f"line {top + 1}: {error}") from None


def _lines(path: str | os.PathLike[str]) -> list[str]:
    with open(path, "rb") as file:
        content = file.read(2**16)
        if b"\0" in content:
            raise ValueError("it is not text: it has zero bytes")
        content += file.read(MAX_BYTES - len(content))
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        raise ValueError(f"line {line}: it is not UTF-8 text: byte 0x{content[error.start]:02x}") from None
    lines = (text.replace("\r\n", "\n") if "\r" in text else text).split("\n")
    while lines and not lines[-1]:
        lines.pop()
    return lines


def _header(cells: list[str], line: int) -> list[str]:
    header = [cell.strip() for cell in cells]
    if len(header) > MAX_COLUMNS:
        raise ValueError(f"line {line}: it names {len(header)} columns; at most {MAX_COLUMNS} are allowed")
    for i, name in enumerate(header):
        if not name:
            raise ValueError(f"line {line}: column {i + 1} has no name")
        if name in header[:i]:
            raise ValueError(f"line {line}: two columns are called {name[:40]!r}")
    return header


def _fast(lines: list[str], top: int, header: list[str], comments: tuple[str, ...]) -> Cells | None:
    """The table where every line is one regular row, else None."""
    body = lines[top + 1 :]
    if not body or any('"' in line or not line for line in body):
        return None
    kinds = [(f"c{i}", f"S{_WIDEST}" if name == STATION else "f8") for i, name in enumerate(header)]
    try:
        table = np.loadtxt(_with_nan(body), dtype=kinds, delimiter=",", comments=None, ndmin=1)
    except (ValueError, UnicodeEncodeError):
        return None
    if len(table) != len(body):
        return None
    numbers = {name: np.ascontiguousarray(table[f"c{i}"]) for i, name in enumerate(header) if name != STATION}
    station, names = None, ()
    if STATION in header:
        station, names = _indexed(table[f"c{header.index(STATION)}"])
        if any(len(name) >= _WIDEST for name in names):
            return None
    return Cells(comments, numbers, station, names, range(top + 2, len(lines) + 1))
