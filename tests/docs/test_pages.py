"""The documentation's code runs and prints what the pages say; what its sentences say is in there."""

import ast
import re
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import piazzi as pz

DOCS = Path(__file__).resolve().parents[2] / "docs"
sys.path.insert(0, str(DOCS / "machinery"))
try:
    import blocks
    import links
    import notebooks
finally:
    sys.path.pop(0)

PAGES = sorted(p for p in DOCS.rglob("*.md") if any(b.language in ("python", "console") for b in blocks.blocks(p.read_text())))


SLOW = {"sensors", "ceres", "determine", "orbits", "own-problem", "bearing-only"}  # kernels of more than five seconds
SLOW |= {p.stem for p in (DOCS / "gallery").glob("*.md")}


def _named(page):
    """CI leaves ``gallery/`` out here: it runs these pages when it makes the documentation, and again as notebooks."""
    return pytest.param(page, id=f"{page.parent.name}/{page.stem}", marks=[pytest.mark.slow] * (page.stem in SLOW))


@pytest.mark.parametrize("page", [_named(p) for p in PAGES])
def test_the_code_of_a_page_runs_and_gives_what_the_page_says(page, tmp_path):
    blocks.run(page, tmp_path)


@pytest.mark.parametrize("page", [pytest.param(p, id=p.stem) for p in PAGES if p.stem != "founding-texts"])
def test_numbers_of_the_prose_are_in_the_code_or_its_results(page):
    assert blocks.unfounded(page.read_text()) == []


def test_every_page_of_the_gallery_has_its_picture_its_notebook_and_a_place_in_the_index():
    index = (DOCS / "index.md").read_text()
    for page in (DOCS / "gallery").glob("*.md"):
        text = page.read_text()
        assert re.search(r"!\[[^]]{20,}\]\(made/[\w-]+\.svg\)", text), f"{page.stem} has no picture that is said in words"
        assert f"(made/{page.stem}.ipynb)" in text
        assert f"(gallery/{page.stem}.md)" in index and f"\ngallery/{page.stem}\n" in index


def test_every_page_says_first_what_it_is_for():
    for page in [
        *DOCS.glob("*.md"),
        *(p for folder in ("gallery", "how-to", "tutorials") for p in (DOCS / folder).glob("*.md")),
    ]:
        title, first = page.read_text(encoding="utf-8").split("\n\n")[:2]
        assert title.startswith("# ") and not first.startswith(("```", "|", "- ")) and len(first.split()) >= 15, page.name


def test_what_contributors_follow_is_run():
    table = re.findall(r"^\| an? .*\]\(([^)]+\.md)\)", (DOCS.parent / "CONTRIBUTING.md").read_text(), re.MULTILINE)
    assert len(table) == 6 and {DOCS.parent / page for page in table} <= set(PAGES)


def test_the_tutorials_and_guides_are_among_them():
    assert {"bearing-only", "range-only", "own-problem", "founding-texts"} <= {p.stem for p in PAGES}


def test_a_page_as_a_notebook(tmp_path):
    page = "# Title\n\nSee [that](../maths.md).\n\n```python\nfigure.savefig('a.svg')\n```\n"
    page += "\n```text\n1\n```\n\n![Alt](made/a.svg)\n\nEnd\n"
    page += "\n```console\n$ piazzi data\nlines\n```\n"
    found = notebooks.notebook(page)
    cells = [(c["cell_type"], "".join(c["source"])) for c in found["cells"]]
    assert cells == [("markdown", "# Title\n\nSee that."), ("code", "figure"), ("markdown", "End"), ("code", "!piazzi data")]
    assert (found["nbformat"], found["nbformat_minor"]) == (4, 5)


def test_a_wrong_result_is_noticed(tmp_path):
    page = tmp_path / "page.md"
    page.write_text("```python\nprint(1 + 1)\n```\n\n```text\n3\n```\n")
    with pytest.raises(AssertionError, match=r"page.md:1 should say\n3\n\nbut gives\n2"):
        blocks.run(page, tmp_path)


@pytest.mark.parametrize(
    ("said", "got", "same"),
    [("a\n...\nd\n", "a\nb\nc\nd\n", True), ("a\n...\n", "a\n", True), ("a\n", "a\nb\n", False), ("1.0\n", "1x0\n", False)],
)
def test_three_dots_stand_for_any_lines_and_nothing_else_does(said, got, same):
    assert blocks.matches(said, got) == same


def test_a_number_out_of_nowhere_is_noticed():
    page = "It is 2.50 km, `9.99`, not 3.75.\n\n```text\n2.50\n```\n"
    assert blocks.unfounded(page) == ["3.75"]


def test_the_reference_has_every_public_name():
    named = re.findall(r"^\.\. auto\w+:: piazzi\.(\w+)$", (DOCS / "reference.md").read_text(), re.MULTILINE)
    assert sorted(named) == sorted(pz.__all__)


def test_the_founding_comparison_is_told_with_its_numbers(data_dir):
    problem, tracking = pz.load(data_dir / "satellite" / "slide_example.npz")
    half = len(tracking.times) // 2

    def errors(estimator, problem):
        return np.linalg.norm((estimator.estimate(problem, tracking).mean - tracking.truth)[:, :2], axis=1) / 1e3

    def rms(x):
        return np.sqrt((x**2).mean())

    fine = errors(pz.ExtendedKalmanFilter(), problem)
    coarse = errors(pz.ExtendedKalmanFilter(), replace(problem, integrator=pz.Taylor(substeps=1)))
    page = " ".join((DOCS / "founding-texts.md").read_text().split())
    assert f"half is {rms(coarse[half:]):.0f} km with one step and {rms(fine[half:]):.1f} km with 15" in page
    assert f"{rms(errors(pz.FactorGraph(), problem)):.1f} km against {rms(fine):.0f} km" in page


def test_what_the_founding_page_names_is_there():
    page = (DOCS / "founding-texts.md").read_text()
    for call in re.findall(r"`pz\.(\w+)", page):
        assert hasattr(pz, call), call
    for script in re.findall(r"examples/\w+\.py", page):
        ast.parse((DOCS.parent / script).read_text())


def test_dead_links_and_requests_are_noticed(tmp_path):
    (tmp_path / "a.html").write_text(
        '<a href="b.html#there">b</a><a href="b.html#not">b</a><a href="c.html">c</a><a href="#me" id="me">'
    )
    (tmp_path / "b.html").write_text(
        '<h1 id="there"></h1><script src="https://example.org/x.js"></script><a href="https://example.org">'
    )
    (tmp_path / "s.css").write_text("body { background: url(//example.org/x.png) }")
    assert links.faults(tmp_path) == [
        "a.html: b.html#not has no such place",
        "a.html: c.html leads nowhere",
        "b.html: fetches https://example.org/x.js",
        "s.css: fetches from elsewhere",
    ]
