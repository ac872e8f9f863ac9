"""``piazzi scenarios``: the built-in problems, and files of one's own."""

from __future__ import annotations

import click

from piazzi.cli import options, output
from piazzi.cli.running import BAD_INPUT, DONE


@click.group(cls=options.Group, invoke_without_command=True)
@click.pass_context
def command(ctx: click.Context) -> None:
    """List, show and check problems as files.

    Examples:
      piazzi scenarios list
      piazzi scenarios show b612-range > mine.toml
      piazzi scenarios check mine.toml
    """
    if ctx.invoked_subcommand is None:
        ctx.invoke(list_)


@command.command("list")
@options.as_json
def list_(as_json: bool) -> int:
    """List the built-in scenarios."""
    from piazzi.scenarios import load_scenario, names

    found = [load_scenario(name) for name in names()]
    if as_json:
        rows = [
            {
                "name": s.name,
                "title": s.title,
                "epochs": len(s.times),
                "prior_time": s.problem.prior_time,
                "states": list(s.problem.model.names),
            }
            for s in found
        ]
        output.print_json({"schema": "piazzi.scenarios/1", "scenarios": rows})
    else:
        width = max(len(s.name) for s in found)
        output.print_text("\n".join(f"{s.name:{width}}  {s.title}, {len(s.times):,} epochs" for s in found))
    return DONE


@command.command()
@click.argument("name", default="template")
@click.option("--equations", "as_equations", is_flag=True, help="Print the equations that result; NAME may be a file.")
def show(name: str, as_equations: bool) -> int:
    """Print the text of a scenario.

    The file is commented and made to be edited; without NAME it is a template.
    """
    from piazzi.scenarios import load_scenario
    from piazzi.scenarios import show as text_of

    if as_equations:
        from piazzi.present.equations import equations

        output.print_text(equations(load_scenario(name).problem))
        return DONE
    output.print_text(text_of(name))
    return DONE


@command.command()
@click.argument("path", metavar="FILE")
def check(path: str) -> int:
    """List all that is wrong with a file, or say where its prior stands.

    The prior is at the start of [times]; time = 5.0 in [prior] is another time, time = "first" the first measurement of
    whatever is estimated.
    """
    from piazzi.cli.running import say
    from piazzi.scenarios import check as faults_of
    from piazzi.scenarios import load_scenario

    faults = faults_of(path)
    for fault in faults:
        say(f"{path}: {fault}")
    if faults:
        return BAD_INPUT
    scenario = load_scenario(path)
    if scenario.problem.prior_time is None:
        where = "the prior is at the first measurement, whenever that is"
    else:
        from piazzi.present.tables import prior_place

        where = prior_place(scenario.problem, scenario.times)
    output.print_rich(f"{path}: nothing wrong; {where}")
    return DONE
