"""What ``report`` and ``--report`` have in common: check the file first, title the problem, write the page."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from piazzi.cli import output
from piazzi.cli.options import F

if TYPE_CHECKING:
    from piazzi.present.report import Tab
    from piazzi.scenarios import Scenario

ENDINGS = (".html", ".htm")


def option(function: F) -> F:
    """Option --report, naming the folder of the page."""
    return click.option(
        "--report",
        "report",
        metavar="DIR",
        help="Write report.html into DIR: one page that works offline; DIR may end in .html.",
    )(function)


def check(path: str | None) -> None:
    """Make the folder of the page, and refuse a place that cannot be written, before anything is computed."""
    if path is None:
        return
    if not path or path == output.STDOUT:
        raise click.UsageError(f"--report {path!r}: name a folder", click.get_current_context(silent=True))
    from piazzi.present.report.write import page_path

    target = page_path(path)
    output.make_folder(target.parent, target.name)
    output.check_output(str(target), ENDINGS)


def scenario_of(source: str, scenario: str | None) -> Scenario | None:
    """The scenario that says what a source is called and how large its planet is, None where there is none."""
    from piazzi.scenarios import load_scenario

    name = scenario or source
    if name.lower().endswith(".npz"):
        name = "satellite-bearing"  # the founding layout is that problem
    try:
        return load_scenario(name)
    except (ValueError, OSError):
        return None


def titled(source: str, name: str, scenario: str | None) -> tuple[str, float | None]:
    """Title of a problem and radius of its planet."""
    found = scenario_of(source, scenario)
    if found is None:
        return name, None
    return found.title if found.title else name, found.picture.planet_radius


def write(path: str, tabs: Sequence[Tab]) -> Path:
    """Write the page of these tabs; returns its path."""
    from piazzi import __version__
    from piazzi.present.report import write_page

    title = tabs[0].title if len(tabs) == 1 else f"{len(tabs)} problems"
    return write_page(path, f"Piazzi report: {title}", tabs, foot=f"Made by Piazzi {__version__}. The page needs no network.")
