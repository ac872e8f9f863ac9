"""Pages of the gallery as notebooks: prose and code in cells, in order; what code prints comes out anew.

python docs/machinery/notebooks.py PAGE FILE.ipynb
"""

from __future__ import annotations

import json
import re
import sys
from pathlib import Path

from blocks import FENCE


def notebook(page: str) -> dict[str, object]:
    """The notebook of a page, as JSON has it (nbformat 4.5)."""
    cells, end = [], 0
    for block in FENCE.finditer(page):
        cells.append(("markdown", page[end : block.start()]))
        if block[1] == "python":
            cells.append(("code", _shown(block[2])))
        elif block[1] == "console":
            typed = re.findall(r"^\$ (.*\n)", block[2], re.MULTILINE)
            cells.append(("code", "".join(f"!{line}" for line in typed)))
        elif block[1] != "text":  # what code prints comes out again
            cells.append(("markdown", block[0]))
        end = block.end()
    cells.append(("markdown", page[end:]))
    kept = [(kind, _without_pictures(text).strip("\n")) for kind, text in cells]
    return {
        "cells": [_cell(i, kind, text) for i, (kind, text) in enumerate(kept) if text.strip()],
        "metadata": {
            "kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"},
            "language_info": {"name": "python"},
        },
        "nbformat": 4,
        "nbformat_minor": 5,
    }


def _shown(code: str) -> str:
    """Code whose figures are shown where the page saves them."""
    return re.sub(r"^(\w+)\.savefig\(.*\)$", r"\1", code.rstrip("\n"), flags=re.MULTILINE)


def _without_pictures(text: str) -> str:
    """The text without pictures that the code makes, and with links that lead to the site's pages by name only."""
    return re.sub(r"\[([^]]*)\]\((?!http)[^)]*\)", r"\1", re.sub(r"!\[[^]]*\]\(made/[^)]*\)\n?", "", text))


def _cell(index: int, kind: str, text: str) -> dict[str, object]:
    lines = text.splitlines(keepends=True)
    plain = {"cell_type": kind, "id": f"cell-{index}", "metadata": {}, "source": lines}
    return plain | ({"execution_count": None, "outputs": []} if kind == "code" else {})


def write(page: Path, path: Path) -> None:
    """Write the notebook of a page."""
    text = json.dumps(notebook(page.read_text(encoding="utf-8")), indent=1, ensure_ascii=False)
    path.write_text(text + "\n", encoding="utf-8")


if __name__ == "__main__":
    write(Path(sys.argv[1]), Path(sys.argv[2]))
