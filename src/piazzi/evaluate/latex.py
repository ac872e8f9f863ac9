"""Tables of text as LaTeX, in the manner of booktabs; values are rounded by their sigmas already."""

from __future__ import annotations

import re
from collections.abc import Sequence

from piazzi.evaluate.grids import Grid
from piazzi.text import printable

_SIGNS = {
    "\\": r"\textbackslash{}", "&": r"\&", "%": r"\%", "$": r"\$", "#": r"\#", "_": r"\_", "{": r"\{", "}": r"\}",
    "~": r"\textasciitilde{}", "^": r"\textasciicircum{}", "±": r"$\pm$", "°": r"$^\circ$",
}  # fmt: skip
_POWER = re.compile(r"(?<=[a-z])\^(-?\d+)")
_NUMBER = re.compile(r"([-+]?\d+(?:\.\d+)?)(?:e([-+]?\d+))?")


def as_latex(grids: Sequence[Grid]) -> str:
    """A tabular for each table, its title in a comment before it."""
    return "\n".join(map(_tabular, grids))


def _tabular(grid: Grid) -> str:
    columns = "l" * grid.left + "r" * (len(grid.heads) - grid.left)
    lines = [
        f"% {printable(grid.title)}",
        rf"\begin{{tabular}}{{{columns}}}",
        r"\toprule",
        _row(grid.heads, grid.left),
        r"\midrule",
    ]
    return "\n".join([*lines, *(_row(row, grid.left) for row in grid.rows), r"\bottomrule", r"\end{tabular}", ""])


def _row(cells: Sequence[str], left: int) -> str:
    """A line; the first cells are words, be they digits."""
    return " & ".join(_words(cell) if i < left else _cell(cell) for i, cell in enumerate(cells)) + r" \\"


def _words(text: str) -> str:
    """Text with what LaTeX takes for commands written out, and powers of units raised."""
    parts = _POWER.split(printable(text.replace("\n", " ")))
    return "".join(f"$^{{{part}}}$" if i % 2 else "".join(_SIGNS.get(s, s) for s in part) for i, part in enumerate(parts))


def _cell(text: str) -> str:
    """Text as LaTeX reads it; numbers have a minus sign, and a power of ten where they have an exponent."""
    found = _NUMBER.fullmatch(text.strip())
    if found is None:
        return _words(text)
    power = rf" \times 10^{{{int(found[2])}}}" if found[2] else ""
    return f"${found[1]}{power}$"
