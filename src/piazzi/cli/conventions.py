"""Options that say what tracking files do not."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import click

from piazzi.cli.options import F

_OPTIONS: tuple[tuple[str, str, str, bool], ...] = (
    ("range", "WAY", "What ranges are: one-way, two-way (half of the way there and back), round-trip or three-way.", False),
    ("angles", "KIND", "What directions are: astrometric, geocentric or apparent.", False),
    ("tag", "EVENT", "What times are of: transmit, bounce or receive.", False),
    ("frame", "AXES", "Axes of measurements whose file names none, as ITRF; of the answer where every file does.", False),
    ("corrections", "STATE", "Whether corrections of the file are applied or open.", False),
    ("interval", "SECONDS", "Over which range rates are averaged.", False),
    ("interval-reference", "PART", "Of that interval, what times are of: start, middle or end.", False),
    ("repair", "WHAT", "Mend what contradicts its neighbours: exponent, of ranges of space surveillance.", False),
    ("debias", "FILE", "Take biases of star catalogues off asteroid astrometry: bias.dat of Eggl et al. 2020.", False),
    ("columns", "NAMES", "What columns of tables are: 'week=gps_week sow=gps_tow x=X[km] ignore=Q'.", False),
    ("scale", "SCALE", "Time scale of dates that name none: UTC, GPS, ...", False),
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
    """The words that were given, by the names that `read_tracking` takes; raises click.BadParameter for no number."""
    found = {name: value for name, value in options.items() if value not in (None, ())}
    if "interval" in found:
        from piazzi.cli.options import number

        found["interval"] = number(found["interval"])
    return found
