"""How commands end: the file, the page, and one object or tables on stdout."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import click

from piazzi.cli import output
from piazzi.cli.options import F
from piazzi.cli.running import DONE, NOT_ESTIMATED

if TYPE_CHECKING:
    from piazzi.present.report import Section, Tab
    from piazzi.problem import Problem, Tracking


ENDINGS = (".json", ".csv")
PAGES = (".html", ".htm")
_TITLE = "piazzi.title"


class Result(Protocol):
    """What is told of a source; rich can show it."""

    @property
    def problem(self) -> Problem: ...

    @property
    def tracking(self) -> Tracking: ...

    @property
    def source(self) -> str: ...

    @property
    def success(self) -> bool: ...

    def to_dict(self) -> dict[str, Any]: ...


@dataclass(frozen=True)
class Outputs:
    """What -o, --json and --report ask for."""

    output_file: str | None
    as_json: bool
    report: str | None

    def check(self) -> None:
        """Refuse what could not be written, before anything is computed; raises click.UsageError, OSError."""
        output.check_output(self.output_file, ENDINGS)
        check_report(self.report)
        check_title(self.report, "--report DIR")

    def write(self, result: Result, rows: Callable[[], Sequence[Mapping[str, Any]]], tab: Callable[[], Tab]) -> int:
        """Write and print a result; the exit status.

        Parameters
        ----------
        rows : makes the records of a .csv
        tab : makes the tab of a page
        """
        wrote = []
        if self.output_file is not None:
            self._write(self.output_file, result, rows)
            wrote.append(f"Wrote {self.output_file}")
        if self.report is not None:
            wrote.append(f"Wrote {write_page(self.report, [tab()])}")
        if self.output_file == output.STDOUT:
            pass  # it has the object already
        elif self.as_json:
            output.print_json(result.to_dict())
        else:
            from piazzi.present.tables import heading

            output.print_rich(heading(result.problem, result.tracking, result.source), "", result, *wrote)
        return DONE if result.success else NOT_ESTIMATED

    def _write(self, path: str, result: Result, rows: Callable[[], Sequence[Mapping[str, Any]]]) -> None:
        if path == output.STDOUT or path.lower().endswith(".json"):
            output.write_json(path, result.to_dict())
        else:
            output.write_csv(path, rows())


def report_option(function: F) -> F:
    """Option --report, naming the folder of the page."""
    return click.option(
        "--report",
        "report",
        metavar="DIR",
        help="Write report.html into DIR: one page that works offline; DIR may end in .html.",
    )(function)


def title_option(function: F) -> F:
    """Option --title, of the page and the pictures."""
    kept: dict[str, Any] = {"expose_value": False, "callback": _keep_title}
    return click.option("--title", metavar="TEXT", help="Title of the page, or of pictures.", **kept)(function)


def _keep_title(context: click.Context, parameter: click.Parameter, value: str | None) -> None:
    context.meta[_TITLE] = value


def given_title() -> str | None:
    """What --title says, None where it says nothing."""
    context = click.get_current_context(silent=True)
    return (context.meta.get(_TITLE) if context is not None else None) or None


def check_title(path: str | None, option: str) -> None:
    """Refuse a title of nothing; raises click.UsageError."""
    if given_title() is not None and path is None:
        raise click.UsageError(f"--title is of what {option} writes: add it", click.get_current_context(silent=True))


def check_report(path: str | None) -> None:
    """Make the folder of the page, and refuse a place that cannot be written, before anything is computed."""
    if path is None:
        return
    if not path or path == output.STDOUT:
        raise click.UsageError(f"--report {path!r}: name a folder", click.get_current_context(silent=True))
    from piazzi.present.report.write import page_path

    target = page_path(path)
    output.make_folder(target.parent, target.name)
    output.check_output(str(target), PAGES)


def title_and_planet(source: str, name: str, scenario: str | None) -> tuple[str, float | None]:
    """Title of a problem and radius of its planet, as its scenario says; `name` and None where there is none.

    The title is that of --title where it is given.
    """
    from piazzi.scenarios import load_scenario

    text = scenario or source
    try:  # the founding layout is that problem
        found = load_scenario("satellite-bearing" if text.lower().endswith(".npz") else text)
    except (ValueError, OSError):
        return given_title() or name, None
    return given_title() or found.title or name, found.picture.planet_radius


def write_page(path: str, tabs: Sequence[Tab], title: str | None = None) -> Path:
    """Write the page of these tabs, with how it was made; returns its path."""
    from dataclasses import replace

    from piazzi import __version__
    from piazzi.present.report import write_page as write

    problems = [tab for tab in tabs if not tab.at]
    named = problems[0].title if len(problems) == 1 else f"{len(problems)} problems"
    shown = given_title() or title or f"Piazzi report: {named}"
    sources = _sources()
    told = [
        replace(tab, sections=[*tab.sections, _made(sources[i] if i < len(sources) in (1, len(problems)) else None)])
        for i, tab in enumerate(problems)
    ]
    told += [tab for tab in tabs if tab.at]
    return write(path, shown, told, foot=f"Made by Piazzi {__version__}. The page needs no network.")


def _parameters() -> dict[str, Any]:
    context = click.get_current_context(silent=True)
    return dict(context.params) if context is not None else {}


def _sources() -> list[str]:
    """The sources that the command was given, the scenario of theirs in their place."""
    given = _parameters()
    named = given.get("sources") or [one for one in (given.get("source") or given.get("scenario"),) if one]
    return [str(given.get("scenario") or one) for one in named]


def _scenario_text(source: str) -> str | None:
    """What a scenario says, letter by letter; None for what is none, or can be read no more, as standard input."""
    from piazzi.scenarios import names, show

    if source in names():
        return show(source)
    try:
        return Path(source).read_text(encoding="utf-8") if source.lower().endswith(".toml") else None
    except (OSError, ValueError):
        return None


def _made(source: str | None) -> Section:
    """The command, the version and the date, the seed of what was simulated, and the scenario."""
    from datetime import UTC, datetime

    from piazzi import __version__
    from piazzi.determination.determining import plain_command
    from piazzi.present.report import Section
    from piazzi.present.report.blocks import Block, Code, Text

    seed = _parameters().get("seed")
    facts = [f"Piazzi {__version__}, {datetime.now(UTC):%Y-%m-%d %H:%M} UTC.", *([] if seed is None else [f"Seed {seed}."])]
    scenario = _scenario_text(source) if source else None
    blocks: list[Block] = [Code(plain_command(["piazzi", *sys.argv[1:]])), Text([" ".join(facts)])]
    return Section("How it was made", [*blocks, *([Code(scenario)] if scenario else ())], folded=True)
