"""``piazzi determine``: from tracking to an orbit, and whether to believe it."""

from __future__ import annotations

import re
import sys
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from piazzi.cli import options, output, results
from piazzi.cli.case import WithCase, case_options, said_case
from piazzi.cli.conventions import conventions
from piazzi.cli.running import DONE, NOT_ESTIMATED, say

if TYPE_CHECKING:
    from collections.abc import Sequence

    from piazzi.determination.case import Case
    from piazzi.determination.initial_result import UndeterminedError
    from piazzi.determination.result import Determination


@click.command(cls=WithCase)
@click.argument("files", metavar="TRACKING...", nargs=-1, required=True)
@case_options
@conventions
def command(files: tuple[str, ...], **given: Any) -> int:
    """Determine an orbit from TRACKING.

    The answer has a covariance and a verdict with a test behind each sentence.
    Files are taken as `piazzi tracking` shows them. What they leave open is asked
    for by the option that says it, and what was assumed is listed. Without
    --guess all orbits that fit are looked for.

    Examples:
      piazzi determine lageos-2 --report l2.html      lasers, in the package
      piazzi determine ceres-1801                     what Piazzi saw, too
      piazzi determine fixes.oem -o orbit.oem
      piazzi determine precise.sp3 --object G01 --with graph --with batch
      piazzi determine night.npt --stations SLRF2014.snx --report night.html
      piazzi determine lageos2.npt --stations ilrs --guess "x=7527km y=-9646km
        z=1464km vx=3.03km/s vy=1.72km/s vz=-4.45km/s
        epoch=2016-02-13T16:00:00Z frame=EME2000"
      piazzi determine night.tdm --span "first .. last+3d" -o next.oem --json
      receiver | piazzi determine - --follow --prior last.json -o next.oem

    Exit status: 0 determined, 2 bad usage or input, 3 not determined.
    """
    read = files
    files, case = said_case(files, given)
    for option, of in (("format", "figures"), ("width", "figures"), ("title", "report")):
        if given[option] and getattr(case, of) is None:
            raise click.UsageError(f"--{option} is of what --{of} DIR writes: add it", click.get_current_context())
    for option in ("step", "anyway", "covariance"):
        if given[option] and not case.output:
            say(f"--{option} changes nothing: it is of the products that -o FILE writes")
    if case.each and case.object:
        raise click.UsageError("--object and --each do not go together", click.get_current_context())
    if output.STDOUT in files and not case.follow:
        raise click.UsageError("-: standard input is followed: add --follow", click.get_current_context())
    _check_outputs(case, read)
    if case.against is not None:
        from piazzi.formats import read_ephemeris

        read_ephemeris(case.against)  # what is wrong with it is said before the work
    from piazzi.determination.case_text import write_case
    from piazzi.determination.determining import objects_in
    from piazzi.determination.initial_result import UndeterminedError

    if case.follow and case.show:
        raise click.UsageError("--follow and --show do not go together", click.get_current_context())
    if case.follow:
        return _follow(files, case if given["with_"] else _row_by_row(case))
    status = DONE
    for one in objects_in(files, case) if case.each else [case.object]:
        own = replace(case, object=one)
        if own.show:
            _show(files, own)
            continue
        try:
            result = _one(files, own)
        except UndeterminedError as error:
            status = NOT_ESTIMATED
            _print_ridge(error, own)
            continue
        wrote = _write(result, own)
        if own.save is not None:
            write_case(own.save, own, result.setup)
            wrote.append(f"Wrote {own.save}")
        status = max(status, _status(result, case.strict))
        _print(result, case, wrote)
    return status


def _row_by_row(case: Case) -> Case:
    """The case with those of its estimators that go row by row, the first of them; with the usual one where none does."""
    from piazzi.determination.fit import estimators

    if not case.with_:
        return case
    able = [name for name, one in estimators(case.with_).items() if callable(getattr(one, "start", None))][:1]
    others = [name for name in estimators(case.with_) if name not in able]
    if others:
        say(f"followed by {able[0] if able else 'ekf:gate'}, not by {', '.join(others)} of the case (--with says otherwise)")
    return replace(case, with_=tuple(able) or None)


def _follow(files: Sequence[str], case: Case) -> int:
    """Carry an orbit on along a stream; products at its end."""
    from piazzi.cli.following import follow
    from piazzi.determination.case_text import write_case
    from piazzi.determination.determining import plain_command
    from piazzi.determination.showing import line

    found = follow(files, case, {"command": plain_command(["piazzi", *sys.argv[1:]])})
    if found is None:
        return NOT_ESTIMATED
    wrote = _write(found, case)
    if case.save is not None:
        write_case(case.save, case, found.setup)
        wrote.append(f"Wrote {case.save}")
    for text in wrote if case.json else ():
        say(text)
    if not case.json:
        output.print_rich(line(found), *wrote)
    return _status(found, case.strict)


def _print_ridge(error: UndeterminedError, case: Case) -> None:
    """What is known of an orbit that cannot be determined: there are no products of it but JSON."""
    from piazzi.determination.document import undetermined

    facts = undetermined(error, case.object)
    for path in case.output:
        target = path.replace("{object}", _file_name(case.object or ""))
        if Path(target).suffix.lower() == ".json":
            output.write_json(target, facts)
        else:
            say(f"{target} is not written: there is no orbit")
    if case.report is not None:
        say(f"{case.report} is not written: there is no orbit")
        with suppress(OSError):  # a folder that was made for it
            Path(case.report).rmdir()
    if case.json:
        output.print_json(facts)
    else:
        output.print_text(f"not determined: {error}")


def _show(files: Sequence[str], case: Case) -> None:
    from piazzi.determination.determining import prepared
    from piazzi.determination.showing import shown

    output.print_text(shown(prepared(*files, case=case)))


def _one(files: Sequence[str], case: Case) -> Determination:
    """The determination of one object, compared with another orbit where that is asked for."""
    from piazzi.determination.determining import determined, plain_command

    command = plain_command(["piazzi", *sys.argv[1:]])
    with output.progress(3 + len(case.with_ or ())) as announce:
        found = determined(files, case, announce, {"command": command})
    if case.against is None:
        return found
    from piazzi.determination.against import against

    difference = against(found, case.against, case.span).to_dict()
    return replace(found, notes={**found.notes, "against": {"file": case.against, **difference}})


def _check_outputs(case: Case, files: Sequence[str]) -> None:
    """Refuse what could not be written, before anything is read."""
    for path in (*case.output, case.save):
        options.check_places({"files": files, "output_file": path})

    for path in case.output:
        if path == output.STDOUT:
            raise click.UsageError("-o -: products go into files; --json prints on stdout", click.get_current_context())
        if case.each and "{object}" not in path:
            raise click.UsageError(f"-o {path}: with --each the name has {{object}} in it", click.get_current_context())
        from piazzi.determination.products import ENDINGS

        output.check_output(path, ENDINGS)
    doubled = [path for i, path in enumerate(case.output) if path in case.output[:i]]
    if doubled:
        raise click.UsageError(f"-o {doubled[0]} is given twice", click.get_current_context())
    if case.save is not None:
        if case.each:
            raise click.UsageError("--save and --each do not go together", click.get_current_context())
        output.check_output(case.save, (".toml",), "--save")
    for option, folder in (("--report", case.report), ("--figures", case.figures)):
        if case.each and folder is not None and "{object}" not in folder:
            raise click.UsageError(f"{option} {folder}: with --each the name has {{object}} in it", click.get_current_context())
    if not case.each:
        results.check_report(case.report)
    if case.figures is not None and not case.each:
        output.make_folder(Path(case.figures), "pictures")


def _write(found: Determination, case: Case) -> list[str]:
    """Write products and page; products of an orbit that is not determined only where it is asked for."""
    wrote = []
    for path in case.output:
        target = path.replace("{object}", _file_name(found.object))
        if not (found.determined or case.anyway or Path(target).suffix.lower() == ".json"):
            say(f"{target} is not written: the orbit is not determined (--anyway writes it)")
            continue
        found.write(target, span=case.span, step=case.step, formal=case.covariance == "formal")
        wrote.append(f"Wrote {target}")
    if case.figures is not None:
        folder = case.figures.replace("{object}", _file_name(found.object))
        paths = found.figures(folder, case.format, case.width)
        wrote.append(f"Wrote {len(paths)} pictures into {folder}")
    if case.report is not None:
        wrote.append(f"Wrote {found.report(case.report.replace('{object}', _file_name(found.object)), case.title)}")
    return wrote


def _status(found: Determination, strict: bool) -> int:
    wrong = any(sentence.ok is False for sentence in found.verdict.values())
    return DONE if found.determined and not (strict and wrong) else NOT_ESTIMATED


def _print(found: Determination, case: Case, wrote: Sequence[str]) -> None:
    if case.json:
        output.print_json(found.to_dict())
    elif case.each:
        from piazzi.determination.showing import line

        output.print_rich(line(found), *wrote)
    else:
        output.print_rich(found, *wrote)


def _file_name(name: str) -> str:
    """An object's name as part of a file's: letters, digits and signs that no folder is made of."""
    return re.sub(r"[^\w.+-]+", "_", name).strip(".") or "object"
