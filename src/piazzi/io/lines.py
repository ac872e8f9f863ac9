"""Measurements as they come: one line of comma-separated text at a time, checked as a file of them would be."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

from piazzi.io.csv import cells_to_tracking
from piazzi.io.dates import epoch_in
from piazzi.problem import Problem
from piazzi.problem.checks import Array
from piazzi.tables.cells import STATION, TIME, dated, parse_header, parse_rows, since

if TYPE_CHECKING:
    from piazzi.earth import Epoch


class Row(NamedTuple):
    """One measurement: time in seconds, station, values (m,) with NaN where missing."""

    time: float
    station: str
    values: Array


@dataclass(frozen=True, eq=False)
class RowReader:
    """Reads lines under one header, for the stations of one problem."""

    problem: Problem
    header: tuple[str, ...]
    comments: tuple[str, ...] = ()
    scale: str | None = None

    @classmethod
    def begin(
        cls, problem: Problem, first: bytes, line: int, comments: Sequence[str] = (), scale: str | None = None
    ) -> RowReader:
        """The reader of what follows a header line; raises ValueError for a line that cannot be one.

        `comments` stood above it; `scale` is that of dates that name none.
        """
        header, said = since(parse_header(first, line))
        reader = cls(problem, tuple(header), (*said, *comments), scale)
        example = parse_rows(_one_of_each(header, problem, reader.epoch), line, header, reader.comments)
        if example.dates is not None:
            reader.check_epoch(line)
        cells_to_tracking(example, problem, scale if example.dates is not None else None)
        return reader

    @property
    def epoch(self) -> Epoch | None:
        """What dates are counted from."""
        return epoch_in(self.comments) if self.problem.epoch is None else self.problem.epoch

    def check_epoch(self, line: int) -> None:
        """Raise ValueError where dates, which there are, have nothing to be counted from."""
        if self.epoch is None:
            raise ValueError(f"line {line}: there are dates, but the problem has no epoch, and no comment of the stream")

    def read(self, text: bytes, line: int) -> Row:
        """The measurement in a line; raises ValueError, naming the line, for one that does not fit."""
        cells = parse_rows(text.rstrip(b"\r\n"), line, list(self.header), self.comments)
        if cells.dates is not None:
            self.check_epoch(line)
        tracking = cells_to_tracking(cells, self.problem, self.scale)
        if len(tracking.values) != 1:
            raise ValueError(f"line {line}: it holds {len(tracking.values)} measurements")
        s = int(tracking.stations_of(self.problem)[0])
        station = self.problem.stations[s]
        return Row(float(tracking.times[0]), station.name, tracking.values[0, : len(station.noise)])


def _one_of_each(header: list[str], problem: Problem, epoch: Epoch | None) -> bytes:
    """A row that any good header accepts, of a station that measures one of its columns: for checking the header alone."""
    labels = [h.split("[")[0].strip() for h in header]
    components = {s.name: problem.model.sensor(s.sensor).components for s in problem.stations}
    station = next((name for name, own in components.items() if not {*own}.isdisjoint(labels)), next(iter(components), ""))
    filled = {TIME, *components.get(station, ())}
    cells = [station if label == STATION else "1" if label in filled else "" for label in labels]
    times = dated(header, ())
    if times.column >= 0:
        scale = times.scale or "UTC"
        cells[times.column] = "2000-01-01" if epoch is None else epoch.to(scale).removesuffix(scale)
    return ",".join(cells).encode()
