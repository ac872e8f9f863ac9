"""``piazzi tracking``: what is in files of tracking data."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from piazzi.cli import options, output, results
from piazzi.cli.case import said_case
from piazzi.cli.conventions import conventions, told
from piazzi.cli.running import DONE

if TYPE_CHECKING:
    from piazzi.formats import Observations

PICTURES = (".png", ".pdf", ".svg")
ORBITS = (".oem", ".opm", ".ocm", ".omm", ".tle")
TARGETS = (".tdm", ".csv", *ORBITS)


@click.command(cls=options.Command)
@click.argument("files", metavar="FILE...", nargs=-1, required=True)
@options.output("Draw when what was measured, as .png, .pdf or .svg.")
@results.title_option
@click.option("--to", "target", metavar="FILE", help="Convert, to .tdm or .csv; orbits to .oem, .opm, .ocm, .omm or .tle.")
@options.as_json
@conventions
def command(files: tuple[str, ...], output_file: str | None, target: str | None, as_json: bool, **answers: Any) -> int:
    """Show what is in FILEs of tracking data.

    Objects, stations, kinds, spans, passes, gaps, the conventions that the files state, which corrections they have already,
    what is assumed, and what is open, with the option that would say it. Formats are recognised by what is in a file: TDM, CRD,
    MPC, ADES, B3, IOD, UK, RDE, and as fixes OEM, OPM, SP3, CPF; .gz and .Z are read as they are.

    Examples:
      piazzi tracking pass.tdm
      piazzi tracking lageos-2                 the lasers in the package
      piazzi tracking lageos2.npt -o when.png
      piazzi tracking night.tdm.gz --range two-way --to night.csv
    """
    output.check_output(output_file, PICTURES)
    _check_target(target, files)
    results.check_title(output_file, "-o FILE")
    from piazzi.formats import read_tracking
    from piazzi.formats.contents import summary

    files, case = said_case(files, {})
    rows = read_tracking(*files, **{**case.answers, **told(answers)})
    wrote = []
    if target is not None:
        _write(target, files[0], rows)
        wrote.append(f"Wrote {target}")
    if output_file is not None:
        wrote.append(f"Wrote {_draw(output_file, rows)}")
    found = summary(rows)
    if as_json:
        output.print_json(found)
        return DONE
    from piazzi.present.tracked import Tracked

    shown = Tracked(found)
    output.print_rich(shown.heading(), "", shown, *wrote)
    return DONE


def _check_target(target: str | None, files: tuple[str, ...]) -> None:
    """Refuse what could not be written, before anything is read."""
    if target is None:
        return
    ending = Path(target).suffix.lower()
    if ending not in TARGETS:
        raise click.BadParameter(f"{target!r} must end in {', '.join(TARGETS)}", param_hint="--to")
    if ending in ORBITS and len(files) > 1:
        raise click.BadParameter(f"an {ending} is made of one file", param_hint="--to")
    output.check_place(target)


def _write(target: str, file: str, rows: Observations) -> None:
    """Write rows, or the orbit of a file, by the ending of the target."""
    from piazzi.io.atomic import atomic_path

    ending = Path(target).suffix.lower()
    if ending == ".tdm":
        from piazzi.formats.write_tdm import tdm_text

        text = tdm_text(rows)
    elif ending == ".csv":
        from piazzi.formats.write_csv import csv_text

        text = csv_text(rows)
    else:
        text = _orbit_text(file, ending)
    with atomic_path(target) as work:
        work.write_text(text, encoding="utf-8")


def _orbit_text(file: str, ending: str) -> str:
    """The message of an ephemeris; raises ValueError where it does not fit into that kind."""
    from piazzi.formats import read_ephemeris
    from piazzi.formats.write_ocm import ocm_text
    from piazzi.formats.write_odm import oem_text, opm_text

    found = read_ephemeris(file)
    if ending in (".omm", ".tle"):
        from piazzi.formats.tle import tle_text
        from piazzi.formats.write_odm import omm_text
        from piazzi.orbit import fit_sgp4

        return (tle_text if ending == ".tle" else omm_text)(fit_sgp4(found).mean)
    if ending == ".oem":
        return oem_text(found)
    if len(found.arcs) != 1:
        raise ValueError(f"{file}: an {ending} holds one arc, and there are {len(found.arcs)}: write an .oem")
    return opm_text(found.arcs[0]) if ending == ".opm" else ocm_text(found.arcs[0])


def _draw(path: str, rows: Observations) -> str:
    from piazzi.present.figures.pages import save
    from piazzi.present.figures.tracked import schedule_page

    title = results.given_title() or f"{', '.join(rows.objects[:3]) or 'Tracking'}: {len(rows):,} rows"
    return str(save(schedule_page(rows, title), path))
