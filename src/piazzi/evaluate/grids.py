"""Tables of text, shown the same in a terminal and in a notebook."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from html import escape
from typing import TYPE_CHECKING, Any

from piazzi.evaluate.quantities import NOTHING
from piazzi.text import printable

if TYPE_CHECKING:
    from rich.console import Console, ConsoleOptions


@dataclass(frozen=True)
class Grid:
    """A table of text.

    Attributes
    ----------
    title : str
    heads : heading of each column, lines apart by a newline
    rows : tuples of as many texts
    left : how many columns, from the left, hold words
    spare : columns to leave out, in this order, where the table is too wide
    """

    title: str
    heads: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    left: int = 1
    spare: tuple[int, ...] = ()

    def without(self, columns: Sequence[int]) -> Grid:
        """The table without these columns."""
        kept = [i for i in range(len(self.heads)) if i not in columns]
        rows = tuple(tuple(row[i] for i in kept) for row in self.rows)
        left = sum(i < self.left for i in kept)
        return Grid(self.title, tuple(self.heads[i] for i in kept), rows, left)


def as_rich(
    grids: Sequence[Grid], sentences: Iterable[str], console: Console, options: ConsoleOptions, above: Iterable[str] = ()
) -> Iterable[Any]:
    """Tables for rich, with sentences below and `above` them."""
    from rich.text import Text

    for line in above:
        yield Text(printable(line))
    for grid in grids:
        yield from _fitted(grid, console, options)
    for line in sentences:
        yield Text(printable(line))


def _fitted(grid: Grid, console: Console, options: ConsoleOptions) -> Iterable[Any]:
    """The title and a table for rich, without spare columns where it would be too wide; then each row as a block of lines."""
    from rich.text import Text

    if grid.title:
        yield Text(printable(grid.title), style="bold")
    for count in range(len(grid.spare) + 1):
        table = _table(grid.without(grid.spare[:count]))
        if fits(table, console, options):
            yield table
            break
    else:
        yield from _blocks(grid)
    yield Text("")


def rich_table(
    heads: Iterable[tuple[str, bool]], rows: Iterable[Iterable[str]], style: Callable[[str], str] = lambda cell: ""
) -> Any:
    """A table for rich that does not wrap: headings, each with whether its column holds words, and rows of printable text."""
    from rich import box
    from rich.table import Table
    from rich.text import Text

    table = Table(box=box.SIMPLE_HEAD, header_style="bold", show_edge=False, padding=(0, 1, 0, 0))
    for head, words in heads:
        table.add_column(Text(head), justify="left" if words else "right", no_wrap=True, vertical="bottom")
    for row in rows:
        table.add_row(*(Text(cell, style=style(cell)) for cell in row))
    return table


def fits(table: Any, console: Console, options: ConsoleOptions) -> bool:
    """Whether a table is no wider than the terminal."""
    from rich.measure import Measurement

    return Measurement.get(console, options.update(max_width=10_000), table).maximum <= options.max_width


def _table(grid: Grid) -> Any:
    heads = [("\n".join(map(printable, head.split("\n"))), i < grid.left) for i, head in enumerate(grid.heads)]
    return rich_table(heads, [map(printable, row) for row in grid.rows])


def _blocks(grid: Grid) -> Iterable[Any]:
    """Every row as its first text and lines of heading and value."""
    from rich.text import Text

    for row in grid.rows:
        yield Text(printable(f"{grid.heads[0]} {row[0]}".replace("\n", " ").strip()))
        for head, cell in list(zip(grid.heads, row, strict=True))[1:]:
            if cell not in ("", NOTHING):
                yield Text(printable(f"  {head}: {cell}".replace("\n", " ")))


def as_html(grids: Sequence[Grid], sentences: Iterable[str]) -> str:
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
