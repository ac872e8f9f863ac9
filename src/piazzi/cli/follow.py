"""``piazzi estimate SCENARIO --follow -``: a live tracker in a pipe, a measurement a line in, an estimate a line out."""

from __future__ import annotations

import hashlib
import json
import os
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack, closing
from dataclasses import dataclass, field
from typing import IO, TYPE_CHECKING, Any

import click
import numpy as np

from piazzi.cli.output import check_place
from piazzi.cli.running import DONE, NOT_ESTIMATED, say
from piazzi.cli.sink import Sink
from piazzi.cli.sources import STDIN

if TYPE_CHECKING:
    from piazzi.io.lines import Row, RowReader
    from piazzi.problem import Problem

BETWEEN_CHECKPOINTS = 0.05  # seconds: the file is synced to disk each time
LONGEST_LINE = 2**16
MOST_COMMENTS = 100


def follow(
    problem: Problem,
    estimator: Any,
    source: str,
    output: str | None,
    checkpoint: str | None,
    as_json: bool,
    scale: str | None = None,
) -> int:
    """Feed the lines of a file or of standard input to an estimator in progress; the exit status.

    `scale` is that of dates that name none.

    A line that cannot be used is reported on stderr and skipped.  With a checkpoint file the run goes on where a killed one
    stood: a stream that begins as before is skipped to that place, and a file given by -o is cut back to it.  An estimate that
    cannot be used ends it: its line is not written, and the last checkpoint is left as it was.
    """
    if not callable(getattr(estimator, "start", None)):
        raise click.UsageError(
            "--follow needs an estimator that goes forward: ekf, ukf, srekf or window", click.get_current_context()
        )
    from piazzi.io.checkpoint import fingerprint

    with ExitStack() as stack:
        stream: IO[bytes] = sys.stdin.buffer if source == STDIN else stack.enter_context(open(source, "rb"))
        run = _Run(problem, estimator.start(problem), fingerprint(problem, estimator), checkpoint, as_json, scale)
        known = run.resume()
        run.sink = stack.enter_context(closing(Sink(output, known)))
        try:
            run.consume(stream)
        except ValueError as error:
            raise ValueError(f"{'standard input' if source == STDIN else source}: {error}") from None
        finally:
            run.save(force=True)
    say(run.summary())
    if run.failure:
        say(run.failure)
    return NOT_ESTIMATED if run.failure else DONE


@dataclass
class _Run:
    """One stream being followed."""

    problem: Problem
    session: Any
    mark: Any
    checkpoint: str | None
    as_json: bool
    scale: str | None = None
    sink: Sink = field(default_factory=lambda: Sink(None))
    lines: int = 0
    opening: bytes = b""
    skip: int = 0
    taken: int = 0
    refused: int = 0
    rejected: int = 0
    bad: int = 0
    saved_at: float = 0.0
    resumed: bool = False
    halfway: bool = False
    failure: str = ""
    reader: RowReader | None = None
    first: list[bytes] = field(default_factory=list)
    comments: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.consumed = hashlib.sha256()
        self.expected = b""

    # ---- checkpoints ---------------------------------------------------------------------------------------------

    def resume(self) -> int:
        """Take up a checkpoint where there is one; how many bytes of estimates were written before it."""
        if self.checkpoint is None:
            return 0
        from piazzi.io.checkpoint import read_checkpoint

        check_place(self.checkpoint)
        if not os.path.exists(self.checkpoint):
            return 0
        session, progress = read_checkpoint(self.checkpoint, self.mark, self.session.saved_names)
        try:
            self.session.restore(session)
        except ValueError as error:
            raise ValueError(f"{self.checkpoint}: {error}") from None
        self.skip, self.expected, self.opening = progress.lines, progress.consumed, progress.opening
        self.resumed = True
        return progress.written

    def save(self, force: bool = False) -> None:
        """Write the checkpoint, unless one was written just now, or a line is taken only by halves."""
        due = force or time.monotonic() - self.saved_at > BETWEEN_CHECKPOINTS
        if self.checkpoint is None or self.skip or not self.lines or self.halfway or self.failure or not due:
            return
        from piazzi.io.checkpoint import Progress, write_checkpoint

        try:
            session = self.session.checkpoint()
        except ValueError as error:
            self.failure = f"line {self.lines}: {error}; it cannot be kept"
            return
        self.sink.sync()  # first, so that no checkpoint knows of more than is there
        progress = Progress(self.lines, self.sink.written, self.consumed.digest(), self.opening)
        write_checkpoint(self.checkpoint, self.mark, session, progress)
        self.saved_at = time.monotonic()

    # ---- the stream ----------------------------------------------------------------------------------------------

    def consume(self, stream: IO[bytes]) -> None:
        """Every line in turn."""
        for line in _lines(stream):
            self.halfway = True
            self.lines += 1
            self.consumed.update(line)
            empty = not line.strip() or line.startswith(b"#")
            if not empty:
                self._match_checkpoint(line)
            elif self.reader is None and line.startswith(b"#"):
                self.comments = [*self.comments[-MOST_COMMENTS:], line[1:].decode("utf-8", "replace").strip()]
            known = self._known()
            if not empty:
                self._read(line, known)
            self.halfway = False
            self.save()
            if self.failure:
                return
        if self.reader is None:
            raise ValueError("there are no measurements: not even a line that names the columns")
        if not self.skip:
            self.sink.begin()

    def _match_checkpoint(self, line: bytes) -> None:
        """By its header and first measurement, whether this is the stream of the checkpoint, to be skipped as far as it got."""
        if len(self.first) == 2:
            return
        self.first.append(line)
        if len(self.first) == 2:
            opening = hashlib.sha256(b"".join(self.first)).digest()
            if self.skip and opening != self.opening:
                self.skip = 0  # a stream that goes on: all of it is new
            self.opening = opening

    def _known(self) -> bool:
        """Whether the checkpoint was made after this line; raises ValueError at its last one if others came before."""
        if not self.skip:
            return False
        if self.lines == self.skip:
            self.skip = 0
            if self.consumed.digest() != self.expected:
                raise ValueError(f"line {self.lines}: the stream is not the one that the checkpoint was made from")
        return True

    def _read(self, line: bytes, known: bool) -> None:
        """A line with something in it: the header, or a measurement, of which a known one was taken before."""
        from piazzi.io.lines import RowReader

        if self.reader is None:
            header = line.rstrip(b"\r\n")
            self.reader = RowReader.begin(self.problem, header, self.lines, self.comments, self.scale)
            self._begin_output()
        elif not known:
            self._update(self.reader, line)

    def _update(self, reader: RowReader, line: bytes) -> None:
        try:
            row = reader.read(line, self.lines)
            if self.session.update(row.station, row.values, row.time) is False:
                self.refused += 1
                say(f"line {self.lines}: {row.station} at t = {row.time:g} s is older than the window; refused")
                return
        except ValueError as error:
            self.bad += 1
            text = str(error)
            say((text if text.startswith("line ") else f"line {self.lines}: {text}") + "; skipped")
            return
        if not self.session.success:
            self.failure = f"line {self.lines}: with {row.station} at t = {row.time:g} s, {self.session.message}"
            return
        self.taken += 1
        if getattr(self.session, "rejected", False):
            self.rejected += 1
            say(f"line {self.lines}: {row.station} at t = {row.time:g} s is beyond the gate; rejected")
        self._write(row)

    # ---- estimates -----------------------------------------------------------------------------------------------

    def _begin_output(self) -> None:
        if not self.as_json and not self.resumed:
            names, epoch = self.problem.model.names, self._epoch
            if epoch is not None:
                self.sink.emit(f"# epoch = {epoch.exact()}")
            self.sink.emit(",".join(["time", *names, *("sigma_" + n for n in names)]))

    def _write(self, row: Row) -> None:
        sigma = np.sqrt(np.diagonal(self.session.covariance)).tolist()
        mean, t = self.session.mean.tolist(), float(self.session.time)
        if self.as_json:
            date = {} if self._epoch is None else {"date": str(self._epoch + t)}
            said = {"time": t, **date, "station": row.station, "mean": mean, "sigma": sigma}
            self.sink.emit(json.dumps(said, allow_nan=False))
        else:
            self.sink.emit(",".join(repr(v) for v in [t, *mean, *sigma]))

    @property
    def _epoch(self) -> Any:
        """The instant that times are past, where the problem or the stream says one."""
        return None if self.reader is None else self.reader.epoch

    def summary(self) -> str:
        """What became of the lines."""
        parts = [f"{_counted(self.taken, 'measurement')} taken"]
        parts += [f"{self.rejected} rejected by the gate"] if self.rejected else []
        parts += [f"{self.refused} refused as too old"] if self.refused else []
        parts += [f"{_counted(self.bad, 'line')} skipped"] if self.bad else []
        return ", ".join(parts)


def _counted(number: int, what: str) -> str:
    return f"{number} {what}{'s' * (number != 1)}"


def _lines(stream: IO[bytes]) -> Iterator[bytes]:
    """Lines as they arrive; one without end is cut into pieces that cannot be measurements."""
    while line := stream.readline(LONGEST_LINE):
        yield line
