"""Files of what a station sees: a table for people and programs, a dataset, a prediction for laser stations."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from piazzi.determination.looking import LIT
from piazzi.earth import laser_sphere, scales, transform
from piazzi.earth.subdaily import WITHIN_THE_DAY
from piazzi.formats.writing import dates, now
from piazzi.io.atomic import atomic_path
from piazzi.problem.checks import Array
from piazzi.text import escape_formula, printable

ENDINGS = (".csv", ".nc", ".cpf")
IN_DEGREES = {
    "right_ascension", "declination", "azimuth", "elongation", "elevation", "position_angle", "sun_elevation", "moon_elevation",
    "ellipse_position_angle",
}  # fmt: skip
IN_ARCSECONDS = {"rate": "arcsec/s", "ellipse_major": "arcsec", "ellipse_minor": "arcsec"}
PLAIN = {"range": "m", "range_rate": "m/s", "frequency": "Hz", "along_track_sigma": "s"}
ARCSECOND = np.pi / 648000.0


def write(sky: Any, path: Any) -> None:
    """Write by the suffix of the name, whole or not at all; raises ValueError for one that is none."""
    ending = Path(path).suffix.lower()
    if ending not in ENDINGS:
        raise ValueError(f"-o {path}: an ephemeris ends in {', '.join(ENDINGS)}")
    if ending == ".nc":
        from piazzi.io.netcdf import write_dataset

        write_dataset(path, sky.to_dataset())
        return
    if ending == ".cpf" and sky.passes is not None:
        raise ValueError(f"-o {path}: a prediction in CPF has rows at steps, not passes")
    if ending == ".cpf" and sky.course.centre.name == "sun":
        raise ValueError(f"-o {path}: predictions in CPF are of satellites of the Earth, and the orbit goes about the Sun")
    text = cpf_text(sky) if ending == ".cpf" else (_passes_text(sky) if sky.passes is not None else _table_text(sky))
    with atomic_path(path) as work:
        work.write_text(text, encoding="utf-8")


def _table_text(sky: Any) -> str:
    """A row a time: degrees, arcseconds, metres, every column with its unit."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    columns = [_shown(name, values) for name, values in sky.columns.items()]
    writer.writerow([f"time[{sky.scale}]", "station", *(head for head, _ in columns)])
    cells = [values for _, values in columns]
    station = escape_formula(printable(sky.station.name))
    for k, when in enumerate(dates(sky.scale, sky.course.epoch, sky.t)):
        writer.writerow([when, station, *(one[k] for one in cells)])
    return out.getvalue()


def _shown(name: str, values: Array) -> tuple[str, list[Any]]:
    if name == "shadow":
        return name, [LIT[int(v)] for v in values]
    if name in IN_DEGREES:
        return f"{name}[deg]", np.degrees(values).tolist()
    if name in IN_ARCSECONDS:
        return f"{name}[{IN_ARCSECONDS[name]}]", (values / ARCSECOND).tolist()
    return f"{name}[{PLAIN[name]}]", values.tolist()


def _passes_text(sky: Any) -> str:
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    events = ("rise", "culmination", "set")
    writer.writerow([f"{e}_{what}" for e in events for what in (f"time[{sky.scale}]", "azimuth[deg]", "elevation[deg]")])
    for one in sky.passes:
        cells: list[Any] = []
        for at in (one.rise, one.culmination, one.set):
            found = ["", "", ""] if at is None else [
                dates(sky.scale, sky.course.epoch, [at.time])[0], np.degrees(at.azimuth), np.degrees(at.elevation),
            ]  # fmt: skip
            cells += found
        writer.writerow(cells)
    return out.getvalue()


def cpf_text(sky: Any) -> str:
    """Positions in the ITRF in the Consolidated Prediction Format, version 2: mean motion of the object, no light time."""
    states, _ = sky.course.beliefs(sky.t)
    epochs = sky.epochs
    place = transform(states[:, :3], None, "GCRF", "ITRF", epochs, WITHIN_THE_DAY)[0]
    return "\n".join([*_headers(sky), *_rows(sky, place), "99"]) + "\n"


def _headers(sky: Any) -> Iterator[str]:
    name = "".join(c for c in sky.course.name.lower() if c.isalnum() or c in "-_") or "object"
    try:
        sphere = laser_sphere(sky.course.name)
        ids = f"{sphere.ilrs} {sphere.sic} {sphere.norad}"
    except KeyError:
        ids = "0000000 0 0"
    made = now().replace("T", "-").replace(":", "-").split("-")
    first, last = (" ".join(_clock(sky, t)) for t in (sky.t[0], sky.t[-1]))
    step = round(float(sky.t[1] - sky.t[0])) if len(sky.t) > 1 else 0
    yield f"H1 CPF  2  PZI {' '.join(made[:4])}  0001 01 {name} piazzi"
    yield f"H2 {ids} {first} {last} {step} 1 1 0 0 0 1"
    yield "H9"


def _clock(sky: Any, t: float) -> list[str]:
    text = dates("UTC", sky.course.epoch, [t], 0)[0]
    return text.rstrip(".").replace("T", "-").replace(":", "-").split("-")


def _rows(sky: Any, place: Array) -> Iterator[str]:
    epoch = sky.course.epoch
    floor = np.floor(sky.t)
    whole, fraction = scales.normalized(epoch.whole + floor, epoch.fraction + (sky.t - floor))
    day, second, part = scales.reading("UTC", whole, fraction, None)
    for d, s, p, (x, y, z) in zip(day.tolist(), second.tolist(), part.tolist(), place.tolist(), strict=True):
        yield f"10 0 {int(d)} {s + p:.6f} 0 {x:.4f} {y:.4f} {z:.4f}"
