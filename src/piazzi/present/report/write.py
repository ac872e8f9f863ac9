"""A page as a file."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

from piazzi.evaluate import Comparison
from piazzi.io.atomic import atomic_path
from piazzi.present.report.blocks import Tab
from piazzi.present.report.comparison import comparison_tab
from piazzi.present.report.page import page

NAME = "report.html"


def write_page(path: str | os.PathLike[str], title: str, tabs: Sequence[Tab], *, foot: str = "") -> Path:
    """Write the page of these tabs, whole or not at all; returns its path, which for a folder is report.html in it.

    Raises
    ------
    OSError
        Where it cannot be written.
    """
    target = page_path(path)
    with atomic_path(target) as work:
        work.write_text(page(title, tabs, foot=foot), encoding="utf-8", newline="\n")
    return target


def write_report(
    path: str | os.PathLike[str], *comparisons: Comparison, title: str = "Piazzi report", planet_radius: float | None = None
) -> Path:
    """Write a page of comparisons, a tab for each; returns its path, which for a folder is report.html in it.

    Parameters
    ----------
    path : a file that ends in .html, or a folder
    comparisons : Comparison
    title : of the page
    planet_radius : m, drawn to scale about the origin

    Raises
    ------
    ValueError
        For no comparison.
    OSError
        Where it cannot be written.
    """
    if not comparisons:
        raise ValueError("there is no comparison to report")
    return write_page(path, title, [comparison_tab(c, planet_radius=planet_radius) for c in comparisons])


def page_path(path: str | os.PathLike[str]) -> Path:
    """The file that a name stands for: itself where it ends in .html, else report.html in that folder."""
    target = Path(path)
    return target if target.suffix.lower() in (".html", ".htm") and not target.is_dir() else target / NAME
