"""``piazzi report`` and ``--report``: the page appears, and bad places are refused before anything is computed."""

import json

import pytest


def test_compare_writes_a_report_beside_its_json(call, tmp_path):
    found = call("compare", "b612-range", "--with", "ekf", "--json", "--report", tmp_path / "folder")
    assert found.status == 0
    assert found.document["schema"] == "piazzi.compare/1"
    text = (tmp_path / "folder" / "report.html").read_text()
    assert "Probe around B612" in text and "ekf" in text


def test_report_puts_several_problems_on_one_page(call, tmp_path):
    path = tmp_path / "page.html"
    found = call("report", "b612-range", "b612-range-q0", "--with", "ekf", "--with", "window:20", "-o", path)
    assert found.status == 0
    assert found.out == f"Wrote {path}: open it in a browser.\n"
    text = path.read_text()
    data = json.loads(text.split('id="data">')[1].split("</script>")[0])
    assert len(data["tabs"]) == 2
    assert [key["label"] for key in data["tabs"][0]["keys"]] == ["ekf", "window:20, real time", "window:20, delayed"]
    (orbit, _) = [d for d in data["tabs"][0]["drawings"] if d["kind"] == "orbit"]
    assert orbit["planet"] == 10.0


def test_a_recording_of_the_founding_layout_has_its_planet(call, tmp_path):
    recording = tmp_path / "mine.npz"
    assert call("simulate", "satellite-bearing", "-o", recording).status == 0
    assert call("report", recording, "--with", "ekf", "-o", tmp_path / "page.html").status == 0
    assert '"planet":63' in (tmp_path / "page.html").read_text()


def test_windows_and_observability_write_reports_and_join_one(call, tmp_path):
    assert call("windows", "b612-range", "--lags", "1,5", "--no-graph", "--report", tmp_path / "w").status == 0
    assert "Window length" in (tmp_path / "w" / "report.html").read_text()
    assert call("observability", "b612-range-q0", "--no-twins", "--report", tmp_path / "o.html").status == 0
    assert "<h3>Observability" in (tmp_path / "o.html").read_text()
    joined = call("report", "b612-range", "--with", "ekf", "--windows", "1,5", "--observability", "-o", tmp_path / "all.html")
    assert joined.status == 0
    text = (tmp_path / "all.html").read_text()
    assert "Window length" in text and "<h3>Observability" in text
    assert "whole numbers" in call("report", "b612-range", "--windows", "few", "-o", tmp_path / "x.html").refused()


def test_a_warning_of_long_steps_is_on_the_page(call, data_dir, tmp_path):
    page = tmp_path / "page.html"
    found = call("report", data_dir / "satellite" / "slide_example.npz", "--with", "ekf", "-o", page)
    assert "steps are too long" in found.err
    assert "Warning" in page.read_text() and "steps are too long" in page.read_text()


def test_bad_places_and_sources_are_refused(call, tmp_path):
    assert "must end in .html" in call("report", "b612-range", "-o", tmp_path / "page.pdf").refused()
    assert "goes into a file" in call("report", "b612-range", "-o", "-").refused()
    assert "name a folder" in call("compare", "b612-range", "--report", "-").refused()
    (tmp_path / "file").write_text("")
    assert "file" in call("compare", "b612-range", "--report", tmp_path / "file" / "below").refused()
    assert "b612" in call("report", "b612-rnge", "-o", tmp_path / "page.html").refused()
    assert "missing argument" in call("report").refused().lower()
    assert sorted(p.name for p in tmp_path.iterdir()) == ["file"]


def test_a_page_says_how_it_was_made(call, tmp_path):
    own = tmp_path / "own.toml"
    own.write_text(call("scenarios", "show", "b612-range").out + "\n# <b>mine</b> & nobody else's\n")
    path = tmp_path / "page.html"
    found = call("report", own, "b612-range-q0", "--with", "ekf", "--seed", "4", "--title", "A <title>", "-o", path)
    assert found.status == 0
    text = path.read_text()
    assert "<title>A &lt;title&gt;</title>" in text and "<h1>A &lt;title&gt;</h1>" in text
    assert "Seed 4." in text and "# &lt;b&gt;mine&lt;/b&gt; &amp; nobody else&#x27;s" in text
    assert text.count("<h3>How it was made</h3>") == 2
    assert text.count("<pre") == 4  # the command and the scenario, twice


@pytest.mark.parametrize(
    "arguments",
    [
        ["compare", "b612-range", "--with", "ekf"],
        ["windows", "b612-range", "--lags", "5,10", "--no-graph"],
        ["observability", "b612-range", "--no-twins"],
    ],
    ids=lambda arguments: arguments[0],
)
def test_a_page_has_the_title_that_it_is_given(call, tmp_path, arguments):
    path = tmp_path / "page.html"
    found = call(*arguments, "--title", "Mine & <yours>", "--report", path)
    assert found.status == 0, found.err
    text = path.read_text()
    assert "<title>Mine &amp; &lt;yours&gt;</title>" in text
    assert "<h2>Mine &amp; &lt;yours&gt;</h2>" in text
