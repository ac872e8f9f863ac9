"""Tracking that is still being written: lines of a TDM or of a table as they come, with the conventions of whole files.

Some lines are read as a file of their own, under the header or the metadata that they stand below.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any

from piazzi.formats.observations import Observations
from piazzi.text import one_line

_TDM = re.compile(rb"\s*CCSDS_TDM_VERS\s*=")
_MARKS = (b"META_START", b"META_STOP", b"DATA_START", b"DATA_STOP")
_ANGLE = re.compile(rb"\s*ANGLE_([12])\s*=")
_PLACE = re.compile(r"\bline (\d+)")
_NUMBER = re.compile(rb"\s*[-+]?\d*\.?\d+([eE][-+]?\d+)?\s*")
LONGEST_LINE = 2**16

Reader = Callable[[bytes, str], Observations]


class Lines:
    """Takes lines, and gives the measurements of those that stand by themselves.

    Parameters
    ----------
    name : of the stream, for messages
    read : makes observations of a text and that name, as `tracking_of` does
    columns : whether names of columns are told, so that a table may have no header
    """

    def __init__(self, name: str, read: Reader, columns: bool = False) -> None:
        self.name, self._read, self._columns = name, read, columns
        self._kind = ""
        self._head: list[bytes] = []  # of the file
        self._meta: list[bytes] = []  # of the segment
        self._state = "head"
        self._waiting: list[tuple[int, bytes]] = []
        self.count = 0
        self.bad: list[str] = []  # lines that cannot be read, told since `measurements` was asked last

    def add(self, line: bytes) -> None:
        """One more line; raises ValueError where the stream is of no format that is followed."""
        self.count += 1
        text = line.rstrip(b"\r\n")
        if not text.strip():
            return
        if not self._kind and not text.lstrip().startswith((b"#", b"COMMENT")):
            self._kind = "TDM" if _TDM.match(text) else "table"
            if self._kind == "table" and re.match(rb"\s*(<|CCSDS_|[Hh]1\s|#[a-d][PV])", text):
                raise ValueError(f"{self.name}: line {self.count}: {_shown(text)}: a TDM (KVN) or a table (CSV) is followed")
        if self._kind == "TDM":
            self._tdm(text)
        elif self._state == "head":
            self._heading(text)
        elif not text.startswith(b"#"):
            self._waiting.append((self.count, text))

    def measurements(self, all_of_them: bool = False) -> Observations | None:
        """Those of the lines so far that were not given before, None where there are none.

        An angle waits for its partner, unless `all_of_them` are asked for.

        Raises
        ------
        ValueError
            For what is wrong with the header, or left open by it; a single line that is wrong is put among `bad` instead.
        """
        ready, self._waiting = (self._waiting, []) if all_of_them else self._whole()
        if not ready:
            return None
        try:
            return self._of(ready)
        except ValueError as error:
            if not _PLACE.search(str(error)) or (len(ready) == 1 and not self._of_row(error, ready)):
                raise
        found = [rows for group in _together(ready) if (rows := self._one(group)) is not None]
        from piazzi.formats.joining import concatenate

        return concatenate(found) if found else None

    def _one(self, lines: list[tuple[int, bytes]]) -> Observations | None:
        """The measurements of lines that belong together, None where they cannot be read."""
        try:
            return self._of(lines)
        except ValueError as error:
            if not self._of_row(error, lines):
                raise
            self.bad.append(str(error))
            return None

    def _of_row(self, error: ValueError, lines: list[tuple[int, bytes]]) -> bool:
        """Whether an error is of one of these lines, not of what stands above."""
        found = _PLACE.search(str(error))
        return found is not None and int(found[1]) >= lines[0][0]

    def _of(self, lines: list[tuple[int, bytes]]) -> Observations:
        """The measurements of lines below their header; errors name the lines of the stream."""
        head = [*self._head, *self._meta]
        tail = [b"DATA_STOP"] if self._kind == "TDM" else []
        text = b"\n".join([*head, *(line for _, line in lines), *tail]) + b"\n"
        try:
            return self._read(text, self.name)
        except ValueError as error:

            def there(match: re.Match[str]) -> str:
                k = int(match[1]) - len(head) - 1
                return f"line {lines[min(k, len(lines) - 1)][0]}" if k >= 0 else match[0]

            raise ValueError(_PLACE.sub(there, str(error))) from None

    def _heading(self, text: bytes) -> None:
        """A line before the data of a table."""
        if text.startswith(b"#"):
            self._head.append(text)
            return
        self._state = "data"
        cells = re.split(rb"[,;\t]|\s+", text.strip())
        if self._columns and any(_NUMBER.fullmatch(cell) for cell in cells):
            self._waiting.append((self.count, text))  # there is no header
        else:
            self._head.append(text)

    def _tdm(self, text: bytes) -> None:
        mark = text.strip()
        if mark not in _MARKS:
            if self._state == "data":
                self._waiting += [] if re.match(rb"\s*COMMENT(\s|$)", text) else [(self.count, text)]
            else:
                (self._head if self._state == "head" else self._meta).append(text)
            return
        if self._waiting:
            raise ValueError(f"{self.name}: line {self.count}: {mark.decode()} stands among rows that were not read yet")
        if mark == b"META_START":
            self._meta, self._state = [mark], "meta"
        elif mark == b"DATA_STOP":
            self._state = "between"
        else:
            self._meta.append(mark)
            self._state = "data" if mark == b"DATA_START" else self._state

    def _whole(self) -> tuple[list[tuple[int, bytes]], list[tuple[int, bytes]]]:
        """Lines that may be read, and those that wait: an angle of a TDM without its partner."""
        if self._kind != "TDM":
            return self._waiting, []
        sides = [match[1] if (match := _ANGLE.match(line)) else b"" for _, line in self._waiting]
        if sides.count(b"1") == sides.count(b"2"):
            return self._waiting, []
        last = max(i for i, side in enumerate(sides) if side)
        return self._waiting[:last], self._waiting[last:]


def _together(lines: list[tuple[int, bytes]]) -> list[list[tuple[int, bytes]]]:
    """Lines one by one, angles with their partner."""
    groups: list[list[tuple[int, bytes]]] = []
    for line in lines:
        side = _ANGLE.match(line[1])
        before = _ANGLE.match(groups[-1][-1][1]) if groups else None
        if side and before and side[1] != before[1] and len(groups[-1]) == 1:
            groups[-1].append(line)
        else:
            groups.append([line])
    return groups


def is_mark(line: bytes) -> bool:
    """Whether a line of a TDM begins or ends something."""
    return line.strip() in _MARKS


def _shown(text: bytes) -> str:
    return repr(one_line(text[:60].decode("utf-8", "replace"), 60))


def reader(told: Any, axes: Any) -> Reader:
    """A reader by the words of conventions; `axes` settles those of rows that name none."""
    from piazzi.formats.recognise import tracking_of

    words = {name: value for name, value in dict(told).items() if name != "frame"}
    return lambda data, name: axes(tracking_of(data, name, **words))
