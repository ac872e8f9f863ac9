"""Tabs of blocks -> one HTML page that carries all it needs: no network, no other file."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Sequence
from hashlib import sha256
from importlib.resources import files
from typing import Any

from piazzi.present.report import html
from piazzi.present.report.blocks import (
    Block,
    Chart,
    Code,
    CursorValues,
    Heat,
    Line,
    Orbit,
    Section,
    Sky,
    Tab,
    Table,
    Text,
    Track,
    World,
)
from piazzi.present.report.html import Pool, line_mark, script_json, text
from piazzi.present.report.places import axis_data, calendar_data, display_data, heat_data, noted, sky_data, world_data
from piazzi.text import printable

SCRIPTS = (
    "data.js",
    "calendar.js",
    "scales.js",
    "chart.js",
    "orbit.js",
    "world.js",
    "globe.js",
    "map.js",
    "sky.js",
    "heat.js",
    "save.js",
    "tab.js",
    "page.js",
)


def page(title: str, tabs: Sequence[Tab], *, foot: str = "") -> str:
    """The whole page.  All text is escaped; a policy in the page itself forbids scripts but its own, and all requests.

    Parameters
    ----------
    title : of the page
    tabs : Tab
    foot : a line at the end
    """
    pool = Pool()
    bodies, data = [], []
    for number, tab in enumerate(tabs):
        builder = _Builder(pool, f"t{number}")
        bodies.append(builder.tab(tab))
        data.append(builder.data(tab))
    script = "\n".join(_asset(name) for name in SCRIPTS)
    digest = b64encode(sha256(f"\n{script}\n".encode()).digest()).decode("ascii")
    policy = f"default-src 'none'; style-src 'unsafe-inline'; img-src data:; script-src 'sha256-{digest}'"
    chooser = html.tab_chooser(tabs) if len(tabs) > 1 else ""
    return f"""<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta http-equiv="Content-Security-Policy" content="{policy}">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="generator" content="Piazzi">
<link rel="icon" href="data:,">
<title>{text(title)}</title>
<style>
{_asset("page.css")}
</style>
</head>
<body>
<header class="top"><div class="wide"><h1>{text(title)}</h1>
<button type="button" id="theme" class="quiet" aria-pressed="false">Dark</button></div>{chooser}</header>
<main class="wide">
<noscript><p class="remark">The charts need JavaScript; the summaries and tables do not.</p></noscript>
{"".join(bodies)}
</main>
<footer class="wide">{text(foot)}</footer>
<div id="tip" aria-hidden="true"></div>
<script type="application/json" id="data">{script_json({"pool": pool.entries, "tabs": data})}</script>
<script>
{script}
</script>
</body>
</html>
"""


def _asset(name: str) -> str:
    """The text of a file of the page; the bytes on which the digest is taken are those of the page, so lines end in LF."""
    return files(__package__).joinpath("assets", name).read_text(encoding="utf-8").replace("\r\n", "\n").strip()


_AGAIN = '<button type="button" class="quiet unzoom" hidden>Whole run</button>'


class _Builder:
    """The HTML of one tab, and meanwhile the data that its charts draw."""

    def __init__(self, pool: Pool, name: str) -> None:
        self.pool, self.name = pool, name
        self.drawings: list[dict[str, Any]] = []

    def tab(self, tab: Tab) -> str:
        sections = "".join(self._section(s) for s in tab.sections)
        points = "".join(map(html.summary_point, tab.points))
        return f"""<article class="tab" id="{self.name}" aria-label="{text(tab.title)}">
<h2>{text(tab.title)}</h2><p class="subtitle">{text(tab.subtitle)}</p>
<dl class="summary">{points}</dl>
{self._bar(tab)}
{sections}
</article>
"""

    def data(self, tab: Tab) -> dict[str, Any]:
        return {
            "id": self.name,
            "keys": [{"label": printable(k.label), "colour": k.colour, "dash": list(k.dash)} for k in tab.keys],
            "times": None if tab.times is None else self.pool.add_exactly(tab.times),
            "show": display_data(tab.show_time),
            "calendar": calendar_data(tab),
            "drawings": self.drawings,
            "at": [[printable(name), printable(value)] for name, value in tab.at],
        }

    def _bar(self, tab: Tab) -> str:
        """What moves and switches everything on the tab, always in sight."""
        if not tab.keys and tab.times is None:
            return ""
        play = slider = ""
        if tab.times is not None and len(tab.times) > 1:
            play = '<button type="button" class="play" aria-pressed="false">Play</button>'
            slider = (
                f'<input type="range" class="time" min="0" max="{len(tab.times) - 1}" step="1" value="{len(tab.times) - 1}"'
                ' aria-label="Time"><output class="clock"></output>'
            )
        if not tab.switch:
            return f'<div class="bar" role="group" aria-label="Time"><div class="move">{play}{slider}{_AGAIN}</div></div>'
        chips = "".join(
            f'<button type="button" class="chip" data-key="{i}" aria-pressed="true">{line_mark(key)}{text(key.label)}</button>'
            for i, key in enumerate(tab.keys)
        )
        everyone = '<button type="button" class="quiet everyone">Hide all</button>' if len(tab.keys) > 2 else ""
        options = "".join(f'<option value="{i}">{text(key.label)}</option>' for i, key in enumerate(tab.keys))
        blocks = [block for section in tab.sections for block in section.blocks]
        close = any(isinstance(b, Orbit) or (isinstance(b, Chart) and b.single) for b in blocks)
        focus = f'<label class="focus">Look closely at <select>{options}</select></label>' if tab.keys and close else ""
        return (
            f'<div class="bar" role="group" aria-label="Time and estimators">'
            f'<div class="move">{play}{slider}{_AGAIN}{focus}</div>'
            f'<div class="chips" role="group" aria-label="Estimators shown">{chips}{everyone}</div></div>'
        )

    def _section(self, section: Section) -> str:
        intro = f'<p class="intro">{text(section.intro)}</p>' if section.intro else ""
        blocks = "".join(self._block(b) for b in section.blocks)
        if len(section.blocks) == 1 and isinstance(section.blocks[0], Chart):
            blocks = blocks.replace('class="panel"', 'class="panel full"', 1)
        small = " small" if section.blocks and all(isinstance(b, Sky) for b in section.blocks) else ""
        inside = f'{intro}<div class="grid{small}">{blocks}</div>'
        if section.folded:
            return f"<section><details><summary><h3>{text(section.title)}</h3></summary>{inside}</details></section>\n"
        return f"<section><h3>{text(section.title)}</h3>{inside}</section>\n"

    def _block(self, block: Block) -> str:
        match block:
            case Chart():
                return self._drawing(block.title, block.note, self._chart(block), html.legend(block.lines))
            case Orbit():
                return self._drawing(block.title, block.note, self._orbit(block))
            case Heat():
                return self._drawing(block.title, block.note, heat_data(block))
            case Table():
                return html.table_panel(block)
            case CursorValues():
                return (
                    f'<div class="panel full"><h4>{text(block.title)}</h4><div class="scroll" tabindex="0" role="region"'
                    f' aria-label="{text(block.title)}"><table class="now"></table></div></div>'
                )
            case World():
                return self._drawing(block.title, block.note, world_data(block, self.pool))
            case Sky():
                return self._drawing(block.title, block.note, sky_data(block, self.pool))
            case Code():
                return f'<div class="panel full"><pre tabindex="0">{html.lines(block.text)}</pre></div>'
            case Text():
                return '<div class="panel full">' + "".join(f"<p>{text(p)}</p>" for p in block.paragraphs) + "</div>"

    def _drawing(self, title: str, note: str, drawing: dict[str, Any], legend: str = "") -> str:
        self.drawings.append(drawing | {"title": printable(title)})
        remark = f'<p class="remark">{text(note)}</p>' if note else ""
        return (
            f'<figure class="panel"><figcaption><h4>{text(title)}</h4>{legend}</figcaption>'
            f'<div class="plot" data-drawing="{len(self.drawings) - 1}"></div>{remark}{html.save_buttons(title)}</figure>'
        )

    def _chart(self, chart: Chart) -> dict[str, Any]:
        return {
            "kind": "chart",
            "time": chart.time,
            "single": chart.single,
            "x": axis_data(chart.x),
            "y": axis_data(chart.y),
            "lines": [self._line(line) for line in chart.lines],
            "levels": [[value, printable(label)] for value, label in chart.levels],
            "ranges": [[low, high, printable(label)] for low, high, label in chart.ranges],
            "column": printable(chart.column),
            "shades": [] if chart.shades is None else chart.shades.tolist(),
        }

    def _line(self, line: Line) -> dict[str, Any]:
        y = self.pool.add_length(line.y) if isinstance(line.y, tuple) else self.pool.add(line.y)
        return {
            "key": line.key,
            "kind": line.kind,
            "x": self.pool.add_exactly(line.x),
            "y": y,
            "times": line.times,
            "label": printable(line.label),
            "colour": line.colour,
            "dash": list(line.dash),
            "notes": noted(line.notes),
            "about": None if line.about is None else self.pool.add(line.about),
        }

    def _orbit(self, orbit: Orbit) -> dict[str, Any]:
        return {
            "kind": "orbit",
            "close": orbit.close,
            "labels": [printable(label) for label in orbit.labels],
            "show": display_data(orbit.show),
            "limits": list(orbit.limits),
            "planet": orbit.planet_radius,
            "mirrored": orbit.mirrored,
            "rings": [[self.pool.add(x), self.pool.add(y)] for x, y in orbit.rings],
            "tracks": [self._track(track) for track in orbit.tracks],
            "sites": [
                {"label": printable(label), "colour": colour, "x": self.pool.add(x), "y": self.pool.add(y)}
                for label, colour, x, y in orbit.sites
            ],
        }

    def _track(self, track: Track) -> dict[str, Any]:
        found = {"x": track.x, "y": track.y, "sx": track.sigma_x, "sy": track.sigma_y, "rho": track.correlation}
        arrays = {name: None if values is None else self.pool.add(values) for name, values in found.items()}
        return {"key": track.key, "label": printable(track.label), **arrays}
