"""Small pieces of HTML; all text is escaped here."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

from piazzi.present.report.blocks import Key, Line, Point, Tab, Table
from piazzi.text import printable


def text(words: str) -> str:
    """Words as HTML, control characters written out."""
    return escape(printable(words))


def tab_chooser(tabs: Sequence[Tab]) -> str:
    """A button for every tab."""
    buttons = "".join(
        f'<button type="button" role="tab" id="tab-t{n}" aria-controls="t{n}" aria-selected="{"true" if n == 0 else "false"}"'
        f' tabindex="{0 if n == 0 else -1}">{text(tab.title)}</button>'
        for n, tab in enumerate(tabs)
    )
    return f'<nav class="wide" role="tablist" aria-label="Problems">{buttons}</nav>'


def legend(lines: Sequence[Line]) -> str:
    """Marks and labels of lines that have no entry in the legend of the tab."""
    found = {line.label: Key(line.label, line.colour, line.dash) for line in lines if line.key < 0}
    items = "".join(f"<span>{line_mark(key)}{text(key.label)}</span>" for key in found.values())
    return f'<div class="legend">{items}</div>' if items else ""


def summary_point(point: Point) -> str:
    """One entry of a summary."""
    return f'<div class="{point.tone}"><dt>{text(point.heading)}</dt><dd>{text(point.text)}</dd></div>'


def line_mark(key: Key) -> str:
    """A short line as it is in the charts."""
    dash = " ".join(map(str, key.dash))
    return (
        '<svg width="22" height="8" aria-hidden="true"><line x1="1" y1="4" x2="21" y2="4" '
        f'stroke="{escape(key.colour)}" stroke-width="3" stroke-dasharray="{dash}"/></svg>'
    )


def table_panel(table: Table) -> str:
    """A table that scrolls by itself where it is too wide."""
    head = "".join(
        f'<th scope="col">{text(name)}{f"<small>{text(unit)}</small>" if unit else ""}</th>' for name, unit in table.heads
    )
    rows = []
    for i, row in enumerate(table.rows):
        key = f' data-key="{table.keys[i]}"' if i < len(table.keys) and table.keys[i] >= 0 else ""
        first, *rest = row
        rows.append(f'<tr{key}><th scope="row">{text(first)}</th>' + "".join(f"<td>{text(v)}</td>" for v in rest) + "</tr>")
    caption = f"<caption>{text(table.caption)}</caption>" if table.caption else ""
    label = text(table.caption) or "Table"
    return (
        f'<div class="panel full"><div class="scroll" tabindex="0" role="region" aria-label="{label}">'
        f"<table>{caption}<thead><tr>{head}</tr></thead><tbody>{''.join(rows)}</tbody></table></div></div>"
    )
