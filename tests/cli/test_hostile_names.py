"""Names that are markup, escapes of terminals or formulas of spreadsheets: pages, terminals and tables stay as they are."""

import csv
import json
import re
from html.parser import HTMLParser

import pytest

PAYLOADS = [
    *(
        "<script>alert(1)</script>",
        "</script><script>alert(1)</script>",
        '"><img src=x onerror=alert(1)>',
        "' onmouseover='alert(1)",
    ),
    *(
        "<!--",
        "]]>",
        "</title><svg onload=alert(1)>",
        "&lt;b&gt;",
        "javascript:alert(1)",
        "%3Cscript%3E",
        "{{7*7}}",
        "[bold red]x[/]",
    ),
    *(
        "\u2028alert(1)",
        "\x1b[31mred\x1b[0m",
        "\x1b]0;t\x07",
        "\x9b31m",
        "\u202eevil",
        "a\nb",
        "a\tb",
        "x\x00y",
        "$\\frac{a}{$",
    ),
    *("=1+1", "@SUM(A1)", "+cmd|' /C calc'!A0", "-2+3"),
]
GOOD = {"title": "t", "station": "s", "group": "g", "component": "range", "unit": "m"}
# Escapes, directions and line ends that are none of a text's own
HIDDEN = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u202a-\u202e\u2028\u2029]")
COMMANDS = {
    "page": ("report", "s.toml", "--with", "ekf", "-o", "page.html"),
    "estimate": ("estimate", "s.toml"),
    "estimate.csv": ("estimate", "s.toml", "-o", "estimate.csv"),
    "compare": ("compare", "s.toml", "--with", "ekf", "-o", "compare.csv"),
    "simulate": ("simulate", "s.toml", "-o", "simulate.csv"),
    "stdout": ("simulate", "s.toml", "-o", "-"),
    "observability": ("observability", "s.toml", "--no-twins", "-o", "seen.csv"),
    "check": ("scenarios", "check", "s.toml"),
}


def scenario(**names: str) -> str:
    """A problem on a line with these names in it."""
    q = {place: json.dumps(name) for place, name in (GOOD | names).items()}
    return f"""
title = {q["title"]}
states = {{ x = "m", v = "m/s" }}
dynamics = {{ x = "v", v = "0" }}
groups = {{ {q["group"]} = ["x"] }}
sensors.radar.components = {{ {q["component"]} = {{ equation = "x", unit = {q["unit"]} }} }}
stations = [{{ name = {q["station"]}, sensor = "radar", noise = {{ sigma = 1 }} }}]
prior = {{ mean = [1, 0], sigma = [1, 1] }}
process_noise = {{ variance = [1e-4, 1e-4] }}
truth = {{ state = [1.1, 0.1] }}
times = {{ step = 1, count = 5 }}
"""


class Shape(HTMLParser):
    """Tags of a page, in order, and attributes that run something."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.handlers: list[str] = []
        self.feed(page)

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        self.handlers += [name for name, _ in attrs if name.startswith("on")]


@pytest.fixture
def place(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PIAZZI_JIT", "0")
    return tmp_path


def check_console(result):
    """Of what a command says, every character can be seen, and an error is one line."""
    assert result.status in (0, 2), result.err
    assert not HIDDEN.search(result.out)
    assert not HIDDEN.search(result.err)
    assert all(line.startswith("piazzi: ") for line in result.err.splitlines())


def check_page(page, right):
    """The page has the structure of one with good names."""
    shape = Shape(page)
    assert shape.tags == right.tags
    assert shape.handlers == []
    assert not HIDDEN.search(page)


def check_table(text):
    """No cell is taken for a formula, and every row is as wide as the first."""
    assert not HIDDEN.search(text.replace("\r\n", "\n"))
    rows = list(csv.reader(line for line in text.splitlines() if not line.startswith("#")))
    assert {len(row) for row in rows} == {len(rows[0])}
    cells = [cell for row in rows for cell in row if cell]
    assert not [cell for cell in cells if cell[0] in "=@+\t\r" or (cell[0] == "-" and not re.fullmatch(r"-[\d.e+-]+", cell))]


@pytest.fixture(scope="module")
def right(tmp_path_factory):
    """The page of good names."""
    from piazzi.cli.main import main

    folder = tmp_path_factory.mktemp("right")
    (folder / "s.toml").write_text(scenario())
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PIAZZI_JIT", "0")
        assert main(["report", f"{folder}/s.toml", "--with", "ekf", "-o", f"{folder}/page.html"]) == 0
    return Shape((folder / "page.html").read_text(encoding="utf-8"))


@pytest.mark.parametrize("payload", PAYLOADS)
@pytest.mark.parametrize("where", ["title", "station", "group", "component", "unit"])
def test_hostile_names(call, place, right, where, payload):
    (place / "s.toml").write_text(scenario(**{where: payload}), encoding="utf-8")
    first = call(*COMMANDS["page"])
    check_console(first)
    if first.status:  # refused, and so it is by the others
        return
    check_page((place / "page.html").read_text(encoding="utf-8"), right)
    for name, command in COMMANDS.items():
        result = first if name == "page" else call(*command)
        check_console(result)
        if name == "stdout" and not result.status:
            check_table(result.out)
    for table in sorted(place.glob("*.csv")):
        check_table(table.read_text(encoding="utf-8"))
