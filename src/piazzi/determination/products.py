"""What is written of a determination: orbits for others, tables, the problem; each file whole or not at all."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from piazzi.determination.arcs import dates_of, ephemeris, inflation, is_formal, one_state, scale_of
from piazzi.determination.case_text import case_tables
from piazzi.determination.document import document, solution
from piazzi.determination.earlier import MADE_OF, used_by
from piazzi.determination.residuals import table
from piazzi.earth import Epoch
from piazzi.earth.eop import mjd_text, tables
from piazzi.earth.subdaily import SubdailyEOP
from piazzi.formats import MeanElements, ocm_text, oem_text, omm_text, opm_text
from piazzi.formats.tle import tle_text
from piazzi.io import hdf5
from piazzi.io.atomic import atomic_path
from piazzi.io.scenario_text import scenario_text
from piazzi.orbit import fit_sgp4
from piazzi.problem import Problem, Schedule, Tracking
from piazzi.text import escape_formula, printable

ENDINGS = (".oem", ".opm", ".ocm", ".omm", ".tle", ".nc", ".csv", ".json", ".toml")
MESSAGES = (".oem", ".opm", ".ocm")  # that have comments
LONGEST = 240  # of a comment


def check_ending(path: Any) -> str:
    """The suffix of a product; raises ValueError for one that is none."""
    ending = Path(path).suffix.lower()
    if ending not in ENDINGS:
        raise ValueError(f"-o {path}: a product ends in {', '.join(ENDINGS)}")
    return ending


def check_writable(problem: Problem, paths: Iterable[Any]) -> None:
    """Raise ValueError where a scenario is among the products and cannot hold the problem: before the work, not behind it."""
    for path in paths:
        if check_ending(path) == ".toml":
            try:
                scenario_text(problem)
            except ValueError as error:
                raise ValueError(f"-o {path}: {error}") from None


def write(found: Any, path: Any, *, span: Any = None, step: float | None = None, formal: bool | None = None) -> None:
    """Write a product by the suffix of its name, whole or not at all.

    Parameters
    ----------
    found : Determination
    path : its name
    span, step : of an ephemeris, see `ephemeris`
    formal : whether covariances are written as computed where the verdict calls them too small; default what the case says
    """
    ending = check_ending(path)
    if ending in (".tle", ".omm") and found.setup.measured.about != "earth":
        raise ValueError(f"-o {path}: mean elements of SGP4 are of orbits about the Earth; write .oem, .opm or .json")
    if ending == ".nc":
        _dataset(found, path)
        return
    who = found.case.originator or "PIAZZI"
    text = {
        ".oem": lambda: oem_text(ephemeris(found, span, step, formal=formal), originator=who),
        ".opm": lambda: opm_text(one_state(found, formal), originator=who),
        ".ocm": lambda: ocm_text(
            ephemeris(found, span, step, formal=formal).arcs[0], determination=block(found), basis="DETERMINED", originator=who
        ),
        ".omm": lambda: omm_text(_elements(found, span, step), originator=who),
        ".tle": lambda: tle_text(_elements(found, span, step)),
        ".csv": lambda: residual_text(found),
        ".json": lambda: json.dumps(document(found), allow_nan=False, indent=1) + "\n",
        ".toml": lambda: problem_text(found),
    }[ending]()
    if ending in MESSAGES:
        text = with_comments(text, comments(found, formal))
    with atomic_path(path) as work:
        work.write_text(text, encoding="utf-8")


def _elements(found: Any, span: Any, step: float | None) -> MeanElements:
    """Mean elements of SGP4 by a fit to the orbit over the span."""
    mean = fit_sgp4(ephemeris(found, span, step, "TEME")).mean
    if found.case.norad is not None:
        mean = replace(mean, said=tuple({**dict(mean.said), "NORAD_CAT_ID": str(found.case.norad)}.items()))
    return mean


def problem_text(found: Any) -> str:
    """The whole problem with the times of its measurements, as a scenario that every command loads; and its case."""
    problem = scheduled(found.problem, found.setup.measured.tracking)
    with suppress(ValueError):  # a case of objects that are known in Python only
        own = replace(found.case, output=(), report=None)  # who runs the file again asks for what is to be written
        tables_ = case_tables(own, found.setup, Path.cwd())
        return scenario_text(problem, found.tracking.times, tuple(found.estimates), tables_)
    return scenario_text(problem, found.tracking.times, tuple(found.estimates))


def scheduled(problem: Problem, tracking: Tracking) -> Problem:
    """The problem whose stations measure from their first row to their last one, where they did not at all times."""
    if tracking.row_stations is None:
        return problem
    measured = np.isfinite(tracking.values).any(axis=1)
    stations = []
    for station in problem.stations:
        own = tracking.row_times[measured & (tracking.row_stations == station.name)]
        part = 0 < len(own) < len(tracking.times)
        stations.append(replace(station, schedule=Schedule(start=own[0], until=own[-1])) if part else station)
    return replace(problem, stations=stations)


def block(found: Any) -> dict[str, object]:
    """The block of a determination in an OCM."""
    facts = document(found)
    count, used = (sum(one[key] for one in facts["residuals"]) for key in ("count", "used"))
    model = found.problem.model
    out: dict[str, object] = {
        "OD_ID": "1", "OD_METHOD": f"{found.name} (Piazzi)", "OD_EPOCH": found.epoch.to(scale_of(found)).split()[0],
        "OBS_AVAILABLE": count, "OBS_USED": used, "SOLVE_N": len(model.names), "SOLVE_STATES": ",".join(facts["names"]),
        "SENSORS_N": len({one["station"] for one in facts["residuals"]}),
        "SENSORS": ",".join(dict.fromkeys(printable(one["station"]) for one in facts["residuals"])),
    }  # fmt: skip
    ends = [facts["span"][key] for key in ("first", "last")]
    if None not in ends:
        first, last = (round((found.epoch - Epoch(text)) / 86400.0, 12) + 0.0 for text in ends)
        out |= {"DAYS_SINCE_FIRST_OBS": first, "DAYS_SINCE_LAST_OBS": last, "ACTUAL_OD_SPAN": first - last}
    out["DATA_TYPES"] = ",".join(dict.fromkeys(printable(one["component"]) for one in facts["residuals"]))
    if found.weighted_rms is not None:
        out["WEIGHTED_RMS"] = float(found.weighted_rms)
    if facts["considered"]:
        out |= {"CONSIDER_N": len(facts["considered"]), "CONSIDER_PARAMS": ",".join(c["name"] for c in facts["considered"])}
    return out


def comments(found: Any, formal: bool | None = None) -> Iterator[str]:
    """What a file says of itself: the verdict, the command, the measurements, and how old the data are."""
    for sentence in found.verdict.values():
        yield sentence.sentence
    factor = inflation(found)
    if factor > 1.0 and is_formal(found, formal):
        yield f"Covariances are those of the fit, though the verdict finds errors {factor:.3g} times as large as they say."
    elif factor > 1.0:
        yield f"Covariances are those of the fit times {factor**2:.3g}: the verdict finds errors {factor:.3g} times as large."
    if found.notes.get("command"):
        yield f"Made by: {found.notes['command']}"
    made_of = used_by(document(found))
    if made_of is not None:
        yield MADE_OF.format(*(when.to(scale_of(found)) for when in made_of))
    yield _age(dates_of(found, None)[1], found.setup.chosen.choice.eop)


def _age(last: Epoch, given: Any) -> str:
    """What the orientation of the Earth was taken from, and whether it was measured by then."""
    within = isinstance(given, SubdailyEOP)
    added = ", with tides within the day" if within else ""
    eop = given.daily if within else tables() if given is None else given
    if not np.isfinite(getattr(eop, "measured", np.nan)):
        return f"Earth orientation: constants, or a table that does not say what was measured{added}."
    day = mjd_text(eop.measured)
    ahead = last.reading("UTC").day - eop.measured
    state = f"predicted over the last {ahead:.0f} days" if ahead > 0 else "so at all of these dates"
    files = ", ".join(Path(file).name for file in eop.source.split(", "))
    return f"Earth orientation of {files}: measured to {day}, {state}{added}."


def with_comments(text: str, lines: Iterator[str] | Sequence[str]) -> str:
    """A message with comments behind its header."""
    said = [f"COMMENT {printable(line)[:LONGEST]}" for line in lines]
    before = text.split("\n")
    return "\n".join([before[0], *said, *before[1:]])


def residual_text(found: Any) -> str:
    """Residuals as CSV, one line a measurement."""
    rows, zero = table(found), found.setup.measured.epoch
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    names = ("station", "component", "unit", "observed", "computed", "o_minus_c", "sigma", "weight", "used", "reason")
    writer.writerow([f"time[{scale_of(found)}]", *names])
    for i, t in enumerate(rows["t"].tolist()):
        cells = [_cell(rows[name][i]) for name in names]
        writer.writerow([(zero + t).to(scale_of(found)).split()[0], *cells])
    return out.getvalue()


def _cell(value: Any) -> str:
    if isinstance(value, str):
        return escape_formula(printable(value))
    if isinstance(value, (bool, np.bool_)):
        return "1" if value else "0"
    return "" if not np.isfinite(value) else repr(float(value))


def _dataset(found: Any, path: Any) -> None:
    """Residuals, the answer with its covariance, and the whole object as JSON in an attribute."""
    from xarray.backends import H5NetCDFStore

    facts = document(found)
    names = np.array(facts["names"], dtype=object)
    mean, root = solution(found)
    data = found.residuals.assign_coords(state=("state", names)).assign(
        state_mean=("state", mean), covariance=(("state", "state_2"), root @ root.T)
    )
    data = data.assign_attrs(determination=json.dumps(facts, allow_nan=False))
    with hdf5.written(path) as file:
        data.dump_to_store(H5NetCDFStore(file, mode="a"))
