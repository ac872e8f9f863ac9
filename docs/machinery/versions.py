"""The site of every version side by side: VERSION/ for each, and a first page that lists them.

    python docs/machinery/versions.py build/docs build/site

The version is what the site says of itself.  One that is there already is replaced; the others stay as they are, but for the
list, which every page links to.  Nothing is asked of a network.
"""

from __future__ import annotations

import re
import shutil
import sys
from html import escape
from pathlib import Path

SAID = re.compile(r'<meta content="([\w.+-]+)" name="version"')
PLACE = '<div class="sidebar-tree">'
PAGE = """<!doctype html>
<html lang="en-GB"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">
<title>Piazzi: versions of the documentation</title>
<style>body{{font:1.1rem system-ui;max-width:40rem;margin:3rem auto;padding:0 1rem;color-scheme:light dark}}</style></head>
<body><h1>Piazzi</h1><p>The documentation of every version, the newest first.</p><ul>
{rows}
</ul></body></html>
"""


def version_of(site: Path) -> str:
    """The version that a built site says it is of; raises ValueError where it says none."""
    found = SAID.search((site / "index.html").read_text(encoding="utf-8"))
    if found is None:
        raise ValueError(f"{site} does not say which version it is of")
    return found[1]


def order(version: str) -> tuple[tuple[int, ...], bool, str]:
    """Where a version stands: numbers as numbers, what comes before a release below it."""
    numbers, rest = re.match(r"(\d+(?:\.\d+)*)?(.*)", version).groups()
    return tuple(map(int, (numbers or "0").split("."))), not rest, rest


def add(built: Path, site: Path) -> str:
    """Put a built site into that of all versions; returns its version."""
    version = version_of(built)
    target = site / version
    shutil.rmtree(target, ignore_errors=True)
    shutil.copytree(built, target)
    for page in target.rglob("*.html"):
        up = "../" * len(page.relative_to(target).parts)
        text = page.read_text(encoding="utf-8")
        link = f'{PLACE}<p class="caption">Version {escape(version)}, <a href="{up}index.html">all versions</a></p>'
        page.write_text(text.replace(PLACE, link, 1), encoding="utf-8")
    found = sorted((p.parent.name for p in site.glob("*/index.html")), key=order, reverse=True)
    rows = "\n".join(f'<li><a href="{escape(v)}/index.html">{escape(v)}</a></li>' for v in found)
    (site / "index.html").write_text(PAGE.format(rows=rows), encoding="utf-8")
    return version


if __name__ == "__main__":
    print(f"{sys.argv[2]}/{add(Path(sys.argv[1]), Path(sys.argv[2]))}")
