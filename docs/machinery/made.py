"""What the site shows and nobody writes: answers of the command line, pictures that pages' code makes, pages as notebooks."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import click
import notebooks
from sphinx.application import Sphinx
from sphinx.util import logging

LOGGER = logging.getLogger(__name__)
MARK = "<!-- every command -->"
BLOCKS = Path(__file__).with_name("blocks.py")
RUN = "import sys, pathlib; sys.path.insert(0, sys.argv[1]); import blocks; blocks.run(*map(pathlib.Path, sys.argv[2:]))"


def commands(group: click.Group, before: tuple[str, ...] = ()) -> Iterator[tuple[str, ...]]:
    """The words of every command, those of groups first."""
    context = click.Context(group)
    for name in group.list_commands(context):
        words, command = (*before, name), group.get_command(context, name)
        yield words
        if isinstance(command, click.Group):
            yield from commands(command, words)


def help_pages() -> str:
    """A section for the program and for each command, with what its `--help` says."""
    from piazzi.cli.commands import piazzi

    sections = []
    for words in [(), *commands(piazzi)]:
        line = [str(Path(sys.executable).with_name("piazzi")), *words, "--help"]
        text = subprocess.run(line, capture_output=True, text=True, check=True, timeout=60).stdout
        title = " ".join(["piazzi", *words])
        sections.append(f"## {title}\n\n```text\n{text.rstrip()}\n```\n")
    return "\n".join(sections)


def fill(app: Sphinx, name: str, text: list[str]) -> None:
    """Put the help pages where a page asks for them."""
    if MARK in text[0]:
        text[0] = text[0].replace(MARK, help_pages())


def pictures(app: Sphinx) -> None:
    """Run every page that shows a picture from a folder `made`, which is where its code saves it; as many at once as cores."""
    pages = [p for p in sorted(Path(app.srcdir).rglob("*.md")) if "](made/" in p.read_text(encoding="utf-8")]
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        for page, told in zip(pages, pool.map(_pictures, pages), strict=True):
            if told is not None:
                LOGGER.warning("the code of %s fails:\n%s", page, told)


def _pictures(page: Path) -> str | None:
    """Run a page, in a process of its own; returns what it says where it fails."""
    folder = page.parent / "made"
    folder.mkdir(exist_ok=True)
    if page.parent.name == "gallery":
        notebooks.write(page, folder / f"{page.stem}.ipynb")
    command = [sys.executable, "-W", "error", "-c", RUN, str(BLOCKS.parent), str(page), str(folder)]
    done = subprocess.run(command, stderr=subprocess.PIPE, text=True, timeout=600)
    return done.stderr if done.returncode else None


def setup(app: Sphinx) -> dict[str, bool]:
    app.connect("builder-inited", pictures)
    app.connect("source-read", fill)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
