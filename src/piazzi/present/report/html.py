"""Small pieces of HTML, where all text is escaped; numbers as short text, and JSON that is safe inside a page."""

from __future__ import annotations

import json
from base64 import b64encode
from collections.abc import Mapping, Sequence
from html import escape
from typing import Any

import numpy as np

from piazzi.present.report.blocks import Key, Line, Point, Tab, Table
from piazzi.problem.checks import Array
from piazzi.text import printable

_EVEN = 1e-9  # of the span: times that are so near to evenly spaced are told by their start and step


def text(words: str) -> str:
    """Words as HTML, control characters written out."""
    return escape(printable(words))


def lines(words: str) -> str:
    """Lines as HTML, where they end as they were written; other control characters are written out."""
    return "\n".join(map(text, words.splitlines()))


def tab_chooser(tabs: Sequence[Tab]) -> str:
    """A button for every tab; those with values of what was varied share one, and a list of values for each number."""
    if any(tab.at for tab in tabs):
        return _picker(tabs)
    buttons = "".join(
        f'<button type="button" role="tab" id="tab-t{n}" aria-controls="t{n}" aria-selected="{"true" if n == 0 else "false"}"'
        f' tabindex="{0 if n == 0 else -1}">{text(tab.title)}</button>'
        for n, tab in enumerate(tabs)
    )
    return f'<nav class="wide" role="tablist" aria-label="Problems">{buttons}</nav>'


def _picker(tabs: Sequence[Tab]) -> str:
    values: dict[str, dict[str, None]] = {}
    for name, value in (pair for tab in tabs for pair in tab.at):
        values.setdefault(name, {})[value] = None
    lists = "".join(
        f'<label>{text(name)} <select data-axis="{i}">'
        + "".join(f'<option value="{text(v)}">{text(v)}</option>' for v in found)
        + "</select></label>"
        for i, (name, found) in enumerate(values.items())
    )
    whole = "".join(
        f'<button type="button" class="quiet" data-tab="{n}" aria-pressed="false">Whole grid</button>'
        for n, tab in enumerate(tabs)
        if not tab.at
    )
    return (
        f'<nav class="wide picker" aria-label="Points of the grid">{whole}'
        f'<button type="button" class="quiet" data-tab="at" aria-pressed="false">One point</button>{lists}</nav>'
    )


def legend(lines: Sequence[Line]) -> str:
    """Marks and labels of lines that have no entry in the legend of the tab."""
    found = {line.label: line for line in lines if line.key < 0}
    items = "".join(f"<span>{_mark(line)}{text(line.label)}</span>" for line in found.values())
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


def _mark(line: Line) -> str:
    """What stands for a line in a legend: a dot for points, a cross for crosses."""
    if line.kind == "points":
        inside = f'<circle cx="5" cy="4" r="3" fill="{escape(line.colour)}"/>'
    elif line.kind == "crosses":
        inside = '<path class="rejected" d="M2 1l6 6m-6 0l6 -6"/>'
    else:
        return line_mark(Key(line.label, line.colour, line.dash))
    return f'<svg width="10" height="8" aria-hidden="true">{inside}</svg>'


def table_panel(table: Table) -> str:
    """A table that scrolls by itself where it is too wide."""
    words = [' class="words"' if i in table.words else "" for i in range(len(table.heads))]
    head = "".join(
        f'<th scope="col"{words[i]}>{text(name)}{f"<small>{text(unit)}</small>" if unit else ""}</th>'
        for i, (name, unit) in enumerate(table.heads)
    )
    rows = []
    for i, row in enumerate(table.rows):
        key = f' data-key="{table.keys[i]}"' if i < len(table.keys) and table.keys[i] >= 0 else ""
        first, *rest = row
        rows.append(
            f'<tr{key}><th scope="row">{text(first)}</th>'
            + "".join(f"<td{words[i]}>{text(v)}</td>" for i, v in enumerate(rest, 1))
            + "</tr>"
        )
    caption = f"<caption>{text(table.caption)}</caption>" if table.caption else ""
    label = text(table.caption) or "Table"
    size = "panel" if table.half else "panel full"
    return (
        f'<div class="{size}"><div class="scroll" tabindex="0" role="region" aria-label="{label}">'
        f"<table>{caption}<thead><tr>{head}</tr></thead><tbody>{''.join(rows)}</tbody></table></div></div>"
    )


def save_buttons(title: str) -> str:
    """Buttons that keep a drawing as a file."""
    buttons = "".join(
        f'<button type="button" class="save" data-as="{kind.lower()}" aria-label="{kind} of {text(title)}">{kind}</button>'
        for kind in ("SVG", "PNG", "CSV")
    )
    return f'<div class="saves"><span>Save as</span>{buttons}</div>'


class Pool:
    """All arrays of a page, each once; what draws them holds their numbers here."""

    def __init__(self) -> None:
        self.entries: list[Any] = []
        self._known: dict[bytes, int] = {}

    def add(self, values: Array) -> int:
        """Number of the array, which is kept to one part in 65,536, in 4 characters a value."""
        return self._add(packed(values))

    def add_exactly(self, values: Array) -> int:
        """Number of the array, kept in double precision: for times, of which neighbours differ in the last digits."""
        values = np.asarray(values, dtype=np.float64)
        step = float(values[-1] - values[0]) / max(len(values) - 1, 1) if len(values) else 0.0
        even = len(values) > 2 and np.allclose(np.diff(values), step, rtol=0, atol=_EVEN * abs(step))
        if even:
            return self._add([float(values[0]), step, len(values)])
        return self._add({"double": b64encode(values.astype("<f8").tobytes()).decode("ascii")})

    def add_length(self, parts: tuple[Array, ...]) -> int:
        """Number of the root of the summed squares of these arrays, which the page computes."""
        return self._add({"length": [self.add(part) for part in parts]})

    def _add(self, entry: Any) -> int:
        key = json.dumps(entry).encode()
        if key not in self._known:
            self._known[key] = len(self.entries)
            self.entries.append(entry)
        return self._known[key]


def packed(values: Array) -> str:
    """The upper 24 bits of every value in single precision, rounded, as base64; what is not finite becomes NaN."""
    finite = np.isfinite(values) & (np.abs(values) < np.finfo(np.float32).max / 2)
    single = np.where(finite, values, np.nan).astype("<f4")
    bits = single.view("<u4")
    rounded = np.where(finite, bits + 0x80, 0x7FC00000).astype("<u4") >> 8
    return b64encode(rounded.view(np.uint8).reshape(-1, 4)[:, :3].tobytes()).decode("ascii")


def script_json(value: Mapping[str, Any]) -> str:
    """Strict JSON that ends no script element and holds nothing that HTML or JavaScript reads otherwise."""
    text = json.dumps(value, allow_nan=False, ensure_ascii=True, separators=(",", ":"))
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")
