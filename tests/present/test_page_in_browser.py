"""The report in a browser: what a reader sees, points at, and types."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import piazzi as pz
from piazzi.estimate.registry import parse
from piazzi.evaluate import Comparison, compare
from piazzi.evaluate.observing import observability
from piazzi.evaluate.quantities import Display, number
from piazzi.evaluate.window_lengths import windows
from piazzi.present.colours import shade_of
from piazzi.present.report import comparison_tab, observability_tab, windows_tab, write_page
from piazzi.present.report.blocks import Key, Orbit, Section, Tab, Track
from piazzi.scenarios import load_scenario

HOSTILE = "</script><script>hacked=1</script><img src=x onerror=hacked=1>\u2028\u202e&lt;'\"<!--"


def made(source: str) -> Comparison:
    scenario = load_scenario(source)
    tracking = pz.simulate(scenario.problem, scenario.times, np.random.default_rng(0))
    estimators = {"ekf": pz.ExtendedKalmanFilter(), "graph": pz.FactorGraph(), "window:20": pz.SlidingWindow(lag=20)}
    return compare(scenario.problem, tracking, estimators, source=source)


@pytest.fixture(scope="module")
def comparison() -> Comparison:
    return made("b612-range")


@pytest.fixture(scope="module")
def report(comparison, tmp_path_factory) -> Path:
    """Two problems on one page."""
    folder = tmp_path_factory.mktemp("report")
    tabs = [
        comparison_tab(comparison, title="Probe", planet_radius=10.0),
        comparison_tab(made("satellite-bearing"), title="Satellite", planet_radius=6.378e6),
    ]
    return write_page(folder / "report.html", "Piazzi report", tabs)


def visible_lines(page, key: int) -> int:
    lines = f"#t0 svg .line[data-key='{key}']"
    return page.evaluate(f"() => [...document.querySelectorAll(`{lines}`)].filter(e => e.style.display !== 'none').length")


def test_values_at_the_cursor_are_those_of_the_estimates(open_page, report, comparison):
    page = open_page(report)
    slider = page.locator("#t0 input.time")
    for k in (99, 40):
        slider.fill(str(k))
        rows = page.locator("#t0 table.now tbody tr").all()
        for row, estimate in zip(rows, comparison.views.values(), strict=True):
            error = estimate.mean[k] - estimate.tracking.truth[k]
            shown = row.locator("td").first.inner_text()
            assert float(shown) == pytest.approx(np.hypot(error[0], error[1]), rel=6e-4), (k, shown)
    assert page.locator("#t0 .clock").inner_text() == f"{number(comparison.tracking.times[40])} s"


def test_the_slider_moves_every_cursor_and_the_orbit(open_page, report):
    page = open_page(report)
    places = "() => [...document.querySelectorAll('#t0 .cursor')].map(e => Number(e.getAttribute('x1')))"
    dots = "() => [...document.querySelectorAll('#t0 .dot')].map(e => e.getAttribute('cx') + ' ' + e.getAttribute('cy'))"
    before, dots_before = page.evaluate(places), page.evaluate(dots)
    slider = page.locator("#t0 input.time")
    slider.focus()
    page.keyboard.press("Home")
    after, dots_after = page.evaluate(places), page.evaluate(dots)
    assert len(before) >= 10
    assert all(a < b for a, b in zip(after, before, strict=True))
    assert sum(a != b for a, b in zip(dots_after, dots_before, strict=True)) >= len(dots_after) - 1  # one is the truth's own
    assert slider.get_attribute("aria-valuetext") == "0 s"


def test_it_plays_and_pauses(open_page, report):
    """By a clock that stands still but for the seconds given here, of the twenty that it plays."""
    page = open_page(report)
    page.clock.install(time=0)
    page.clock.pause_at(1000)
    button, place = page.locator("#t0 .play"), page.locator("#t0 input.time")
    button.click()
    assert button.inner_text() == "Pause"
    page.clock.run_for(5000)
    stopped = place.input_value()
    assert 20 <= int(stopped) <= 25  # of 99
    button.click()
    assert button.inner_text() == "Play"
    page.clock.run_for(5000)
    assert place.input_value() == stopped


def test_the_legend_switches_an_estimator_everywhere(open_page, report):
    page = open_page(report)
    chip = page.locator("#t0 .chip", has_text="graph")
    shown = visible_lines(page, 1)
    assert shown >= 5
    chip.focus()
    page.keyboard.press("Space")
    assert chip.get_attribute("aria-pressed") == "false"
    assert visible_lines(page, 1) == 0
    assert page.locator("#t0 table.now tr.off").count() == 1
    chip.click()
    assert visible_lines(page, 1) == shown
    page.locator("#t0 .chip", has_text="ekf").click()  # looked at closely: the next one takes its place
    assert page.locator("#t0 .focus select").input_value() == "1"


def test_pointing_shows_values_with_units_and_a_click_moves_the_cursor(open_page, report):
    page = open_page(report)
    plot = page.locator("#t0 .plot").nth(2)
    plot.scroll_into_view_if_needed()
    plot.hover(position={"x": 300, "y": 100})
    tip = page.locator("#tip")
    assert tip.is_visible()
    text = tip.inner_text()
    assert " s" in text and " m" in text and "window:20, delayed" in text
    plot.click(position={"x": 120, "y": 100})
    assert 0 < int(page.locator("#t0 input.time").input_value()) < 50


def test_dragging_shows_a_stretch_of_time_in_every_panel(open_page, report):
    page = open_page(report)
    plot = page.locator("#t0 .plot").nth(2)
    plot.scroll_into_view_if_needed()
    box = plot.bounding_box()
    page.mouse.move(box["x"] + 200, box["y"] + 100)
    page.mouse.down()
    page.mouse.move(box["x"] + 350, box["y"] + 100, steps=3)
    page.mouse.up()
    again = page.locator("#t0 .unzoom")
    assert again.is_visible()
    last = "() => [...document.querySelectorAll('#t0 .plot')[3].querySelectorAll('.grid-lines text')].at(-1).textContent"
    assert float(page.evaluate(last)) < 7
    again.click()
    assert float(page.evaluate(last)) > 7


def test_a_stretch_of_time_has_a_scale_of_its_own(open_page, report):
    """It holds all values of the stretch that the whole run's scale held, and no chart is seen less closely than before."""
    page = open_page(report)
    seen = """() => TABS[0].drawings.filter((d) => d.spec.time && d.sy).map((d) => ({
        limits: [d.sy.low, d.sy.high],
        values: d.lines.flatMap((l) => [...l.y].filter((v, i) => l.seconds[i] >= 5 && l.seconds[i] <= 6 && !Number.isNaN(v))),
        ticks: d.svg.querySelectorAll(".grid-lines text[text-anchor=end]").length, scale: d.spec.y.scale }))"""
    before = page.evaluate(seen)
    page.evaluate("() => TABS[0].zoomTo([5, 6])")
    after = page.evaluate(seen)
    narrower = 0
    for whole, part in zip(before, after, strict=True):
        (low, high), (bottom, top) = part["limits"], whole["limits"]
        assert bottom <= low < high <= top
        held = [v for v in part["values"] if bottom <= v <= top and (v > 0 or part["scale"] != "log")]
        assert all(low <= v <= high for v in held)
        assert part["ticks"] >= 2
        narrower += (low, high) != (bottom, top)
    assert narrower >= 4
    page.evaluate("() => TABS[0].zoomTo(null)")
    assert page.evaluate(seen) == before


def brightness(colour: str) -> float:
    """Mean channel of rgb(r, g, b), 0 to 1."""
    return sum(map(int, colour[4:-1].split(","))) / 765


def test_light_and_dark(open_page, report):
    paper = "() => getComputedStyle(document.body).backgroundColor"
    dark = open_page(report, scheme="dark")
    night = dark.evaluate(paper)
    light = open_page(report)
    day = light.evaluate(paper)
    assert brightness(night) < 0.15 and brightness(day) > 0.9
    light.locator("#theme").click()
    assert light.evaluate(paper) == night


def test_tabs_are_reached_with_the_keyboard(open_page, report):
    page = open_page(report)
    page.keyboard.press("Tab")
    page.keyboard.press("Tab")
    page.keyboard.press("ArrowRight")
    assert page.locator("#tab-t1").get_attribute("aria-selected") == "true"
    assert page.locator("#t1").is_visible() and not page.locator("#t0").is_visible()
    seen = []
    for _ in range(4):
        page.keyboard.press("Tab")
        seen.append(page.evaluate("() => document.activeElement.className || document.activeElement.tagName"))
    assert seen == ["play", "time", "SELECT", "chip"]


OVERLAPS = """() => {
  const wrong = [];
  for (const svg of document.querySelectorAll("svg[role=img]")) {
    const texts = [...svg.querySelectorAll("text")].filter((t) => t.textContent);
    const boxes = texts.map((t) => [t.textContent, t.getBoundingClientRect()]);
    const frame = svg.getBoundingClientRect();
    if (!frame.width) continue;
    boxes.forEach(([a, p], i) => {
      if (p.left < frame.left - 1 || p.right > frame.right + 1) wrong.push(`${a} leaves ${svg.getAttribute("aria-label")}`);
      for (const [b, q] of boxes.slice(i + 1))
        if (p.left < q.right - 1 && q.left < p.right - 1 && p.top < q.bottom - 3 && q.top < p.bottom - 3)
          wrong.push(`${a} / ${b}`);
    });
  }
  return wrong;
}"""


def drawn(page) -> None:
    """Wait until a page that has changed is drawn: what watches the sizes of its parts is told between frames."""
    page.evaluate("async () => { for (let i = 0; i < 3; i++) await new Promise(requestAnimationFrame); }")


@pytest.mark.parametrize("width", [360, 700, 1280])
def test_no_text_overlaps_and_nothing_scrolls_sideways(open_page, report, width):
    page = open_page(report, width=width)
    for tab in ("#tab-t0", "#tab-t1"):
        page.locator(tab).click()
        drawn(page)
        assert page.evaluate("() => document.documentElement.scrollWidth <= innerWidth")
        assert page.evaluate(OVERLAPS) == []


@pytest.mark.parametrize("width", [360, 1280])
def test_windows_and_observability_have_pages_too(open_page, comparison, tmp_path, width):
    problem, tracking = comparison.problem, comparison.tracking
    tabs = [windows_tab(windows(problem, tracking, (1, 10, 50))), observability_tab(observability(problem, tracking))]
    page = open_page(write_page(tmp_path, "Report", tabs), width=width)
    for n, charts in ((0, 5), (1, 2)):
        page.locator(f"#tab-t{n}").click()
        drawn(page)
        assert page.locator(f"#t{n} .plot svg").count() == charts
        assert page.evaluate("() => document.documentElement.scrollWidth <= innerWidth")
        assert page.evaluate(OVERLAPS) == []
    assert "Verdict" in page.locator("#t1 .summary").inner_text()


def test_every_axis_of_a_quantity_has_its_unit(open_page, report):
    page = open_page(report)
    labels = page.locator("#t1 svg[role=img] text.label").all_text_contents()
    assert len(labels) >= 24
    without = {label for label in labels if not label.endswith("]")}
    assert all("NEES" in label or "NIS" in label for label in without), without


def test_printed_it_is_light_and_whole(open_page, report):
    page = open_page(report, scheme="dark")
    page.emulate_media(media="print")
    assert page.evaluate("() => getComputedStyle(document.body).backgroundColor") == "rgb(255, 255, 255)"
    assert page.locator("#t0").is_visible() and page.locator("#t1").is_visible()
    assert not page.locator("#t0 .play").is_visible()
    assert page.pdf()[:4] == b"%PDF"  # what is folded is opened for it
    assert page.evaluate("() => [...document.querySelectorAll('.plot')].every(e => e.querySelector('svg .grid-lines line'))")
    assert page.evaluate("() => [...document.querySelectorAll('details')].every((fold) => fold.open)")


def test_hostile_names_are_text(open_page, comparison, tmp_path):
    problem = replace(comparison.problem, stations=[replace(comparison.problem.stations[0], name=HOSTILE)])
    hostile = compare(problem, comparison.tracking, {HOSTILE: pz.ExtendedKalmanFilter()}, source=HOSTILE)
    path = write_page(tmp_path / "report.html", HOSTILE, [comparison_tab(hostile, title=HOSTILE), comparison_tab(hostile)])
    page = open_page(path)
    assert page.evaluate("() => window.hacked") is None
    assert page.locator("img").count() == 0
    assert page.locator("script").count() == 2
    for place in ("h1", "#t0 h2", "#t0 .chip", "#t0 table.now tbody th", "#tab-t0"):
        assert "</script><script>hacked=1</script><img src=x onerror=hacked=1>" in page.locator(place).first.inner_text()


def test_the_estimate_itself_is_shown(open_page, report, comparison):
    page = open_page(report)
    table = page.locator("#t0 table", has_text="At the last measurement")
    for i, name in enumerate(comparison.problem.model.names):
        cells = table.locator("tbody tr").nth(i).locator("td").all_inner_texts()
        assert table.locator("tbody th").nth(i).inner_text() == name
        for cell, estimate in zip(cells, comparison.views.values(), strict=False):
            value, sigma = (float(part) for part in cell.split(" ± "))
            assert sigma == pytest.approx(np.sqrt(estimate.covariance[-1, i, i]), rel=0.06)
            assert value == pytest.approx(estimate.mean[-1, i], abs=0.6 * sigma)
    seen = """() => { const chart = TABS[0].drawings.find((d) => d.spec.title === "x over time");
        const [band, line] = chart.lines; return [band.upper, band.lower, line.y].map((v) => Array.from(v)); }"""
    upper, lower, middle = page.evaluate(seen)
    ekf = comparison.estimates["ekf"]
    sigma = np.sqrt(ekf.covariance[:, 0, 0])
    assert np.allclose(middle, ekf.mean[:, 0], rtol=2**-16)
    assert np.allclose(np.array(upper) - middle, 3 * sigma, rtol=1e-3) and np.allclose(
        upper + np.array(lower), 2 * np.array(middle)
    )


def test_kinds_of_measurements_have_axes_of_their_own(open_page, tmp_path):
    """A range in metres and a turn rate in rad/s stand in the same column: two charts, each with its unit."""
    sensors = [
        pz.Sensor("range", {"r": "sqrt(x**2 + 4)"}, units={"r": "m"}),
        pz.Sensor("gyro", {"w": "v/2"}, units={"w": "rad/s"}),
    ]
    model = pz.Model(["x", "v"], {"x": "v", "v": "0"}, sensors)
    stations = [pz.Station("radar", "range", [1.0]), pz.Station("box", "gyro", [1e-6])]
    problem = pz.Problem(model, pz.Gaussian([5.0, 1.0], [1.0, 1.0]), stations=stations)
    tracking = pz.simulate(problem, np.arange(20.0), np.random.default_rng(0))
    found = compare(problem, tracking, {"ekf": pz.ExtendedKalmanFilter()})
    page = open_page(write_page(tmp_path / "p.html", "P", [comparison_tab(found)]))
    seen = """() => TABS[0].drawings.filter((d) => d.spec.title.startsWith("Innovations"))
        .map((d) => [d.spec.title, d.spec.y.show[0]])"""
    assert page.evaluate(seen) == [["Innovations of r", "m"], ["Innovations of w", "deg/s"]]


def test_without_truth_panels_say_so(open_page, comparison, tmp_path):
    blind = replace(comparison.tracking, truth=None)
    bare = compare(comparison.problem, blind, {"ekf": pz.ExtendedKalmanFilter()})
    page = open_page(write_page(tmp_path / "report.html", "Report", [comparison_tab(bare)]))
    text = page.locator("main").inner_text()
    assert "truth is not known" in text and "NEES needs the truth" in text
    assert page.locator("#t0 .plot svg").count() >= 5
    assert "State by state" not in text and "Error of" not in text  # no error where no truth is


def test_one_epoch_and_a_failed_estimator_make_a_page(open_page, comparison, tmp_path):
    class Broken:
        def estimate(self, problem, tracking):
            raise ValueError("the sky is cloudy")

    short = compare(comparison.problem, pz.Tracking([0.0], [1.0]), {"ekf": pz.ExtendedKalmanFilter(), "odd": Broken()})
    none = compare(comparison.problem, comparison.tracking, {"odd": Broken()})
    page = open_page(write_page(tmp_path / "report.html", "Report", [comparison_tab(short), comparison_tab(none)]))
    assert "odd: the sky is cloudy" in page.locator("#t0 .summary").inner_text()
    assert page.locator("#t0 .plot svg").count() >= 5  # no errors without a truth
    page.locator("#tab-t1").click()
    assert "odd: the sky is cloudy" in page.locator("#t1 .summary").inner_text()


def test_lines_pass_through_the_values(open_page, report, comparison):
    page = open_page(report)
    ends = page.evaluate(
        """() => { const chart = TABS[0].drawings.find((d) => d.spec.title === "Error of x");
        const line = chart.lines.find((l) => l.key === 0 && l.kind === "line");
        return [Array.from(line.y), Array.from(line.seconds)]; }"""
    )
    ekf = comparison.estimates["ekf"]
    error = ekf.mean[:, 0] - ekf.tracking.truth[:, 0]
    assert np.allclose(ends[0], error, rtol=2**-16, atol=0)  # what 24 bits hold
    assert np.allclose(ends[1], comparison.tracking.times, rtol=0, atol=1e-12)


def test_every_estimator_has_its_own_look_and_the_colour_of_the_pictures(open_page, report):
    marks = open_page(report).locator("#t0 .chip svg line").all()
    looks = [(mark.get_attribute("stroke"), mark.get_attribute("stroke-dasharray")) for mark in marks]
    assert len(set(looks)) == len(looks) == 4
    assert [colour for colour, _ in looks] == [shade_of(name) for name in ("ekf", "graph", "window:20", "window:20")]


def test_windows_of_near_lengths_have_looks_of_their_own(open_page, comparison, tmp_path):
    """Shades of 50 and 100 states are near each other, and 100 with three iterations has the shade of 100: dashes differ."""
    names = ("window:50", "window:100", "window:100x3", "window:200")
    found = compare(comparison.problem, comparison.tracking, {name: parse(name) for name in names})
    marks = open_page(write_page(tmp_path / "w.html", "W", [comparison_tab(found)])).locator("#t0 .chip svg line").all()
    dashes = [mark.get_attribute("stroke-dasharray") for mark in marks]
    assert len(set(dashes)) == len(dashes) == 8


@pytest.mark.parametrize("close", [False, True])
def test_right_ascension_grows_to_the_left_as_on_the_sky(open_page, tmp_path, close):
    """To scale with declination; the ellipse of a positive correlation leans to the upper left."""
    times, sigma, zero = np.arange(5.0), np.full(5, 0.1), np.zeros(5)
    x, y = (zero, zero) if close else (np.arange(5.0), np.arange(5.0))
    track = Track(x, y, "object", 0, sigma, sigma, np.full(5, 0.9))
    limits = (0.0, 4.0, 0.0, 4.0)
    block = Orbit("Sky", [track], ("right ascension", "declination"), Display("deg"), limits, close=close, mirrored=True)
    tab = Tab("Sky", "", [], [Section("Sky", [block])], keys=[Key("object", "#0072B2")], times=times, show_time=Display("s"))
    page = open_page(write_page(tmp_path, "Sky", [tab]))
    places = []
    for k in (0, 4):
        page.locator("input.time").fill(str(k))
        dot = page.locator("circle.dot")
        places.append([float(dot.get_attribute(name)) for name in ("cx", "cy")])
    (x0, y0), (x1, y1) = places
    if not close:
        assert x1 < x0
        assert y1 < y0
        assert x0 - x1 == pytest.approx(y0 - y1)
    turn = float(page.locator("ellipse").get_attribute("transform").split("(")[1].split()[0])
    assert turn == pytest.approx(45.0)  # clockwise on the screen, of an ellipse whose long axis is level at first
    marks = [
        (float(mark.get_attribute("x")), float(mark.text_content().replace("\N{MINUS SIGN}", "-")))
        for mark in page.locator(".grid-lines text[text-anchor=middle]").all()
    ]
    assert [value for _, value in sorted(marks)] == sorted((value for _, value in marks), reverse=True)


def test_stations_stand_on_the_picture_of_the_orbit(open_page, report):
    """Above every line, to scale: the probe's radar is at the edge of the planet, ten metres from its middle."""
    page = open_page(report)
    orbit = page.locator("#t0 figure", has_text="Orbit").first
    x = float(orbit.locator("path.site").get_attribute("d").split()[0][1:])
    planet = orbit.locator("circle.planet")
    assert x - float(planet.get_attribute("cx")) == pytest.approx(float(planet.get_attribute("r")), abs=0.1)
    assert orbit.locator("svg > g").evaluate_all("all => all.findIndex(g => g.querySelector('.site'))") == 3
    assert orbit.get_by_text("radar", exact=True).count() == 1
