"""``piazzi determine ... --follow``: an orbit that is carried on while its tracking is still being written."""

from __future__ import annotations

import json
import os
import select
import signal
import stat
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from piazzi.cli.running import say
from piazzi.cli.sink import Sink
from piazzi.cli.sources import STDIN

if TYPE_CHECKING:
    from piazzi.determination.case import Case
    from piazzi.determination.following import Following
    from piazzi.determination.live import Taken
    from piazzi.determination.result import Determination
    from piazzi.formats.streaming import Lines

WAIT = 0.2  # s, at which a file is looked at again, and Ctrl-C heard
IDLE = 1.0  # s without a line, after which an angle does not wait for its partner any more
PIECE = 2**16


class Stopped:
    """Whether Ctrl-C was pressed; pressed again it ends the program at once."""

    def __init__(self) -> None:
        self.yes = False

    def heard(self, *_: Any) -> None:
        """What the signal calls."""
        self.yes = True
        signal.signal(signal.SIGINT, signal.default_int_handler)


def follow(files: Sequence[str], case: Case, notes: Any) -> Determination | None:
    """Follow the last of the files, "-" for standard input: each row on stdout, each pass as it ends on stderr.

    Returns the orbit at its end, None where there is none.

    A line that cannot be read is told of on stderr and left.
    """
    from piazzi.determination.following import Following
    from piazzi.determination.passed import Passes

    *before, source = files
    with _interruptible() as stopped:
        live = Following(*before, case=case)
        live.announce = lambda step: say("an orbit is looked for in the first rows ...")
        stream = live.lines("standard input" if source == STDIN else source)
        sink = Sink(None)
        begun, passes = False, Passes()
        for taken in _rows(live, stream, source, stopped):
            if taken and not begun:
                say(f"an orbit is known from {len(taken)} rows on; {live.name} carries it on")
                begun = True
            for row in taken:
                for over in passes.take(row):
                    say(str(over))
                sink.emit(json.dumps(row.to_dict(), allow_nan=False) if case.json else str(row))
        for over in passes.end():
            say(str(over))
    if not live.success:
        say(f"not determined: {live.waiting}")
        return None
    return live.determination(notes)


def _rows(live: Following, stream: Lines, source: str, stopped: Stopped) -> Iterator[list[Taken]]:
    """What becomes of the rows of each piece of the stream."""
    from piazzi.formats.streaming import is_mark

    rest, last = b"", time.monotonic()
    for piece in _pieces(source, stopped):
        lines = (rest + piece).split(b"\n")
        rest = lines.pop()
        for line in lines:
            if is_mark(line):
                yield live.take(stream.measurements(all_of_them=True))
            stream.add(line)
        last = time.monotonic() if piece else last
        yield live.take(stream.measurements(all_of_them=time.monotonic() - last > IDLE))
        _tell(stream)
    if rest:
        stream.add(rest)
    yield live.take(stream.measurements(all_of_them=True), last=True)
    _tell(stream)


def _tell(stream: Lines) -> None:
    for text in stream.bad:
        say(f"{text}; skipped")
    stream.bad.clear()


def _pieces(source: str, stopped: Stopped) -> Iterator[bytes]:
    """Bytes as they come, none every now and then: of a pipe to its end, of a file that grows until Ctrl-C."""
    handle = sys.stdin.fileno() if source == STDIN else os.open(source, os.O_RDONLY | getattr(os, "O_BINARY", 0))
    try:
        plain = stat.S_ISREG(os.fstat(handle).st_mode)
        grows, size = plain and source != STDIN, 0
        while not stopped.yes:
            if not plain and os.name == "posix" and not select.select([handle], [], [], WAIT)[0]:
                yield b""
                continue
            piece = os.read(handle, PIECE)
            size += len(piece)
            if piece:
                yield piece
            elif not grows:
                return
            elif os.fstat(handle).st_size < size:
                raise ValueError(f"{source}: the file has become shorter while it was followed")
            else:
                yield b""
                time.sleep(WAIT)
    finally:
        if source != STDIN:
            os.close(handle)


@contextmanager
def _interruptible() -> Iterator[Stopped]:
    """Ctrl-C asks for the end once."""
    stopped = Stopped()
    before = signal.signal(signal.SIGINT, stopped.heard)
    try:
        yield stopped
    finally:
        signal.signal(signal.SIGINT, before)
