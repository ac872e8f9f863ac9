"""Tables of text, shown the same in a terminal and in a notebook."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from html import escape
from typing import Any

from piazzi.evaluate.quantities import printable


@dataclass(frozen=True)
class Grid:
    """A table of text: a title, a heading for every column (lines apart by a newline), rows; `left` columns hold words."""

    title: str
    heads: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    left: int = 1


def as_rich(grid: Grid) -> Iterable[Any]:
    """The title and a table for rich."""
    from rich import box
    from rich.table import Table
    from rich.text import Text

    table = Table(box=box.SIMPLE_HEAD, header_style="bold", show_edge=False, padding=(0, 1, 0, 0))
    for i, head in enumerate(grid.heads):
        table.add_column(
            Text("\n".join(map(printable, head.split("\n")))),
            justify="left" if i < grid.left else "right",
            no_wrap=True,
            vertical="bottom",
        )
    for row in grid.rows:
        table.add_row(*(Text(printable(cell)) for cell in row))
    if grid.title:
        yield Text(printable(grid.title), style="bold")
    yield table
    yield Text("")


def as_html(grids: Sequence[Grid], sentences: Sequence[str]) -> str:
    """Tables and sentences for a notebook; all text is escaped."""
    parts = []
    for grid in grids:
        head = "".join(f"<th>{escape(h)}</th>".replace("\n", "<br>") for h in grid.heads)
        body = "".join("<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>" for row in grid.rows)
        title = f"<caption>{escape(grid.title)}</caption>" if grid.title else ""
        parts.append(f"<table>{title}<thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>")
    return "".join(parts) + "".join(f"<p>{escape(line)}</p>" for line in sentences)


def as_text(value: Any) -> str:
    """What a wide terminal without colours shows of something that rich can print."""
    from rich.console import Console

    console = Console(width=200, color_system=None, force_terminal=False)
    with console.capture() as captured:
        console.print(value)
    return captured.get()
