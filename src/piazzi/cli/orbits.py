"""``piazzi orbits``: every orbit that a tracking allows, without a guess."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from piazzi.cli import options, output
from piazzi.cli.case import said_case
from piazzi.cli.conventions import conventions
from piazzi.cli.running import DONE, NOT_ESTIMATED

if TYPE_CHECKING:
    from piazzi.determination.initial_result import InitialOrbits


@click.command(cls=options.Command)
@click.argument("files", metavar="TRACKING...", nargs=-1, required=True)
@click.option("--about", type=click.Choice(["earth", "sun"]), help="What they go about.  [default: what the tracking fits]")
@click.option("--stations", metavar="FILE", multiple=True, help="Stations: SINEX, TOML, ilrs, mpc; may be repeated.")
@click.option("--forces", metavar="FORCES", help='default, none, or "gravity=EGM2008 degree=40 drag=exponential".')
@click.option("--object", "object", metavar="NAME", help="Which object, in files of several.")
@conventions
@options.output("Write the orbits as .json.")
@options.as_json
def command(files: tuple[str, ...], output_file: str | None, as_json: bool, **given: Any) -> int:
    """Look for all orbits that fit TRACKING.

    Fits begin from every classical method that the measurements allow and from a sample of all orbits that are admissible. Each
    orbit is told with its probability, and where the first two part next. Where the measurements are too few for an orbit, what
    they do determine is told: the attributable, and how far away it may be.

    Examples:
      piazzi orbits pass.tdm --stations sites.toml
      piazzi orbits ceres-1801
      piazzi orbits night.psv --about sun --stations codes.html -o orbits.json

    Exit status: 0 orbits, 2 bad usage or input, 3 no orbit but a ridge of them.
    """
    output.check_output(output_file, (".json",))
    files, case = said_case(files, given)
    from piazzi.determination.determining import fitting_orbits

    with output.progress(1) as announce:
        announce("looking for orbits")
        found = fitting_orbits(*files, case=case)
    if output_file is not None:
        _write(output_file, found)
    if as_json:
        output.print_json(found.to_dict())
    else:
        output.print_text("\n".join([str(found), *([f"Wrote {output_file}"] if output_file else [])]))
    return NOT_ESTIMATED if found.ridge is not None else DONE


def _write(path: str, found: InitialOrbits) -> None:
    import json

    from piazzi.io.atomic import atomic_path

    with atomic_path(path) as work:
        work.write_text(json.dumps(found.to_dict(), indent=1, allow_nan=False) + "\n", encoding="utf-8")
