"""``piazzi estimate SCENARIO --follow -``: a live tracker in a pipe, a measurement a line in, an estimate a line out."""

from __future__ import annotations

import hashlib
import json
import os
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

import click
import numpy as np

from piazzi.cli.output import check_place
from piazzi.cli.running import DONE, say
from piazzi.cli.sources import STDIN

if TYPE_CHECKING:
    from piazzi.io.rows import Row, RowReader
    from piazzi.problem import Problem

BETWEEN_CHECKPOINTS = 0.05  # seconds: the file is synced to disk each time
LONGEST_LINE = 2**16


def follow(problem: Problem, estimator: Any, source: str, output: str | None, checkpoint: str | None, as_json: bool) -> int:
    """Feed the lines of a file or of standard input to an estimator in progress; the exit status.

    A line that cannot be used is reported on stderr and skipped.  With a checkpoint file the run goes on where a killed one
    stood: a stream that begins as before is skipped to that place, and a file given by -o is cut back to it.
    """
    if not callable(getattr(estimator, "start", None)):
        raise click.UsageError(
            "--follow needs an estimator that goes forward: ekf, ukf, srekf or window", click.get_current_context()
        )
    from piazzi.io.checkpoint import fingerprint

    with ExitStack() as stack:
        stream: IO[bytes] = sys.stdin.buffer if source == STDIN else stack.enter_context(open(source, "rb"))
        run = _Run(problem, estimator.start(problem), fingerprint(problem, estimator), checkpoint, as_json)
        run.resume()
        run.sink = _sink(stack, output, run.written)
        try:
            run.consume(stream)
        except ValueError as error:
            raise ValueError(f"{'standard input' if source == STDIN else source}: {error}") from None
        finally:
            run.save(force=True)
    say(run.summary())
    return DONE


def _sink(stack: ExitStack, output: str | None, written: int) -> IO[bytes]:
    """Where estimates go: standard output, or a file cut back to what the checkpoint knows of."""
    if output in (None, STDIN):
        return sys.stdout.buffer
    assert output is not None
    file: IO[bytes] = stack.enter_context(Path(output).open("r+b" if os.path.exists(output) else "w+b"))  # noqa: SIM115 (the stack closes it)
    file.truncate(written)
    file.seek(0, os.SEEK_END)
    if file.tell() < written:
        raise ValueError(f"{output}: has {file.tell()} bytes, but the checkpoint was made after {written}")
    return file


@dataclass
class _Run:
    """One stream being followed."""

    problem: Problem
    session: Any
    mark: Any
    checkpoint: str | None
    as_json: bool
    sink: IO[bytes] = field(default_factory=lambda: sys.stdout.buffer)
    lines: int = 0
    written: int = 0
    opening: bytes = b""
    skip: int = 0
    taken: int = 0
    refused: int = 0
    rejected: int = 0
    bad: int = 0
    saved_at: float = 0.0
    resumed: bool = False

    def __post_init__(self) -> None:
        self.consumed = hashlib.sha256()
        self.expected = b""

    # ---- checkpoints ---------------------------------------------------------------------------------------------

    def resume(self) -> None:
        """Take up a checkpoint where there is one."""
        if self.checkpoint is None:
            return
        from piazzi.io.checkpoint import read_checkpoint

        check_place(self.checkpoint)
        if not os.path.exists(self.checkpoint):
            return
        session, progress = read_checkpoint(self.checkpoint, self.mark, self.session.saved_names)
        try:
            self.session.restore(session)
        except ValueError as error:
            raise ValueError(f"{self.checkpoint}: {error}") from None
        self.skip, self.written = progress.lines, progress.written
        self.expected, self.opening = progress.consumed, progress.opening
        self.resumed = True

    def save(self, force: bool = False) -> None:
        """Write the checkpoint, unless one was written just now."""
        now = time.monotonic()
        if self.checkpoint is None or self.skip or not self.lines or not (force or now - self.saved_at > BETWEEN_CHECKPOINTS):
            return
        from piazzi.io.checkpoint import Progress, write_checkpoint

        progress = Progress(self.lines, self.written, self.consumed.digest(), self.opening)
        write_checkpoint(self.checkpoint, self.mark, self.session.checkpoint(), progress)
        self.saved_at = time.monotonic()

    # ---- the stream ----------------------------------------------------------------------------------------------

    def consume(self, stream: IO[bytes]) -> None:
        """Every line in turn."""
        from piazzi.io.rows import RowReader

        reader: RowReader | None = None
        first: list[bytes] = []
        for line in _lines(stream):
            self.lines += 1
            self.consumed.update(line)
            if not line.strip() or line.startswith(b"#"):
                continue
            if len(first) < 2:
                first.append(line)
                self._recognise(first)
            if reader is None:
                reader = RowReader.begin(self.problem, line.rstrip(b"\r\n"), self.lines)
                self._begin_output()
            elif not self._skipped():
                self._take(reader, line)
        if reader is None:
            raise ValueError("there are no measurements: not even a line that names the columns")

    def _recognise(self, first: list[bytes]) -> None:
        """By its header and first measurement, whether this is the stream of the checkpoint, to be skipped as far as it got."""
        if len(first) < 2:
            return
        opening = hashlib.sha256(b"".join(first)).digest()
        if self.skip and opening != self.opening:
            self.skip = 0  # a stream that goes on: all of it is new
        self.opening = opening

    def _skipped(self) -> bool:
        if self.lines < self.skip:
            return True
        if self.lines == self.skip:
            self.skip = 0
            if self.consumed.digest() != self.expected:
                raise ValueError(f"line {self.lines}: the stream is not the one that the checkpoint was made from")
            return True
        return False

    def _take(self, reader: RowReader, line: bytes) -> None:
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
        self.taken += 1
        if getattr(self.session, "rejected", False):
            self.rejected += 1
            say(f"line {self.lines}: {row.station} at t = {row.time:g} s is beyond the gate; rejected")
        self._write(row)
        self.save()

    # ---- estimates -----------------------------------------------------------------------------------------------

    def _begin_output(self) -> None:
        if not self.as_json and not self.resumed:
            names = self.problem.model.names
            self._emit(",".join(["time", *names, *("sigma_" + n for n in names)]))

    def _write(self, row: Row) -> None:
        sigma = np.sqrt(np.maximum(np.diagonal(self.session.covariance), 0.0))
        mean, t = self.session.mean.tolist(), float(self.session.time)
        if self.as_json:
            values = {"time": t, "station": row.station, "mean": mean, "sigma": sigma.tolist()}
            self._emit(json.dumps({k: _finite(v) for k, v in values.items()}, allow_nan=False))
        else:
            self._emit(",".join(repr(v) for v in [t, *mean, *sigma.tolist()]))

    def _emit(self, text: str) -> None:
        data = (text + "\n").encode()
        self.sink.write(data)
        self.sink.flush()
        self.written += len(data)

    def summary(self) -> str:
        """What became of the lines."""
        parts = [f"{_counted(self.taken, 'measurement')} taken"]
        parts += [f"{self.rejected} rejected by the gate"] if self.rejected else []
        parts += [f"{self.refused} refused as too old"] if self.refused else []
        parts += [f"{_counted(self.bad, 'line')} skipped"] if self.bad else []
        return ", ".join(parts)


def _counted(number: int, what: str) -> str:
    return f"{number} {what}{'s' * (number != 1)}"


def _finite(value: Any) -> Any:
    """NaN and infinity as None."""
    if isinstance(value, list):
        return [_finite(v) for v in value]
    return None if isinstance(value, float) and not np.isfinite(value) else value


def _lines(stream: IO[bytes]) -> Iterator[bytes]:
    """Lines as they arrive; one without end is cut into pieces that cannot be measurements."""
    while line := stream.readline(LONGEST_LINE):
        yield line
