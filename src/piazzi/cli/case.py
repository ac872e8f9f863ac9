"""Options of a case on the command line, of which --help shows the usual ones and --help-all the rest."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import click

from piazzi.cli import options
from piazzi.cli.options import F
from piazzi.determination.case import OPTIONS, Case, Option
from piazzi.determination.case_file import split

USUAL = ("sigma", *(name for name, option in OPTIONS.items() if option.usual))


class WithCase(options.WithEstimators):
    """A command with the options of a case."""

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        every = ctx.meta.get("piazzi.help_all", False)
        shown = [p for p in self.get_params(ctx) if (every and isinstance(p, click.Option)) or p.name in (*USUAL, "help_all")]
        records = [record for p in shown if (record := p.get_help_record(ctx)) is not None]
        with formatter.section("Options"):
            formatter.write_dl(records)


def case_options(function: F) -> F:
    """Every option of `Case`, and --help-all."""
    decorated = click.option(
        "--help-all", is_flag=True, is_eager=True, expose_value=False, callback=_help_all, help="Show all options and exit."
    )(function)
    for name, option in reversed(list(OPTIONS.items())):
        decorated = decorated if option.flags is None else _option(name, option)(decorated)
    return decorated


def said_case(files: Sequence[str], words: Mapping[str, Any]) -> tuple[tuple[str, ...], Case]:
    """Files of tracking, and what a case among them and options say; raises ValueError for what cannot be, OSError."""
    tracking, base = split(files)
    given = {name: value for name, value in words.items() if value not in (None, (), False)}
    return tuple(tracking), base.told(given, "--{}")


def _option(name: str, option: Option) -> Any:
    flags = option.flags or (f"--{name.rstrip('_').replace('_', '-')}",)
    if not option.metavar:
        return click.option(*flags, name, is_flag=True, help=option.help)
    kind = click.Choice(option.choices) if option.choices else None
    return click.option(*flags, name, metavar=option.metavar, type=kind, multiple=option.many, help=option.help)


def _help_all(ctx: click.Context, parameter: click.Parameter, asked: bool) -> None:
    if asked:
        ctx.meta["piazzi.help_all"] = True
        click.echo(ctx.get_help())
        ctx.exit()
