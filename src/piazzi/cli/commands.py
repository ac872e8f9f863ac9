"""The ``piazzi`` command, which finds the others, each in the file of its name, when they are called."""

from __future__ import annotations

from importlib import import_module

import click

from piazzi import __version__
from piazzi.cli.options import Group
from piazzi.text import nearest

GROUPS = {
    "Orbits from tracking": ("determine", "tracking", "propagate", "ephemeris", "difference", "orbits"),
    "Estimators side by side": ("compare", "estimate", "study", "windows", "observability", "report"),
    "Scenarios and data": ("demo", "scenarios", "simulate", "data", "cite"),
}
COMMANDS = tuple(name for group in GROUPS.values() for name in group)


class Commands(Group):
    """A group whose commands are imported when somebody asks for them."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in COMMANDS:
            return None
        command: click.Command = import_module(f"piazzi.cli.{cmd_name}").command
        return command

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """What there is, by what people want."""
        width = formatter.width - 4 - max(map(len, COMMANDS))
        for heading, names in GROUPS.items():
            commands = [(name, self.get_command(ctx, name)) for name in names]
            with formatter.section(heading):
                formatter.write_dl([(name, command.get_short_help_str(width)) for name, command in commands if command])

    def resolve_command(self, ctx: click.Context, args: list[str]) -> tuple[str | None, click.Command | None, list[str]]:
        if args and not args[0].startswith("-") and args[0] not in COMMANDS:
            ctx.fail(f"unknown command {args[0]!r}{nearest(args[0], COMMANDS)}")
        return super().resolve_command(ctx, args)


@click.group(cls=Commands, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100})
@click.version_option(__version__, "-V", "--version", message="%(prog)s %(version)s")
def piazzi() -> None:
    """Orbits from tracking data: several estimators side by side, and which of them to trust.

    SOURCE is a recording (.npz, .nc, or with --scenario .csv, TDM, SP3, ...), the name of a built-in scenario, a scenario
    file (.toml), or - for standard input.

    Examples:
      piazzi demo -o demo                       a first look: tables and pictures
      piazzi tracking pass.tdm                  what is in a file of tracking data
      piazzi determine lageos-2                 an orbit from tracking: lasers
      piazzi orbits pass.tdm                    every orbit that a tracking allows
      piazzi estimate tracking.npz              the states and their uncertainty
      piazzi compare b612-range --with ekf --with graph
      piazzi windows tracking.npz               how long a window has to be
      piazzi observability b612-range-q0        what can be seen, and how well
      piazzi propagate orbit.oem --to "3 day"   predicted states, covariances
      piazzi ephemeris orbit.oem --from 7090    when and where it is seen
      piazzi difference fit.oem truth.sp3       how far two orbits are apart
      piazzi report tracking.npz -o page.html   a self-contained interactive page
      piazzi scenarios list                     what is built in
      piazzi data                               which data are used, how old
      piazzi cite                               what a paper should name

    Exit status: 0 done, 2 bad usage or input, 3 an estimator did not succeed or no
    orbit was determined.
    """
