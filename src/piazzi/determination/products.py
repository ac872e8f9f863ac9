"""What is written of a determination: orbits for others, tables, the problem; each file whole or not at all."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from piazzi.determination.document import document, solution
from piazzi.determination.residuals import table
from piazzi.determination.words import date, seconds
from piazzi.earth import Epoch
from piazzi.earth.rotation import frame_named
from piazzi.formats import Arc, Ephemeris, ocm_text, oem_text, opm_text
from piazzi.formats.tle import tle_text
from piazzi.io import hdf5
from piazzi.io.atomic import atomic_path
from piazzi.orbit import fit_sgp4
from piazzi.text import escape_formula, printable

ENDINGS = (".oem", ".opm", ".ocm", ".tle", ".nc", ".csv", ".json")
ORBITS = (".oem", ".opm", ".ocm", ".tle")
STEP = 60.0  # s
MOST_STATES = 200_000


def check_ending(path: Any) -> str:
    """The suffix of a product; raises ValueError for one that is none."""
    ending = Path(path).suffix.lower()
    if ending not in ENDINGS:
        raise ValueError(f"-o {path}: a product ends in {', '.join(ENDINGS)}")
    return ending


def write(found: Any, path: Any, *, span: Any = None, step: float | None = None, formal: bool = False) -> None:
    """Write a product by the suffix of its name.

    Parameters
    ----------
    found : Determination
    path : its name
    span, step : of an ephemeris, see `ephemeris`
    formal : whether covariances are written as computed where the verdict calls them too small
    """
    ending = check_ending(path)
    if ending == ".nc":
        _dataset(found, path)
        return
    text = {
        ".oem": lambda: oem_text(ephemeris(found, span, step, formal=formal)),
        ".opm": lambda: opm_text(one_state(found, formal)),
        ".ocm": lambda: ocm_text(
            ephemeris(found, span, step, formal=formal).arcs[0], determination=block(found), basis="DETERMINED"
        ),
        ".tle": lambda: tle_text(fit_sgp4(ephemeris(found, span, step, "TEME")).mean),
        ".csv": lambda: residual_text(found),
        ".json": lambda: json.dumps(document(found), allow_nan=False, indent=1) + "\n",
    }[ending]()
    if ending in ORBITS and ending != ".tle":
        text = with_comments(text, comments(found))
    with atomic_path(path) as work:
        work.write_text(text, encoding="utf-8")


def dates_of(found: Any, span: Any) -> tuple[Epoch, Epoch]:
    """The two ends of ``"first .. last+3d"``; default the rows that were used, and the answer.

    Raises
    ------
    ValueError
        For what cannot be read.
    """
    times = found.setup.tracking.row_times[found.keep]
    zero = found.setup.measured.epoch
    first, last = zero + float(times.min()), zero + float(times.max())
    if span is None:
        return min(first, found.epoch), max(last, found.epoch)
    ends = span.split("..") if isinstance(span, str) else list(span)
    if len(ends) != 2:
        raise ValueError(f'--span {span!r}: write two ends with .. between them, as "first .. last+3d"')
    begin, end = (end_of(one, first, last, default) for one, default in zip(ends, (first, last), strict=True))
    if end < begin:
        raise ValueError(f"--span {span!r}: it ends before it begins")
    return begin, end


def end_of(text: Any, first: Epoch, last: Epoch, default: Epoch) -> Epoch:
    """One end of a span: first, last, either with a length of time added or taken off, or a date."""
    if isinstance(text, Epoch):
        return text
    plain = str(text or "").strip()
    if not plain:
        return default
    for word, base in (("first", first), ("last", last)):
        if plain.startswith(word):
            rest = plain.removeprefix(word).strip()
            if not rest:
                return base
            if rest[0] in "+-":
                length = seconds(rest[1:].strip(), f"--span: {word}")
                return base + (length if rest[0] == "+" else -length)
    return date(plain, "--span")


def check_span(span: Any) -> None:
    """Raise ValueError for a span that cannot be read, before there is a result."""
    if span is None:
        return
    any_date = Epoch.at(0.0)
    ends = span.split("..") if isinstance(span, str) else list(span)
    if len(ends) != 2:
        raise ValueError(f'--span {span!r}: write two ends with .. between them, as "first .. last+3d"')
    for one in ends:
        end_of(one, any_date, any_date, any_date)


def ephemeris(
    found: Any, span: Any = None, step: float | None = None, frame: str | None = None, *, formal: bool = False
) -> Ephemeris:
    """States and covariances over a span, every `step` seconds (default 60) from its beginning, its end too."""
    begin, end = dates_of(found, span)
    width = STEP if step is None else float(step)
    if not width > 0:
        raise ValueError(f"--step is {width:g} s; it must be positive")
    length = end - begin
    if length / width > MOST_STATES:
        raise ValueError(
            f"--span with --step {width:g} s makes {length / width:,.0f} states; at most {MOST_STATES:,} are written"
        )
    t = width * np.arange(int(length / width + 1e-9) + 1)
    t = np.append(t, length) if length - t[-1] > 1e-6 else t
    return Ephemeris(arcs=(arc_of(found, begin, t, frame, formal),), format="OEM")


def one_state(found: Any, formal: bool = False) -> Arc:
    """The answer as an arc of one state."""
    return arc_of(found, found.epoch, np.zeros(1), None, formal)


def arc_of(found: Any, begin: Epoch, t: Any, frame: str | None, formal: bool) -> Arc:
    """States at times past a date, with their covariances, in the axes of the answer or others."""
    orbit = found.orbit if frame is None else found.orbit.to(frame_named(frame))
    mean, roots = orbit.states([begin + float(x) for x in t])
    roots = roots * (1.0 if formal else inflation(found))
    return Arc(
        epoch=begin, t=t, position=mean[:, :3], velocity=mean[:, 3:], name=found.object or "UNKNOWN",
        centre="EARTH", frame=orbit.frame, scale=_scale(found), covariance_t=t,
        covariance=roots @ np.swapaxes(roots, 1, 2), covariance_frames=(orbit.frame,) * len(t),
    )  # fmt: skip


def inflation(found: Any) -> float:
    """What sigmas are multiplied by where the verdict says that they are too small."""
    honest = found.verdict["honest"]
    return float(honest.figure) if honest.ok is False and honest.figure and honest.figure > 1.0 else 1.0


def _scale(found: Any) -> str:
    return str(found.scale) if found.scale in ("UTC", "TAI", "TT", "TDB", "GPS", "UT1", "TCG") else "UTC"


def block(found: Any) -> dict[str, object]:
    """The block of a determination in an OCM."""
    facts = document(found)
    count, used = (sum(one[key] for one in facts["residuals"]) for key in ("count", "used"))
    model = found.problem.model
    out: dict[str, object] = {
        "OD_ID": "1", "OD_METHOD": f"{found.name} (Piazzi)", "OD_EPOCH": found.epoch.to(_scale(found)).split()[0],
        "OBS_AVAILABLE": count, "OBS_USED": used, "SOLVE_N": len(model.names), "SOLVE_STATES": ",".join(model.names),
        "SENSORS_N": len({one["station"] for one in facts["residuals"]}),
        "SENSORS": ",".join(dict.fromkeys(printable(one["station"]) for one in facts["residuals"])),
    }  # fmt: skip
    if found.weighted_rms is not None:
        out["WEIGHTED_RMS"] = float(found.weighted_rms)
    if facts["considered"]:
        out |= {"CONSIDER_N": len(facts["considered"]), "CONSIDER_PARAMS": ",".join(c["name"] for c in facts["considered"])}
    return out


def comments(found: Any) -> Iterator[str]:
    """What a file says of itself: the verdict, the command, the measurements."""
    for sentence in found.verdict.values():
        yield sentence.sentence
    factor = inflation(found)
    if factor > 1.0:
        yield f"Covariances are those of the fit times {factor**2:.3g}: residuals are {factor:.3g} times their sigmas."
    if found.notes.get("command"):
        yield f"Made by: {found.notes['command']}"
    facts = document(found)
    yield f"Measurements from {facts['span']['first']} to {facts['span']['last']}."


def with_comments(text: str, lines: Iterator[str] | Sequence[str]) -> str:
    """A message with comments behind its header."""
    said = [f"COMMENT {printable(line)[:240]}" for line in lines]
    before = text.split("\n")
    return "\n".join([before[0], *said, *before[1:]])


def residual_text(found: Any) -> str:
    """Residuals as CSV, one line a measurement."""
    rows, zero = table(found), found.setup.measured.epoch
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    names = ("station", "component", "unit", "observed", "computed", "o_minus_c", "sigma", "weight", "used", "reason")
    writer.writerow([f"time[{_scale(found)}]", *names])
    for i, t in enumerate(rows["t"].tolist()):
        cells = [_cell(rows[name][i]) for name in names]
        writer.writerow([(zero + t).to(_scale(found)).split()[0], *cells])
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
        mean=("state", mean), covariance=(("state", "state_2"), root @ root.T)
    )
    data = data.assign_attrs(determination=json.dumps(facts, allow_nan=False))
    with hdf5.written(path) as file:
        data.dump_to_store(H5NetCDFStore(file, mode="a"))
