"""``piazzi determine``: from tracking to an orbit, and whether to believe it."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from piazzi.cli import options, output, results
from piazzi.cli.conventions import conventions, told
from piazzi.cli.running import DONE, NOT_ESTIMATED, say

if TYPE_CHECKING:
    from collections.abc import Sequence

    from piazzi.determination import Determination

SHORT = ("guess", "stations", "sigma", "names", "forces", "output_file", "report", "as_json")  # those that --help shows


class Determine(options.WithEstimators):
    """A command with many options, of which --help shows eight and --help-all the rest."""

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        every = ctx.meta.get("piazzi.help_all", False)
        shown = [p for p in self.get_params(ctx) if every or p.name in (*SHORT, "help", "help_all")]
        records = [record for p in shown if (record := p.get_help_record(ctx)) is not None]
        with formatter.section("Options"):
            formatter.write_dl(records)


def _help_all(ctx: click.Context, parameter: click.Parameter, asked: bool) -> None:
    if asked:
        ctx.meta["piazzi.help_all"] = True
        click.echo(ctx.get_help())
        ctx.exit()


@click.command(cls=Determine)
@click.argument("files", metavar="TRACKING...", nargs=-1, required=True)
@click.option(
    "--guess", metavar="ORBIT", help="Where to begin: elements, a state, or a file; default none: all orbits that fit."
)
@click.option("--stations", "stations", metavar="FILE", multiple=True, help="Stations: SINEX, TOML, ilrs; may be repeated.")
@click.option(
    "--with", "names", metavar="ESTIMATOR", multiple=True, help="May be repeated, the first is the answer.  [default: graph]"
)
@click.option(
    "--forces",
    metavar="FORCES",
    default="default",
    show_default=True,
    help='default, none, or "gravity=EGM2008 degree=40 drag=exponential".',
)
@click.option(
    "-o",
    "--output",
    "output_file",
    metavar="FILE",
    multiple=True,
    help="Write .oem, .opm, .ocm, .tle, .nc, .csv or .json; may be repeated.",
)
@results.report_option
@options.as_json
@click.option("--estimate", metavar="NAMES", multiple=True, help='Unknowns beside the orbit: "cr cd along=1e-7".')
@click.option("--consider", metavar="NAME=SIGMA", multiple=True, help="Constants that are uncertain: cr=0.1.")
@click.option("--mass", metavar="KG", help="Mass of the object.")
@click.option("--area", metavar="M2", help="Cross section of the object.")
@click.option("--com", metavar="M", help="From reflectors to the centre of mass.")
@click.option("--epoch", metavar="DATE", help="Where the answer stands.  [default: the last measurement used]")
@click.option("--span", metavar="'A .. B'", help='Of products, as "first .. last+3d".')
@click.option("--step", metavar="TIME", help="Between states of products.  [default: 60s]")
@click.option(
    "--covariance",
    type=click.Choice(["scaled", "formal"]),
    default="scaled",
    help="Whether covariances that the verdict calls too small are written larger.  [default: scaled]",
)
@click.option("--object", "chosen", metavar="NAME", help="Which object, in files of several.")
@click.option("--each", is_flag=True, help="Every object, one after the other; products by {object}.")
@click.option("--against", metavar="FILE", help="Compare with another orbit, at its rows within the span.")
@click.option("--strict", is_flag=True, help="Exit 3 where any sentence of the verdict is false.")
@click.option("--anyway", is_flag=True, help="Write products of an orbit that is not determined too.")
@click.option("--show", is_flag=True, help="Show forces, unknowns, noise and assumptions, and stop.")
@conventions
@click.option(
    "--help-all", is_flag=True, is_eager=True, expose_value=False, callback=_help_all, help="Show all options and exit."
)
def command(
    files: tuple[str, ...],
    guess: str | None,
    stations: tuple[str, ...],
    names: tuple[str, ...],
    forces: str,
    output_file: tuple[str, ...],
    report: str | None,
    as_json: bool,
    estimate: tuple[str, ...],
    consider: tuple[str, ...],
    mass: str | None,
    area: str | None,
    com: str | None,
    epoch: str | None,
    span: str | None,
    step: str | None,
    covariance: str,
    chosen: str | None,
    each: bool,
    against: str | None,
    strict: bool,
    anyway: bool,
    show: bool,
    **answers: Any,
) -> int:
    """Determine an orbit from TRACKING.

    The answer has a covariance and a verdict with a test behind each sentence.
    Files are taken as `piazzi tracking` shows them. What they leave open is asked
    for by the option that says it, and what was assumed is listed. Without
    --guess all orbits that fit are looked for.

    Examples:
      piazzi determine fixes.oem -o orbit.oem
      piazzi determine precise.sp3 --object G01 --with graph --with batch
      piazzi determine lageos2.npt --stations SLRF2014.snx --report l2.html
      piazzi determine lageos2.npt --stations ilrs --guess "x=7527km y=-9646km
        z=1464km vx=3.03km/s vy=1.72km/s vz=-4.45km/s
        epoch=2016-02-13T16:00:00Z frame=EME2000"
      piazzi determine night.tdm --span "first .. last+3d" -o next.oem --json

    Exit status: 0 determined, 2 bad usage or input, 3 not determined.
    """
    from piazzi.cli.options import number
    from piazzi.determination.determining import plain_command

    if each and chosen:
        raise click.UsageError("--object and --each do not go together", click.get_current_context())
    _check_outputs(output_file, report, each)
    every = step and _seconds(step)
    _check_words(names, span, epoch)
    if against is not None:
        from piazzi.formats import read_ephemeris

        read_ephemeris(against)  # what is wrong with it is said before the work
    words = dict(
        guess=guess, stations=stations or None, with_=names, forces=forces, estimate=estimate, consider=consider,
        mass=_positive(mass, "--mass", number), area=_positive(area, "--area", number), com=com and number(com), epoch=epoch,
        notes={"command": plain_command(["piazzi", *sys.argv[1:]])}, **told(answers),
    )  # fmt: skip
    from piazzi.determination.determining import objects_in

    several = objects_in(files, answers.get("frame"), told(answers)) if each else [chosen]
    status, found = DONE, []
    for one in several:
        result = _one(files, one, words, show)
        if result is None:
            continue
        if against is not None:
            result = _compared(result, against, span)
        found.append(result)
        wrote = _write(result, output_file, report, span, every or None, covariance == "formal", anyway)
        status = max(status, _status(result, strict))
        _print(result, as_json, each, wrote)
    return status


def _one(files: Sequence[str], chosen: str | None, words: dict[str, Any], show: bool) -> Determination | None:
    """The determination of one object; None where the set-up alone is shown."""
    from piazzi.determination.determining import determine, prepared
    from piazzi.determination.showing import shown

    if show:
        told = {key: value for key, value in words.items() if key not in ("with_", "notes")}
        output.print_text(shown(prepared(*files, object=chosen, **told)))
        return None
    with output.progress(3 + len(words["with_"])) as announce:
        return determine(*files, object=chosen, announce=announce, **words)


def _check_outputs(paths: Sequence[str], report: str | None, each: bool) -> None:
    """Refuse what could not be written, before anything is read."""
    from piazzi.determination.products import ENDINGS

    for path in paths:
        if path == output.STDOUT:
            raise click.UsageError("-o -: products go into files; --json prints on stdout", click.get_current_context())
        if each and "{object}" not in path:
            raise click.UsageError(f"-o {path}: with --each the name has {{object}} in it", click.get_current_context())
        output.check_output(path, ENDINGS)
    doubled = [path for i, path in enumerate(paths) if path in paths[:i]]
    if doubled:
        raise click.UsageError(f"-o {doubled[0]} is given twice", click.get_current_context())
    results.check_report(report)


def _check_words(names: Sequence[str], span: str | None, epoch: str | None) -> None:
    """Refuse what cannot be read, before the files are."""
    from piazzi.determination.fit import estimators
    from piazzi.determination.products import check_span

    try:
        estimators(names)
    except ValueError as error:
        raise click.UsageError(f"--with: {error}", click.get_current_context()) from None
    check_span(span)
    if epoch is not None:
        from piazzi.earth import Epoch

        try:
            Epoch(epoch)
        except ValueError as error:
            raise click.UsageError(f"--epoch: {error}", click.get_current_context()) from None


def _seconds(text: str) -> float:
    from piazzi.determination.words import seconds

    return seconds(text, "--step")


def _positive(text: str | None, option: str, number: Any) -> float | None:
    if text is None:
        return None
    value: float = number(text)
    if not 0 < value < float("inf"):
        raise click.UsageError(f"{option} is {text}; it must be positive", click.get_current_context())
    return value


def _write(
    found: Determination,
    paths: Sequence[str],
    report: str | None,
    span: str | None,
    step: float | None,
    formal: bool,
    anyway: bool,
) -> list[str]:
    """Write products and page; products of an orbit that is not determined only where it is asked for."""
    wrote = []
    for path in paths:
        target = path.replace("{object}", _file_name(found.object))
        if not (found.determined or anyway or Path(target).suffix.lower() == ".json"):
            say(f"{target} is not written: the orbit is not determined (--anyway writes it)")
            continue
        found.write(target, span=span, step=step, formal=formal)
        wrote.append(f"Wrote {target}")
    if report is not None:
        wrote.append(f"Wrote {found.report(report)}")
    return wrote


def _status(found: Determination, strict: bool) -> int:
    wrong = any(sentence.ok is False for sentence in found.verdict.values())
    return DONE if found.determined and not (strict and wrong) else NOT_ESTIMATED


def _print(found: Determination, as_json: bool, each: bool, wrote: Sequence[str]) -> None:
    if as_json:
        output.print_json(found.to_dict())
    elif each:
        from piazzi.determination.showing import line

        output.print_rich(line(found), *wrote)
    else:
        output.print_rich(found, *wrote)


def _compared(found: Determination, other: str, span: str | None) -> Determination:
    """The determination with the difference to another orbit among its notes."""
    from dataclasses import replace

    from piazzi.determination.against import against

    return replace(found, notes={**found.notes, "against": {"file": other, **against(found, other, span).to_dict()}})


def _file_name(name: str) -> str:
    """An object's name as part of a file's: letters, digits and signs that no folder is made of."""
    import re

    return re.sub(r"[^\w.+-]+", "_", name).strip(".") or "object"
