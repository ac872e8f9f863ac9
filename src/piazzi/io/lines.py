"""Measurements as they come: one line of comma-separated text at a time, checked as a file of them would be."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from piazzi.io.cells import parse_header, parse_rows
from piazzi.io.csv import cells_to_tracking
from piazzi.problem import Problem
from piazzi.problem.checks import Array


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

    @classmethod
    def begin(cls, problem: Problem, first: bytes, line: int) -> RowReader:
        """The reader of what follows a header line; raises ValueError for a line that cannot be one."""
        header = parse_header(first, line)
        cells_to_tracking(parse_rows(_one_of_each(header, problem), line, header), problem)
        return cls(problem, tuple(header))

    def read(self, text: bytes, line: int) -> Row:
        """The measurement in a line; raises ValueError, naming the line, for one that does not fit."""
        tracking = cells_to_tracking(parse_rows(text.rstrip(b"\r\n"), line, list(self.header)), self.problem)
        if len(tracking.values) != 1:
            raise ValueError(f"line {line}: it holds {len(tracking.values)} measurements")
        s = int(tracking.stations_of(self.problem)[0])
        station = self.problem.stations[s]
        return Row(float(tracking.times[0]), station.name, tracking.values[0, : len(station.noise)])


def _one_of_each(header: list[str], problem: Problem) -> bytes:
    """A row that any good header accepts, of a station that measures one of its columns: for checking the header alone."""
    labels = [h.split("[")[0].strip() for h in header]
    components = {s.name: problem.model.sensor(s.sensor).components for s in problem.stations}
    station = next((name for name, own in components.items() if not {*own}.isdisjoint(labels)), next(iter(components), ""))
    filled = {"time", *components.get(station, ())}
    cells = [station if label == "station" else "1" if label in filled else "" for label in labels]
    return ",".join(cells).encode()
