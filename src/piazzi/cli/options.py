"""Arguments and options that several commands share; files of a command that are the same are refused."""

from __future__ import annotations

import inspect
import os
import re
import stat
from collections.abc import Callable, Hashable, Iterable, Mapping
from contextlib import suppress
from itertools import combinations
from typing import Any, TypeVar

import click

from piazzi.cli.completing import completed

F = TypeVar("F", bound=Callable[..., Any])


source = click.argument("source", metavar="SOURCE")
as_json = click.option("--json", "as_json", is_flag=True, help="Print one JSON object on stdout, and nothing else there.")
scenario = click.option("--scenario", metavar="NAME", help="Scenario that defines the problem, for CSV and tracking files.")
STREAM = "-"


class WholeNumber(click.IntRange):
    """A whole number in a range, by that name where it is refused."""

    name = "whole number"


def number(text: str) -> float:
    """A number, by that name where it is refused."""
    try:
        return float(text)
    except ValueError:
        raise click.BadParameter(f"{text!r} is not a valid number.") from None


def duration(text: str) -> float:
    """A positive length of time in seconds, with or without a unit."""
    from piazzi.units import positive_duration

    try:
        return positive_duration(text, "it")
    except ValueError as error:
        raise click.BadParameter(str(error)) from None


# arguments that stand for what `piazzi determine` makes of a case, with the ending of its file
_OF_CASES = {"ORBIT": ".oem", "A": ".oem", "B": ".oem", "SOURCE": ".toml", "SCENARIO": ".toml"}

seed = click.option("--seed", type=WholeNumber(0), metavar="N", default=0, show_default=True, help="Seed of simulation.")


def estimators(default: str) -> Callable[[F], F]:
    """Option --with, repeatable; `default` is what runs without it."""
    return click.option(
        "--with",
        "names",
        metavar="ESTIMATOR",
        multiple=True,
        help=f"Estimator, may be repeated; see below.  [default: {default}]",
    )


def output(what: str) -> Callable[[F], F]:
    """Option -o, naming the file that the command writes."""
    return click.option("-o", "--output", "output_file", metavar="FILE", help=what)


class Command(click.Command):
    """A command whose docstring may have a paragraph of examples, which keeps its lines in the help.

    Before it runs, the files that it was given are found to be different ones.  Shells complete what it takes.
    """

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        completed(self.params)

    def format_help_text(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        self.help = keep_examples(self.help)
        super().format_help_text(ctx, formatter)

    def invoke(self, ctx: click.Context) -> Any:
        check_places(ctx.params)
        for param in self.params:
            _no_case(ctx.params.get(param.name or ""), param.metavar or "")
        return super().invoke(ctx)


def _no_case(given: Any, what: str) -> None:
    """Raise ValueError where tracking of the package stands for an orbit or a problem that is yet to be made of it."""
    if what not in _OF_CASES or not isinstance(given, str) or not re.fullmatch(r"\w+(-\w+)+", given):
        return
    from piazzi.determination.case_file import refuse_case

    refuse_case(given, _OF_CASES[what])


class Group(click.Group):
    """The same for a group of commands."""

    command_class = Command

    def format_help_text(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        self.help = keep_examples(self.help)
        super().format_help_text(ctx, formatter)


def keep_examples(text: str | None) -> str:
    """Help text that click does not fill where examples begin."""
    return re.sub(r"\n\nExamples:?\n(-+\n)?", "\n\n\b\nExamples:\n", inspect.cleandoc(text or ""))


class WithEstimators(Command):
    """A command whose help ends with the estimators that there are."""

    def format_epilog(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        from piazzi.estimate.registry import ESTIMATORS

        with formatter.section("Estimators"):
            formatter.write_dl([(entry.syntax, entry.summary) for entry in ESTIMATORS.values()])
        super().format_epilog(ctx, formatter)


def parsed(names: tuple[str, ...], default: tuple[str, ...]) -> dict[str, Any]:
    """Estimators by the text that asked for them.

    Raises
    ------
    click.UsageError
        For a name or an option that does not exist.
    """
    from piazzi.estimate.registry import parse

    try:
        return {name.strip(): parse(name) for name in names or default}
    except ValueError as error:
        raise click.UsageError(f"--with: {error}", click.get_current_context(silent=True)) from None


def check_places(given: Mapping[str, Any]) -> None:
    """Refuse parameters of a command of which one names what another would overwrite.  Nothing is opened, nothing changed.

    Raises
    ------
    click.UsageError
        Where a file that is written is one that is read, or is written twice, by whatever names.
    """
    sources = given.get("sources") or given.get("files") or (given.get("source"),)
    scenario = "--scenario" if {"source", "sources"} & given.keys() else "SCENARIO"
    read = [*(("SOURCE", s, 0) for s in sources), (scenario, given.get("scenario"), 0), ("--follow", given.get("follow"), 0)]
    output = given.get("output_file")
    printed = given.get("follow") is not None and output is None  # estimates of a stream come while it is read
    written = [("-o", STREAM if printed else output, 1), ("--checkpoint", given.get("checkpoint"), 1)]
    written.append(("--to", given.get("target"), 1))
    for (label, path, key), (other, second, also) in combinations([*_keyed(written), *_keyed(read)], 2):
        if key == also and label in ("-o", "--checkpoint", "--to"):
            first, then = (_shown(*place) for place in ((label, path), (other, second)))
            raise click.UsageError(f"{first} and {then} are the same file", click.get_current_context(silent=True))


def _keyed(places: Iterable[tuple[str, Any, int]]) -> list[tuple[str, str, Hashable]]:
    """Those that are files, each with what it is the same file by."""
    found = [(label, path, _key(path, handle)) for label, path, handle in places if isinstance(path, str) and path]
    return [(label, path, key) for label, path, key in found if key is not None]


def _key(path: str, handle: int) -> Hashable | None:
    """Device and number of a file, where its name leads to for one that is not there yet; None for what is no file."""
    with suppress(OSError, ValueError):
        try:
            found = os.fstat(handle) if path == STREAM else os.stat(path)
        except FileNotFoundError:
            return os.path.realpath(path)
        return (found.st_dev, found.st_ino) if stat.S_ISREG(found.st_mode) else None
    return None


def _shown(label: str, path: str) -> str:
    if path == STREAM:
        return "standard output" if label == "-o" else "standard input"
    return f"{label} {path}"
