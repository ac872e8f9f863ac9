"""Measurements as comma-separated text: a row for each, with time, station, and the sensors' components by name."""

from __future__ import annotations

import csv
import os
import re
import warnings
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import islice
from typing import TYPE_CHECKING, Any

import numpy as np

from piazzi.io.atomic import atomic_path
from piazzi.io.dates import has_weeks, times_of
from piazzi.io.naming import TRUTH, fitting, named, own_names
from piazzi.opening import RecordingWarning
from piazzi.problem import Problem, Tracking
from piazzi.problem.checks import Array
from piazzi.problem.epochs import epoch_of
from piazzi.scenarios import Recording
from piazzi.tables.cells import STATION, TIME, Cells, read_cells
from piazzi.tables.names import SECONDS, WEEK
from piazzi.text import escape_formula, nearest, unescape_formula
from piazzi.units import Unit, Units

if TYPE_CHECKING:
    from piazzi.estimate.estimator import Estimate

_UNIT = re.compile(r"(.*?)\s*\[([^\[\]]*)\]")


def read_csv(
    path: str | os.PathLike[str],
    problem: Problem,
    scale: str | None = None,
    columns: Mapping[str, str] | None = None,
    usual: Recording | None = None,
) -> Tracking:
    """The measurements in a file, of a problem's stations.

    The first line names the columns, in letters of any case: ``time``, ``station`` (not needed where there is one), the
    components of the sensors, and, where the truth is known, ``truth:`` and a state.  Empty cells are missing values; columns
    that a station in the file needs may be empty, but not absent.  A name behind an apostrophe, as spreadsheets are kept from
    formulas, is that name.
    Numbers are in SI and radians (in the model's own units, where one made in Python names others), or in the unit that a
    column names, as in ``bearing [deg]``, which must be of the column's kind.

    Times are seconds, or dates with their scale: in each cell, as the unit of the column, ``time[UTC]``, or as `scale`.  See
    `times_of` for what they are counted from.  Where file and problem each have an epoch, times become those past the
    problem's.  Instead of a time a row may have ``week`` and ``sow``, weeks of GPS and seconds of them.

    `columns` says what columns are called that have other names, ``{"range": "RNG [km]"}``; what it leaves out and is not
    known here is left alone.  Rows that are out of order are sorted, and a warning says so; another one says which marks
    separate cells where commas do not.  `usual` stands for what is not said, where it fits the file.

    Raises
    ------
    OSError
        Where the file cannot be read.
    ValueError
        For columns, stations or cells that do not fit; the message names the file and the line.
    """
    try:
        usual = usual or Recording()
        cells = read_cells(path, lambda header: named(header, problem, columns or fitting(header, usual.columns)))
        unsaid = cells.dates is not None and cells.scale is None
        tracking, falls = _in_order(cells, problem, scale or (usual.scale if unsaid else None))
    except ValueError as error:
        raise ValueError(f"{os.fspath(path)}: {error}") from None
    notes = (*cells.notes, *([f"{falls:,} of its rows were before the one above them: sorted"] if falls else []))
    for note in notes:
        warnings.warn(f"{os.fspath(path)}: {note}", RecordingWarning, stacklevel=3)
    return tracking


def write_csv(path: str | os.PathLike[str], problem: Problem, tracking: Tracking) -> None:
    """Write measurements, and the truth where there is one, such that `read_csv` gives them back bit for bit.

    Raises
    ------
    OSError
        Where the file cannot be written.
    ValueError
        Where the tracking does not fit the problem, or a component is called like another column.
    """
    station, values = tracking.stations_of(problem), tracking.padded(problem.model.width)
    header, columns = [_time(problem, tracking)], [_written(tracking.row_times)]
    if tracking.row_stations is not None:
        cells = {name: escape_formula(str(name)) for name in dict.fromkeys(np.asarray(tracking.row_stations).tolist())}
        header, columns = [*header, STATION], [*columns, [cells[name] for name in np.asarray(tracking.row_stations).tolist()]]
    for name, column in _components(problem, station, values).items():
        header, columns = [*header, name], [*columns, _written(column)]
    if tracking.truth is not None:
        epoch = np.repeat(np.arange(len(tracking.times)), np.diff(tracking.first_row))
        for i, state in enumerate(problem.model.names):
            header, columns = [*header, TRUTH + state], [*columns, _written(tracking.truth[epoch, i])]
    if len(set(header)) < len(header):
        twice = next(h for h in header if header.count(h) > 1)
        raise ValueError(f"two columns would be called {twice!r}: rename the component")
    write_rows(path, header, columns)


def _time(problem: Problem, tracking: Tracking) -> str:
    """What the column of times is called: with what they are seconds of TT past, where that is known."""
    epoch = epoch_of(problem, tracking)
    return TIME if epoch is None else f"{TIME}[s past {epoch.exact()}]"


def write_estimate_csv(path: str | os.PathLike[str], estimate: Estimate) -> None:
    """Write a row for each epoch: time, means, sigmas, the covariances of every pair, and the view; raises OSError."""
    names, P = estimate.names, estimate.covariance
    time = _time(estimate.problem, estimate.tracking)
    header, columns = [time, *names], [_written(estimate.times), *(_written(estimate.mean[:, i]) for i in range(len(names)))]
    for i, name in enumerate(names):
        header.append(f"sigma_{name}")
        columns.append(_written(np.sqrt(np.maximum(P[:, i, i], 0.0))))
    for i, name in enumerate(names):
        for j in range(i, len(names)):
            header.append(f"cov_{name}_{names[j]}")
            columns.append(_written(P[:, i, j]))
    write_rows(path, [*header, "view"], [*columns, [estimate.view] * len(estimate.times)])


def write_rows(path: str | os.PathLike[str], header: Sequence[str], columns: Sequence[Iterable[Any]]) -> None:
    """Write columns under their names, whole or not at all; numbers are written such that they read back bit for bit."""
    with atomic_path(path) as work, open(work, "w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(header)
        rows = zip(*columns, strict=True)
        while block := list(islice(rows, 10_000)):
            writer.writerows(block)


def _written(column: Array) -> list[Any]:
    """Numbers as Python's own, whose text is exact; "" for NaN."""
    out: list[Any] = column.tolist()
    for i in np.flatnonzero(np.isnan(column)):
        out[i] = ""
    return out


def _components(problem: Problem, station: Array, values: Array) -> dict[str, Array]:
    """Column of every component's name, NaN at rows whose station has no such component."""
    out: dict[str, Array] = {}
    for s, place in enumerate(problem.stations):
        rows = station == s
        for k, component in enumerate(problem.model.sensor(place.sensor).components):
            column = out.setdefault(component, np.full(len(values), np.nan))
            column[rows] = values[rows, k]
    return out


def _in_own_units(cells: Cells, problem: Problem) -> Cells:
    """The same table with the units of its column names taken into account, and names without what keeps them from formulas."""
    numbers: dict[str, Array] = {}
    for name, column in cells.numbers.items():
        match = _UNIT.fullmatch(name)
        label, factor = (match[1], _factor(name, match[1], match[2], problem)) if match else (name, 1.0)
        if label in numbers:
            raise ValueError(f"two columns are called {label!r}")
        with np.errstate(over="ignore"):
            numbers[label] = column if factor == 1.0 else column * factor
    return replace(cells.renamed(unescape_formula), numbers=numbers)


def _factor(column: str, label: str, text: str, problem: Problem) -> float:
    """What turns numbers in the unit `text` into those of the model.

    Raises
    ------
    ValueError
        Where nothing that is called `label` is of such a kind, or where stations need different factors.
    """
    unit, own = Units().unit(text), _own_units(label, problem)
    fitting = [mine for mine in own.values() if mine is None or mine.powers == unit.powers]
    if own and not fitting:
        raise ValueError(f"column {column[:60]!r} has no unit of its kind: {label!r} is in {', '.join(sorted(own))}")
    factors = {unit.factor / (1.0 if mine is None else mine.factor) for mine in fitting} or {unit.factor}
    if len(factors) > 1:
        known = ", ".join(sorted(name or "no unit" for name in own))
        raise ValueError(f"column {column[:60]!r} must name no unit: {label!r} is in {known}, by station")
    return factors.pop()


def _own_units(label: str, problem: Problem) -> dict[str, Unit | None]:
    """The units that the model names for what is in a column, of all sensors that have it; None for one that is not known.

    In a scenario they are SI; a model made in Python names what its numbers are in, which may be others, or none.
    """
    sensors = [dict(problem.model.sensor(s.sensor).units) for s in problem.stations]
    names = {units[label] for units in sensors if label in units}
    if label == TIME:
        names = {"s"}
    elif label.startswith(TRUTH):
        names = {problem.model.unit(label.removeprefix(TRUTH))}
    out: dict[str, Unit | None] = dict.fromkeys(names)
    for name in names:
        with suppress(ValueError):
            out[name] = Units().unit(name)
    return out


def cells_to_tracking(cells: Cells, problem: Problem, scale: str | None = None) -> Tracking:
    """The measurements in a table; raises ValueError for columns, stations or cells that do not fit the problem."""
    return _in_order(cells, problem, scale)[0]


def _in_order(cells: Cells, problem: Problem, scale: str | None) -> tuple[Tracking, int]:
    """The measurements in the order of their times, and how many rows were before the one above them."""
    cells = _in_own_units(cells, problem)
    if not problem.stations:
        raise ValueError("the problem has no stations, so nothing can be measured")
    _check_columns(cells, problem)
    times, epoch = times_of(cells, problem, scale)
    falls = int((times[1:] < times[:-1]).sum())
    if falls:
        order = np.argsort(times, kind="stable")
        cells, times = cells.in_order(order), times[order]
    station = _stations(cells, problem)
    values = _values(cells, problem, station)
    _check_components(cells, problem, station)
    names: Any = None if cells.station is None else np.array(cells.station_names)[cells.station]
    first = np.flatnonzero(np.append(True, times[1:] > times[:-1]))
    states = problem.model.names
    known = TRUTH + states[0] in cells.numbers
    truth = np.column_stack([_true(cells, s)[first] for s in states]) if known else None
    tracking = Tracking(times, values, names, truth, epoch)
    return tracking if None in (epoch, problem.epoch) else tracking.with_epoch(problem.epoch), falls


def _true(cells: Cells, state: str) -> Array:
    """The column of a state's truth; ValueError, with the line, for an infinite value."""
    column = cells.numbers[TRUTH + state]
    bad = np.flatnonzero(np.isinf(column))
    if bad.size:
        value = column[bad[0]]
        raise ValueError(f"line {cells.lines[bad[0]]}: {TRUTH}{state} is {value}; leave the cell empty where it is not known")
    return column


def _check_columns(cells: Cells, problem: Problem) -> None:
    """Refuse columns that mean nothing here, and tables that lack one."""
    components = {c for s in problem.stations for c in problem.model.sensor(s.sensor).components}
    truths = [TRUTH + s for s in problem.model.names]
    valid = [*own_names(problem), *((WEEK, SECONDS) if has_weeks(cells) else ())]
    for name in cells.numbers:
        if name not in valid:
            raise ValueError(f"unknown column {name[:60]!r}{nearest(name[:60], valid)}")
    if TIME not in cells.numbers and cells.dates is None and not has_weeks(cells):
        raise ValueError(f"there is no column {TIME!r}")
    if not components & cells.numbers.keys():
        raise ValueError(f"there is no column of measurements ({', '.join(sorted(components))})")
    absent = [t for t in truths if t not in cells.numbers]
    if 0 < len(absent) < len(truths):
        raise ValueError(f"the truth has no column {absent[0]!r}")
    if cells.station is None and len(problem.stations) > 1:
        raise ValueError(f"there is no column {STATION!r}; the problem has {', '.join(s.name for s in problem.stations[:20])}")


def _check_components(cells: Cells, problem: Problem, station: Array) -> None:
    """Refuse a table without the column of a component that one of its stations measures; an empty one will do."""
    for s in np.unique(station).tolist():
        place = problem.stations[s]
        for name in problem.model.sensor(place.sensor).components:
            if name not in cells.numbers:
                who = f"which station {place.name!r} measures"
                raise ValueError(f"there is no column {name!r}, {who}: add it, empty where nothing was measured")


def _stations(cells: Cells, problem: Problem) -> Array:
    """Index of every row's station into the problem's."""
    if cells.station is None:
        return np.zeros(len(cells.lines), dtype=np.int64)
    known = [s.name for s in problem.stations]
    for i, name in enumerate(cells.station_names):
        if name not in known:
            line = cells.lines[int(np.argmax(cells.station == i))]
            raise ValueError(f"line {line}: unknown station {name[:60]!r}{nearest(name[:60], known[:50])}")
    return np.array([known.index(name) for name in cells.station_names], dtype=np.int64)[cells.station]


def _values(cells: Cells, problem: Problem, station: Array) -> Array:
    """Measurements (J, m) in the order of each sensor's components."""
    out = np.full((len(station), problem.model.width), np.nan)
    others = (TIME, WEEK, SECONDS) if has_weeks(cells) else (TIME,)
    columns = {name: column for name, column in cells.numbers.items() if name not in others and not name.startswith(TRUTH)}
    for s, place in enumerate(problem.stations):
        rows = slice(None) if len(problem.stations) == 1 else np.flatnonzero(station == s)
        components = problem.model.sensor(place.sensor).components
        for name, column in columns.items():
            if name in components:
                out[rows, components.index(name)] = column[rows]
            elif not np.isnan(column[rows]).all():
                i = int(np.flatnonzero((station == s) & ~np.isnan(column))[0])
                has = f"station {place.name!r} measures {', '.join(components)}"
                raise ValueError(f"line {cells.lines[i]}: {name} is {column[i]:g}, but {has}")
    infinite = np.argwhere(np.isinf(out))
    if infinite.size:
        i, k = infinite[0]
        name = problem.model.sensor(problem.stations[station[i]].sensor).components[k]
        raise ValueError(f"line {cells.lines[int(i)]}: {name} is {out[i, k]}; leave the cell empty where it is missing")
    return out
