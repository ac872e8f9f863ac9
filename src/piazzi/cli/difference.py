"""``piazzi difference``: how far two orbits are apart."""

from __future__ import annotations

import os
from typing import Any

import click

from piazzi.cli import options, output, results
from piazzi.cli.running import DONE

PICTURES = (".png", ".pdf", ".svg")
TRUTHS = (".toml", ".npz", ".nc")


@click.command(cls=options.Command)
@click.argument("first", metavar="A")
@click.argument("second", metavar="B")
@click.option(
    "--axes", metavar="AXES", default="RTN", show_default=True, help="RTN or TNW of A, or a frame such as GCRF or ITRF."
)
@click.option("--span", metavar="'FIRST .. LAST'", help="Dates with their scale; either may be left out.")
@click.option("--step", metavar="TIME", type=options.duration, help="Time step.  [default: the rows of A]")
@click.option("--object", "chosen", metavar="NAME", help="Object in files of several, by name or identifier.")
@click.option("--degree", metavar="N", type=options.WholeNumber(1), help="Of the polynomial between rows.  [default: chosen]")
@options.seed
@options.output("Draw the difference over time, as .png, .pdf or .svg.")
@results.title_option
@options.as_json
def command(
    first: str,
    second: str,
    axes: str,
    span: str | None,
    step: float | None,
    chosen: str | None,
    degree: int | None,
    seed: int,
    output_file: str | None,
    as_json: bool,
) -> int:
    """Show how far orbit B is from orbit A.

    A and B are files of orbits: OEM, SP3, CPF, two-line elements, OMM; .gz and .Z are read as they are. A scenario stands for
    the truth that is simulated with --seed, a recording for its own. The difference is B minus A at the rows of A that both
    cover, along the radial, transverse and normal axes of A: root mean square, mean and maximum, and where a file has
    covariances or accuracies, in sigma, with the share inside, which is right for independent data only. Between rows
    states are those of a polynomial, whose degree and error are said.

    Examples:
      piazzi difference fit.oem precise.sp3 --object G01
      piazzi difference sun-sync-day fit.oem --seed 3
      piazzi difference old.tle new.oem --axes TNW -o apart.png
      piazzi difference a.oem b.oem --span "2016-02-13T16:00:00 UTC .." --json
    """
    output.check_output(output_file, PICTURES)
    results.check_title(output_file, "-o FILE")
    from piazzi.orbit import difference

    found = difference(_orbit(first, seed), _orbit(second, seed), axes, _span(span), step=step, object=chosen, degree=degree)
    wrote = []
    if output_file is not None:
        from piazzi.present.figures.difference import difference_page
        from piazzi.present.figures.pages import save

        wrote.append(f"Wrote {save(difference_page(found, results.given_title() or ''), output_file)}")
    if as_json:
        output.print_json(found.to_dict())
        return DONE
    from piazzi.present.differing import Differing

    output.print_rich(Differing(found.to_dict()), *wrote)
    return DONE


def _orbit(text: str, seed: int) -> Any:
    """The name of a file, or a problem and its tracking with a truth."""
    from piazzi.scenarios import names

    if not text.lower().endswith(TRUTHS) and (text not in names() or os.path.exists(text)):
        return text
    from piazzi import load

    return load(text, seed=seed)


def _span(text: str | None) -> tuple[str | None, str | None] | None:
    """The two dates of ``FIRST .. LAST``."""
    if text is None:
        return None
    first, dots, last = text.partition("..")
    if not dots:
        raise click.BadParameter(f"{text!r} must be two dates with .. between them", param_hint="--span")
    return first.strip() or None, last.strip() or None
