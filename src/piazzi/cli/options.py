"""Arguments and options that several commands share."""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable
from typing import Any, TypeVar

import click

from piazzi.cli.places import check_places

F = TypeVar("F", bound=Callable[..., Any])


class WholeNumber(click.IntRange):
    """A whole number in a range, by that name where it is refused."""

    name = "whole number"


def number(text: str) -> float:
    """A number, by that name where it is refused."""
    try:
        return float(text)
    except ValueError:
        raise click.BadParameter(f"{text!r} is not a valid number.") from None


source = click.argument("source", metavar="SOURCE")
as_json = click.option("--json", "as_json", is_flag=True, help="Print one JSON object on stdout, and nothing else there.")
seed = click.option("--seed", type=WholeNumber(0), metavar="N", default=0, show_default=True, help="Seed of simulation.")
scenario = click.option("--scenario", metavar="NAME", help="Scenario that defines the problem for CSV input.")


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

    Before it runs, the files that it was given are found to be different ones.
    """

    def format_help_text(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        self.help = keep_examples(self.help)
        super().format_help_text(ctx, formatter)

    def invoke(self, ctx: click.Context) -> Any:
        check_places(ctx.params)
        return super().invoke(ctx)


class Group(click.Group):
    """The same for a group of commands."""

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
