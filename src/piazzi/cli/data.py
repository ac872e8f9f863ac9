"""``piazzi data``: what data are used, how old they are, and newer ones."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from piazzi.cli import options, output
from piazzi.cli.running import DONE

FILES = {"eop": "finals2000A.all", "weather": "SW-All.csv", "kernel": "de440s.bsp"}
folder = click.option(
    "--data",
    "folder",
    metavar="DIR",
    type=click.Path(exists=True, file_okay=False, path_type=Path),
    help="Folder that is looked in first.",
)


@click.group(cls=options.Group, invoke_without_command=True)
@folder
@options.as_json
@click.pass_context
def command(ctx: click.Context, folder: Path | None, as_json: bool) -> int:
    """Show which data are used and what their age costs.

    Files are looked for in --data, in the folder that PIAZZI_EARTH names, then in the user's data folder, and are told by
    their content. Nothing is fetched unless `piazzi data get` is typed.

    Examples:
      piazzi data
      piazzi data get eop
      piazzi data get kernel --data ephemerides
    """
    if ctx.invoked_subcommand is None:
        _show(folder, as_json)
    elif folder is not None or as_json:
        raise click.UsageError(f"options come after {ctx.invoked_subcommand}", ctx)
    return DONE


def _show(folder: Path | None, as_json: bool) -> None:
    from dataclasses import asdict

    from piazzi.earth.finding import data_folders, use_data
    from piazzi.earth.inventory import inventory

    if folder is not None:
        use_data(folder)
    entries = inventory()
    folders = [str(place) for place in data_folders()]
    if as_json:
        output.print_json({"schema": "piazzi.data/1", "folders": folders, "data": [asdict(entry) for entry in entries]})
        return
    from rich.table import Table

    table = Table(box=None, pad_edge=False)
    for column in ("data", "file", "to", "predicted from", "what its age costs", "from"):
        table.add_column(column, overflow="fold")
    for e in entries:
        table.add_row(e.kind, e.file or "none", e.last, e.predicted, e.cost, e.address)
    output.print_rich(table, f"Looked for in {', '.join(folders)}")


@command.command()
@click.argument("kind", metavar="KIND", type=click.Choice(tuple(FILES)))
@folder
@click.option("--from", "address", metavar="URL", help="Another address, such as a mirror.")
def get(kind: str, folder: Path | None, address: str | None) -> int:
    """Fetch newer data: eop, weather or kernel.

    eop is finals2000A of the IERS, weather the space weather of CelesTrak, kernel de440s.bsp of JPL (32 MB). The file is
    checked before it takes the place of an older one.
    """
    from piazzi.earth.finding import user_folder
    from piazzi.earth.inventory import ADDRESSES
    from piazzi.io.fetching import download

    place = folder or user_folder()
    place.mkdir(parents=True, exist_ok=True)
    path = place / FILES[kind]
    address = address or ADDRESSES[kind]
    count = download(address, path, _checks()[kind])
    output.print_text(f"Wrote {path}, {count:,} bytes from {address}")
    return DONE


def _checks() -> dict[str, Any]:
    from piazzi.earth.eop import read_eop
    from piazzi.earth.finding import check_kernel
    from piazzi.earth.space_weather import read_space_weather

    return {"eop": read_eop, "weather": read_space_weather, "kernel": check_kernel}
