"""What is asked of every page, whatever it is of: names, contrast, keys, and charts that can be kept as files."""

import csv
from dataclasses import replace
from datetime import datetime
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

import piazzi as pz
from piazzi.present.report import comparison_tab, observability_tab, study_tabs, windows_tab, write_page
from tests.present.looks import check_looks

KINDS = ("comparison", "windows", "observability", "study")


@pytest.fixture(scope="module")
def pages(tmp_path_factory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("pages")
    problem, tracking = pz.load("satellite-bearing")
    problem = replace(problem, epoch="2026-11-03T10:00:00 UTC")
    dated = pz.simulate(problem, tracking.times[:40], np.random.default_rng(0))
    study = pz.Study(problem, dated.times, ["ekf", "smoother"], runs=4).run(folder / "s.nc", workers=0)
    tabs = {
        "comparison": [comparison_tab(pz.compare(problem, dated, ["ekf", "graph"]), planet_radius=6.378e6)],
        "windows": [windows_tab(pz.windows(problem, dated, [1, 5]))],
        "observability": [observability_tab(pz.observability(problem, dated, twins=False))],
        "study": study_tabs(study.summary, "Study"),
    }
    return {kind: write_page(folder / f"{kind}.html", kind, found) for kind, found in tabs.items()}


@pytest.mark.parametrize("width", [390, 1280])
@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("kind", KINDS)
def test_names_contrast_and_keys(open_page, pages, kind, scheme, width):
    check_looks(open_page(pages[kind], width=width, scheme=scheme))


LONG = ("comparison", "study")


@pytest.mark.parametrize("kind", [pytest.param(kind, marks=[pytest.mark.slow] * (kind in LONG)) for kind in KINDS])
def test_every_chart_is_kept_as_a_picture_and_as_numbers(open_page, pages, kind):
    page = open_page(pages[kind])
    page.evaluate("() => document.querySelectorAll('details').forEach((d) => (d.open = true))")
    figures = page.locator("figure:visible").all()
    assert len(figures) >= 2
    for figure in figures:
        kept = {}
        for what in ("svg", "png", "csv"):
            with page.expect_download() as download:
                figure.locator(f"button[data-as={what}]").click()
            assert download.value.suggested_filename.endswith(f".{what}")
            kept[what] = Path(download.value.path()).read_bytes()
        assert ElementTree.fromstring(kept["svg"]).tag == "{http://www.w3.org/2000/svg}svg"
        assert kept["png"].startswith(b"\x89PNG") and len(kept["png"]) > 2000
        head, *rows = csv.reader(kept["csv"].decode().splitlines())
        assert rows and all(len(row) == len(head) for row in rows), figure.locator("h4").inner_text()
        if "time [UTC]" in head:
            clock, seconds = head.index("time [UTC]"), head.index("time [s]")
            past = [datetime.fromisoformat(row[clock]) - datetime(2026, 11, 3, 10) for row in rows]
            assert [p.total_seconds() for p in past] == pytest.approx([float(row[seconds]) for row in rows], abs=1e-3)
    assert (kind == "windows") != any("time [UTC]" in text for text in page.locator("svg text.label").all_text_contents())
