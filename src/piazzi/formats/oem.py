"""Orbit Ephemeris Messages (CCSDS 502.0-B-2 and B-3) as text (KVN)."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from piazzi.arrays import Array
from piazzi.formats.columns import chunks, read_numbers
from piazzi.formats.conventions import Conventions
from piazzi.formats.ephemeris import Arc, Ephemeris
from piazzi.formats.ndm import Item, Source, key_value, known, lines_of, shown
from piazzi.formats.odm import Block, arc_of, metadata_of, one_system, unknown_axes
from piazzi.formats.odm_keywords import HEADER
from piazzi.formats.source import plain_lines

_MARK = re.compile(rb"^[ \t]*(META_START|META_STOP|COVARIANCE_START|COVARIANCE_STOP)[ \t]*$", re.MULTILINE)
_STATE = "a state is a date and six or nine numbers"


def read_kvn(data: bytes, name: str, told: Conventions) -> Ephemeris:
    """Arcs of an OEM in KVN.

    Raises
    ------
    ValueError
        With file, line and reason, at the first line that is not of the format.
    """
    source = Source(name)
    data = plain_lines(data)
    marks = [(found[1], found.start(), min(found.end() + 1, len(data))) for found in _MARK.finditer(data)]
    end = marks[0][1] if marks else len(data)
    text = _Text(data, np.flatnonzero(np.frombuffer(data, dtype=np.uint8) == ord("\n")))
    header = _items(source, *text.part(0, end))
    for item in header:
        known(source, item, (*HEADER, "CCSDS_OEM_VERS"), "the header of an OEM")
    check_version(source, header[0])
    if not marks:
        source.refuse(1, "the message has no META_START")
    arcs: list[Arc] = []
    systems: list[Item] = []
    i = 0
    while i < len(marks):
        i, arc, system = _segment(source, text, marks, i)
        arcs.append(arc)
        systems.append(system)
        one_system(source, systems[0], system)
    return ephemeris_of(name, arcs, header)


def ephemeris_of(name: str, arcs: Sequence[Arc], header: Sequence[Item]) -> Ephemeris:
    """The ephemeris of some arcs, with what is open about them."""
    frames = [frame for arc in arcs for frame in (arc.frame, *arc.covariance_frames)]
    degrees = any(arc.interpolation and arc.degree is None for arc in arcs)
    return Ephemeris(
        arcs=tuple(arcs), file=name, format="OEM", said=tuple((item.keyword, item.text) for item in header),
        open=(*unknown_axes(frames), *(("the degree of the interpolation is not given",) if degrees else ())),
    )  # fmt: skip


def check_version(source: Source, item: Item) -> None:
    """Refuse versions whose keywords may mean something else."""
    if not item.keyword.endswith("_VERS") or item.text not in ("1.0", "2.0", "3.0", "1", "2", "3"):
        source.refuse(item.line, f"the version of the message is {shown(item.text)}; 1.0, 2.0 and 3.0 are read")


class _Text(NamedTuple):
    """A message with the places where its lines end."""

    data: bytes
    newlines: Array

    def line(self, at: int) -> int:
        """Number of the line that a place is in."""
        return int(np.searchsorted(self.newlines, at)) + 1

    def part(self, start: int, end: int) -> tuple[bytes, int]:
        """What stands between two places, and the line where it begins."""
        return self.data[start:end], self.line(start)


def _items(source: Source, data: bytes, line: int) -> list[Item]:
    return [item for k, text in enumerate(lines_of(data)) if (item := key_value(source, text, line + k)) is not None]


def _segment(source: Source, text: _Text, marks: list[tuple[bytes, int, int]], i: int) -> tuple[int, Arc, Item]:
    """One segment, whose mark of beginning is the i-th; returns the place of the next one's."""
    word, at, after = marks[i]
    if word != b"META_START":
        source.refuse(text.line(at), f"{word.decode()} stands where META_START should")
    if i + 1 >= len(marks) or marks[i + 1][0] != b"META_STOP":
        source.refuse(text.line(at), "the metadata of a segment do not end with META_STOP")
    stop = marks[i + 1]
    found = metadata_of(source, _items(source, *text.part(after, stop[1])), text.line(stop[1]))
    i += 2
    end = marks[i][1] if i < len(marks) else len(text.data)
    dates, numbers, lines = _states(source, text, stop[2], end)
    blocks: list[Block] = []
    while i < len(marks) and marks[i][0] == b"COVARIANCE_START":
        if i + 1 >= len(marks) or marks[i + 1][0] != b"COVARIANCE_STOP":
            source.refuse(text.line(marks[i][1]), "the covariances of a segment do not end with COVARIANCE_STOP")
        blocks += _blocks(source, *text.part(marks[i][2], marks[i + 1][1]))
        _nothing(source, *text.part(marks[i + 1][2], marks[i + 2][1] if i + 2 < len(marks) else len(text.data)))
        i += 2
    if not len(dates):
        source.refuse(text.line(stop[1]), "the segment has no states")
    return i, arc_of(source, found, dates, numbers, lines, blocks), found["TIME_SYSTEM"]


def _nothing(source: Source, data: bytes, line: int) -> None:
    """Refuse what stands behind the covariances of a segment."""
    for k, text in enumerate(lines_of(data)):
        if text.strip() and not text.strip().startswith("COMMENT"):
            source.refuse(line + k, f"{shown(text.strip())} stands behind the covariances of a segment")


def _states(source: Source, text: _Text, start: int, end: int) -> tuple[Array, Array, Array]:
    """Dates, numbers (K, 9) and lines of states."""
    dates, numbers, lines = [np.zeros(0, dtype="S1")], [np.zeros((0, 9))], [np.zeros(0, dtype=np.int64)]
    for chunk in chunks(text.data, start, end, text.line(start)):
        counts = np.diff(chunk.words_before)
        rows = np.flatnonzero(counts)
        words = chunk.words(chunk.words_before[rows])
        rows = rows[words != b"COMMENT"]
        wrong = (counts[rows] != 7) & (counts[rows] != 10)
        if wrong.any():
            i = int(rows[np.argmax(wrong)])
            source.refuse(chunk.first_line + i, f"{shown(chunk.text(i))}: {_STATE}")
        first = chunk.words_before[rows]
        table = np.full((len(rows), 9), np.nan)
        for width in (6, 9):
            own = np.flatnonzero(counts[rows] == width + 1)
            if len(own):
                found, bad = read_numbers(chunk.words((first[own, None] + 1 + np.arange(width)).reshape(-1)))
                if bad.any():
                    i = int(rows[own[int(np.argmax(bad)) // width]])
                    source.refuse(chunk.first_line + i, f"{shown(chunk.text(i))}: {_STATE}")
                table[own, :width] = found.reshape(-1, width)
        if len(rows):
            dates.append(chunk.words(first))
            numbers.append(table)
            lines.append(rows + chunk.first_line)
    return np.concatenate(dates), np.concatenate(numbers), np.concatenate(lines)


def _blocks(source: Source, data: bytes, line: int) -> list[Block]:
    """Covariances between their marks: EPOCH, perhaps COV_REF_FRAME, and six rows of a lower triangle."""
    blocks: list[Block] = []
    date, frame, begun, rows = "", "", 0, list[list[float]]()
    texts = [(line + k, text.split("COMMENT")[0].strip() if text.strip().startswith("COMMENT") else text.strip())
             for k, text in enumerate(lines_of(data))]  # fmt: skip
    for number, text in texts:
        if not text:
            continue
        if "=" in text:
            item = key_value(source, text, number) or Item("", "", number)
            known(source, item, ("EPOCH", "COV_REF_FRAME"), "the covariances of an OEM")
            if rows:
                source.refuse(number, f"the covariance of line {begun} has {len(rows)} rows; it must have 6")
            if item.keyword == "EPOCH":
                date, begun = item.text, number
                frame = ""
            else:
                frame = item.text
            continue
        if not date:
            source.refuse(number, f"{shown(text)}: a covariance begins with EPOCH = date")
        rows.append(_row(source, text, number, len(rows)))
        if len(rows) == 6:
            blocks.append(Block(date, frame, [value for row in rows for value in row], begun))
            date, rows = "", []
    if rows or date:
        source.refuse(texts[-1][0], f"the covariance of line {begun} has {len(rows)} rows; it must have 6")
    return blocks


def _row(source: Source, text: str, line: int, place: int) -> list[float]:
    words = text.split()
    if len(words) != place + 1:
        source.refuse(line, f"row {place + 1} of a covariance has {place + 1} numbers, not {len(words)}: {shown(text)}")
    return [source.number(Item("the covariance", word, line)) for word in words]
