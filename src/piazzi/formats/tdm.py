"""Tracking Data Messages (CCSDS 503.0-B-1 and B-2), as text (KVN) and as XML."""

from __future__ import annotations

import re

import numpy as np

from piazzi.arrays import Array
from piazzi.formats.columns import Chunk, chunks
from piazzi.formats.conventions import Conventions
from piazzi.formats.markup import Element, walk
from piazzi.formats.ndm import Item, Source, key_value, known, shown
from piazzi.formats.observations import Observations
from piazzi.formats.source import plain_lines
from piazzi.formats.tdm_keywords import HEADER
from piazzi.formats.tdm_rows import Rows
from piazzi.formats.tdm_segment import meaning_of

_MARK = re.compile(rb"^[ \t]*(META_START|META_STOP|DATA_START|DATA_STOP)[ \t]*$", re.MULTILINE)
_LINE = "a line of data is KEYWORD = date value"


def read_kvn(data: bytes, name: str, told: Conventions) -> Observations:
    """Rows of a TDM in KVN.

    Raises
    ------
    ValueError
        With file, line and reason, at the first line that is not of the format.
    """
    source = Source(name)
    data = plain_lines(data)
    rows = Rows(source)
    where, line, first = 0, 1, True
    while where < len(data):
        items, where, line, mark = _until_mark(source, data, where, line)
        if first or (items and items[0].keyword == "CCSDS_TDM_VERS"):  # messages may follow one another
            _check_header(source, items)
        elif items:
            source.refuse(items[0].line, f"{shown(items[0].keyword)} stands between segments")
        if mark is None:
            break
        if mark != b"META_START":
            source.refuse(line - 1, f"{mark.decode()} stands where META_START should")
        first = False
        where, line = _segment(source, data, where, line, rows, told)
    return rows.observations()


def _segment(source: Source, data: bytes, where: int, line: int, rows: Rows, told: Conventions) -> tuple[int, int]:
    """Read one segment, whose metadata begin here; returns where the next one may begin."""
    items, where, line, mark = _until_mark(source, data, where, line)
    if mark != b"META_STOP":
        source.refuse(line - 1, "the metadata of a segment do not end with META_STOP")
    rows.begin(meaning_of(source, items, line - 1, told), items)
    items, where, line, mark = _until_mark(source, data, where, line)
    if items or mark != b"DATA_START":
        source.refuse(items[0].line if items else line - 1, "DATA_START should follow META_STOP")
    stop = _MARK.search(data, where)
    end = stop.start() if stop else len(data)
    for chunk in chunks(data, where, end, line, blanks=b"="):
        _take(source, chunk, rows)
    line += data.count(b"\n", where, end)
    if stop is None or stop[1] != b"DATA_STOP":
        source.refuse(line, "the data of a segment do not end with DATA_STOP")
    return min(stop.end() + 1, len(data)), line + 1


def _until_mark(source: Source, data: bytes, where: int, line: int) -> tuple[list[Item], int, int, bytes | None]:
    """Items up to the next mark, where what follows begins, its line, and the mark; None at the end of the file."""
    found = _MARK.search(data, where)
    end = found.start() if found else len(data)
    items = []
    for text in data[where:end].decode("utf-8", "replace").split("\n"):
        item = key_value(source, text, line)
        if item is not None:
            items.append(item)
        line += 1
    return items, min(found.end() + 1, len(data)) if found else len(data), line, found[1] if found else None


def _check_header(source: Source, items: list[Item]) -> None:
    for item in items:
        known(source, item, HEADER, "the header of a TDM")
    version = next((item for item in items if item.keyword == "CCSDS_TDM_VERS"), None)
    if version is None:
        source.refuse(1, "the file has no CCSDS_TDM_VERS")
    check_version(source, version)


def check_version(source: Source, version: Item) -> None:
    """Refuse versions whose keywords may mean something else."""
    if version.text not in ("1.0", "2.0", "1", "2"):
        source.refuse(version.line, f"the version of the TDM is {shown(version.text)}; 1.0 and 2.0 are read")


def _take(source: Source, chunk: Chunk, rows: Rows) -> None:
    """Rows of some lines of data."""
    counts = np.diff(chunk.words_before)
    lines = np.flatnonzero(counts)
    keywords = chunk.words(chunk.words_before[lines])
    is_data = keywords != b"COMMENT"
    if not is_data.all():
        lines, keywords = lines[is_data], keywords[is_data]
    wrong = ~_well_formed(chunk, lines, counts[lines])
    if wrong.any():
        i = int(lines[np.argmax(wrong)])
        good = lines < i
        _rows(chunk, lines[good], keywords[good], rows)  # an earlier line may have something else wrong with it
        source.refuse(chunk.first_line + i, f"{shown(chunk.text(i))}: {_LINE}")
    _rows(chunk, lines, keywords, rows)


def _well_formed(chunk: Chunk, lines: Array, counts: Array) -> Array:
    """Which lines are three words, with one sign of equality behind the first."""
    equals = np.flatnonzero(chunk.letters == ord("="))
    per_line = np.searchsorted(equals, np.append(chunk.line_starts, len(chunk.letters)))
    single = np.diff(per_line)[lines] == 1
    good = (counts == 3) & single
    first = chunk.words_before[lines[good]]
    at = equals[per_line[lines[good]]]
    good[good] = (at >= chunk.ends[first]) & (at < chunk.starts[first + 1])
    return np.asarray(good)


def _rows(chunk: Chunk, lines: Array, keywords: Array, rows: Rows) -> None:
    if len(lines):
        first = chunk.words_before[lines]
        rows.take(keywords, chunk.words(first + 1), chunk.words(first + 2), lines + chunk.first_line)


class _Document:
    """What the elements of a TDM in XML say, as they come."""

    def __init__(self, source: Source, told: Conventions) -> None:
        self.source, self.told, self.rows = source, told, Rows(source)
        self.path: list[str] = []
        self.items: list[Item] = []
        self.waiting: list[tuple[bytes, bytes, bytes, int]] = []
        self.date: bytes | None = None
        self.segments = 0

    def begins(self, name: str, attributes: dict[str, str], line: int) -> None:
        if not self.path and "version" in attributes:
            check_version(self.source, Item("version", attributes["version"], line))
        self.path.append(name)
        if name in ("metadata", "header"):
            self.items = []
        elif name == "observation":
            self.date = None

    def ends(self, element: Element) -> None:
        self.path.pop()
        parent = self.path[-1] if self.path else ""
        item = Item(element.name, element.text, element.line, element.attributes.get("units", ""))
        if element.name == "COMMENT":
            return
        if parent == "observation":
            self.observed(element)
        elif parent == "metadata":
            self.items.append(item)
        elif parent == "header":
            known(self.source, item, HEADER, "the header of a TDM")
        elif element.name == "metadata":
            self.rows.begin(meaning_of(self.source, self.items, element.line, self.told), self.items)
            self.segments += 1
        elif element.name == "data":
            self.flush()
        elif element.name not in ("observation", "segment", "header", "body", "tdm"):
            known(self.source, item, ("observation", "segment", "header", "body", "metadata", "data"), "a TDM in XML")

    def observed(self, element: Element) -> None:
        text = element.text.encode("utf-8", "replace")
        if element.name == "EPOCH":
            self.date = text
            return
        if self.date is None:
            self.source.refuse(element.line, f"{shown(element.name)} is in an observation without EPOCH before it")
        if not self.segments:
            self.source.refuse(element.line, "data stand before metadata")
        self.waiting.append((element.name.encode(), self.date, text, element.line))
        if len(self.waiting) >= 2**15:
            self.flush()

    def flush(self) -> None:
        if self.waiting:
            keywords, dates, numbers, lines = zip(*self.waiting, strict=True)
            self.rows.take(_words(keywords), _words(dates), _words(numbers), np.array(lines))
            self.waiting = []


def _words(texts: tuple[bytes, ...]) -> Array:
    return np.array([text if 0 < len(text) <= 64 and b"\0" not in text else b"\xff" for text in texts])


def read_xml(data: bytes, name: str, told: Conventions) -> Observations:
    """Rows of a TDM in XML; ValueError as `read_kvn`, for a document type as well."""
    document = _Document(Source(name), told)
    walk(document.source, data, document.begins, document.ends)
    document.flush()
    return document.rows.observations()
