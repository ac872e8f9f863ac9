"""Options that say what files of tracking and other recordings do not."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import Any, cast

import click

from piazzi.cli.options import F

_OPTIONS: tuple[tuple[str, str, str, bool], ...] = (
    ("range", "WAY", "What ranges are: one-way, two-way (half of the way there and back), round-trip or three-way.", False),
    ("angles", "KIND", "What directions are: astrometric, geocentric or apparent.", False),
    ("tag", "EVENT", "What times are of: transmit, bounce or receive.", False),
    ("frame", "AXES", "Axes of measurements whose file names none, as ITRF; of the answer where every file does.", False),
    ("corrections", "STATE", "Whether corrections of the file are applied or open.", False),
    ("interval", "TIME", "Over which range rates are averaged.", False),
    ("interval-reference", "PART", "Of that interval, what times are of: start, middle or end.", False),
    ("repair", "WHAT", "Mend what contradicts its neighbours: exponent, of ranges of space surveillance.", False),
    ("debias", "FILE", "Take biases of star catalogues off asteroid astrometry: bias.dat of Eggl et al. 2020.", False),
    ("columns", "NAMES", "What columns of tables are: 'week=gps_week sow=gps_tow x=X[km] ignore=Q'.", False),
    ("scale", "SCALE", "Time scale of dates that name none: UTC, GPS, ...", False),
    ("range-unit", "LENGTH", "How long a range unit (RU) is, as 0.28m or DSS-25=0.28m; may be repeated.", True),
    ("time", "SCALE", "Time scale of a station's dates, as BER=GPS; may be repeated.", True),
    ("sigma", "SIGMA", "Standard deviations, as 10m, range=10m or range.BER=10m; may be repeated.", True),
)


def conventions(function: F) -> F:
    """Every option that answers what a file leaves open; `told` makes words for `read_tracking` of them."""
    for name, metavar, text, several in reversed(_OPTIONS):
        decorator: Callable[[F], F] = click.option(f"--{name}", metavar=metavar, help=text, multiple=several)
        function = decorator(function)
    return function


def told(options: dict[str, Any]) -> dict[str, Any]:
    """The words that were given, by the names that `read_tracking` takes; raises ValueError for no length of time."""
    found = {name: value for name, value in options.items() if value not in (None, ())}
    if "interval" in found:
        from piazzi.units import positive_duration

        found["interval"] = positive_duration(found["interval"], "--interval")
    return found


SCALES = ("UTC", "TAI", "TT", "TDB", "TCG", "GPS", "UT1")
# Of recordings these are shown by --help, in these words; the others are said as to `piazzi tracking`.
_SHOWN = {
    "columns": "Columns of tables by their names here, such as 'range=RNG[km] week=gps_week sow=gps_tow'.",
    "scale": f"Time scale of dates that state none: {', '.join(SCALES)}.",
    "frame": "Frame of positions that state none: ITRF, EME2000, ...",
    "sigma": "Sigmas of tracking: 10m, range=10m; may be repeated.  --range, --tag, ... as piazzi tracking has them.",
}


def recording(function: F) -> F:
    """Options of recordings and files of tracking, as one argument `recording`."""

    @wraps(function)
    def command(*args: Any, **rest: Any) -> Any:
        from piazzi.scenarios import Recording
        from piazzi.tables.names import parse_columns

        answers = told({name.replace("-", "_"): rest.pop(name.replace("-", "_")) for name, *_ in _OPTIONS})
        words = {name: rest.pop(name) for name in ("chosen", "stations", "participants")}
        words |= {name: answers.pop(name) for name in ("scale", "sigma", "frame") if name in answers}
        columns = parse_columns(answers.pop("columns", ""))
        return function(*args, recording=Recording(columns, answers=answers, **words), **rest)

    text = "Stations of tracking: SINEX, TOML, ilrs or mpc; may be repeated."
    command = click.option("--stations", multiple=True, metavar="FILE", help=text)(command)
    text = "Another satellite that took part, by its orbit: NAME=FILE, or an SP3 file; may be repeated."
    command = click.option("--participant", "participants", multiple=True, metavar="NAME=FILE", hidden=True, help=text)(command)
    command = click.option("--object", "chosen", metavar="NAME", help="Object to use where tracking has several.")(command)
    for name, metavar, text, several in sorted(_OPTIONS, key=lambda option: option[0] in _SHOWN):
        kind = click.Choice(SCALES, case_sensitive=False) if name == "scale" else None
        hidden, said = name not in _SHOWN, _SHOWN.get(name, text)
        command = click.option(f"--{name}", metavar=metavar, type=kind, multiple=several, hidden=hidden, help=said)(command)
    return cast(F, command)
