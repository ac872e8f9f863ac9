"""The page of a determination in a browser: globe, map, skies, residuals; each against a formula written here."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import piazzi as pz
from piazzi import earth
from piazzi.determination.holding import passes
from piazzi.determination.page.charts import gained, passes_of
from piazzi.determination.page.places import station_rows
from piazzi.determination.page.sampled import sampled
from piazzi.determination.reporting import tab
from piazzi.determination.residuals import table
from piazzi.present.land import land
from piazzi.present.report import write_page
from tests.determination.fixing import observations, truth
from tests.present.looks import check_looks

T = np.arange(0.0, 43200.0, 900.0)
SIGMA = 5.0
LAND = {  # longitude and latitude, degrees: far from every coast
    "Paris": (2.3, 48.6), "Sahara": (10.0, 22.0), "Brazil": (-55.0, -10.0),
    "Australia": (134.0, -24.0), "Siberia": (100.0, 62.0), "South Pole": (0.0, -89.0), "Greenland": (-42.0, 74.0),
    "Chukotka": (-178.0, 67.5), "Kansas": (-98.0, 39.0),
}  # fmt: skip
SEA = {
    "Pacific": (-140.0, -20.0), "Atlantic": (-40.0, 30.0), "Indian Ocean": (80.0, -20.0), "Caspian": (51.0, 42.0),
    "North Pole": (0.0, 88.0), "Tasman Sea": (160.0, -40.0), "Date line": (180.0, 0.0), "Gulf of Guinea": (0.0, 0.0),
}  # fmt: skip


def unit(longitude, latitude):
    a, b = np.radians([longitude, latitude])
    return np.array([np.cos(b) * np.cos(a), np.cos(b) * np.sin(a), np.sin(b)])


@pytest.fixture(scope="module")
def found():
    noisy = truth(T)[:, :3] + SIGMA * np.random.default_rng(1).standard_normal((len(T), 3))
    noisy[7] += 1e4
    return pz.determine(observations(noisy, T, SIGMA), notes={"command": "piazzi determine fixes.oem --report page.html"})


@pytest.fixture(scope="module")
def report(found, tmp_path_factory) -> Path:
    return found.report(tmp_path_factory.mktemp("page") / "page.html")


# ---- what it shows -------------------------------------------------------------------------------------------------------


def test_land_is_three_tenths_of_the_earth():
    """29.2 % of it, less what the scale leaves out; area on the left of a ring by Green's theorem on the sphere."""
    rings = np.split(land(), np.flatnonzero(np.isnan(land()[:, 0])) + 1)[:-1]
    total = 0.0
    for ring in (np.radians(r[:-1]) for r in rings):
        (a, b), (a2, b2) = ring.T, np.roll(ring, -1, axis=0).T
        turns = (a2 - a + np.pi) % (2 * np.pi) - np.pi
        area = -np.sum(turns * (np.sin(b) + np.sin(b2)) / 2)
        if turns.sum() < -1.0:  # westward about the South Pole
            area = 2 * np.pi + np.sum(turns * -(np.sin(b) + np.sin(b2)) / 2) if area < 0 else 2 * np.pi - area
        inside = ring[0] == pytest.approx(np.radians([49.1, 41.3]), abs=0.01)
        total += -area if inside else area  # the Caspian Sea
    assert 0.28 < total / (4 * np.pi) < 0.30


def test_sigmas_along_the_orbit_are_those_of_its_covariance(found):
    path = sampled(found)
    zero = found.setup.measured.epoch
    assert path.times[0] == found.estimate.times[0] and path.times[-1] >= path.period
    for k in (0, 20, 150):
        P = found.orbit.covariance(zero + float(path.times[k]), "RTN")
        assert path.sigmas[k] == pytest.approx(np.sqrt(np.diag(P)), rel=1e-6)
        place = earth.transform(path.mean[k, :3], None, "GCRF", "ITRF", zero + float(path.times[k]))[0]
        assert path.place[k] == pytest.approx(place, abs=1e-3)


def test_information_of_passes_adds_up(found):
    """Its sum is half the logarithm of the determinant of all information, however the passes are cut."""
    columns = table(found)
    scale = found.setup.states[0, :6]
    units = np.sqrt(np.diag(found.problem.covariance))
    units[:3], units[3:6] = 0.1 * np.linalg.norm(scale[:3]), 0.1 * np.linalg.norm(scale[3:])
    H = np.nan_to_num(found.analysis.rows[found.keep]).reshape(-1, len(units)) * units
    whole = 0.5 * np.linalg.slogdet(np.eye(len(units)) + H.T @ H)[1] / np.log(2.0)
    entries = np.arange(len(columns["t"]))
    for parts in (2, 7):
        passes = [("fixes", part) for part in np.split(entries, np.arange(1, parts) * (3 * len(T) // parts // 3 * 3))]
        brought, lost = gained(found, passes, columns).blocks[0].lines
        assert brought.y.sum() == pytest.approx(whole, rel=1e-9)
        assert lost.y[-1] == pytest.approx(brought.y[-1], rel=1e-9)  # what came last is what would be lost without it
        assert (lost.y > 0).all()


def test_rejected_rows_have_their_reason(found):
    (rows,) = station_rows(found, sampled(found))
    assert np.nansum(rows.used == 0) == 1
    assert rows.notes[7] == found.reasons[7] != ""


def test_passes_of_the_page_are_those_of_the_verdict(found):
    every = passes(found.setup, np.ones(len(found.setup.rows), dtype=bool))
    shown = passes_of(found, table(found))
    row = np.nonzero(found.setup.rows >= 0)[0]
    assert shown[0][0] == "fixes"
    assert [np.unique(row[entries]).tolist() for _, entries in shown] == [one.tolist() for one in every]


def test_an_orbit_that_is_not_finite_is_not_drawn(found):
    lost = replace(found.estimate, mean=np.full_like(found.estimate.mean, np.nan))
    bad = replace(found, estimates={found.name: lost}, analysis=None)
    shown = tab(bad)
    assert any("not drawn" in p for s in shown.sections for b in s.blocks for p in getattr(b, "paragraphs", ()))


# ---- in a browser --------------------------------------------------------------------------------------------------------

VIEWS = [(0.0, 0.3), (1.7, -0.4), (-1.5, 0.9), (3.1, 0.0), (-2.6, -1.2), (0.5, 1.45), (2.4, -1.45), (1.0, 0.1)]
HITS = """([views, points]) => { const globe = TABS[0].drawings.find((d) => d instanceof Globe); globe.still = false;
  return views.map(([lon, lat]) => { Object.assign(globe, { lon, lat }); globe.paint();
    const land = globe.svg.querySelector(".land"), night = globe.svg.querySelector(".night");
    return points.map((p) => { const at = globe.onPaper(p.map((v) => v * 6378137), null); if (!at) return null;
      const point = globe.svg.createSVGPoint(); [point.x, point.y] = at;
      return [...at, land.isPointInFill(point), night.isPointInFill(point), globe.width, globe.height, globe.unit]; }); }); }"""


def test_the_globe_shows_land_where_land_is_and_night_where_the_sun_is_down(open_page, report, found):
    page = open_page(report)
    names = [*LAND, *SEA]
    points = [unit(*place) for place in [*LAND.values(), *SEA.values()]]
    seen = page.evaluate(HITS, [VIEWS, [p.tolist() for p in points]])
    last = found.epoch
    sun = earth.transform(earth.body("sun", last)[0], None, "GCRF", "ITRF", last)[0]
    sun /= np.linalg.norm(sun)
    count = 0
    for (lon, lat), row in zip(VIEWS, seen, strict=True):
        centre = unit(np.degrees(lon), np.degrees(lat))
        east = np.array([-np.sin(lon), np.cos(lon), 0.0])
        for name, p, hit in zip(names, points, row, strict=True):
            assert (hit is None) == (p @ centre < 0), (name, lon, lat)
            if hit is None or p @ centre < 0.05:
                continue
            x, y, on_land, in_night, width, height, per = hit
            assert x == pytest.approx(width / 2 + 6378137 * per * (p @ east), abs=0.05)
            assert y == pytest.approx(height / 2 - 6378137 * per * (p @ np.cross(centre, east)), abs=0.05)
            assert on_land == (name in LAND), (name, lon, lat)
            if abs(p @ sun) > 0.02:
                assert in_night == bool(p @ sun < 0), (name, lon, lat)
            count += 1
    assert count > 50


def test_the_tube_is_as_wide_as_the_covariance_says(open_page, report, found):
    page = open_page(report)
    path = sampled(found)
    k, lon, lat = 40, 0.7, 0.5
    n = [0.6, 0.8]
    sigma = page.evaluate(
        """([k, lon, lat, n]) => { const globe = TABS[0].drawings.find((d) => d instanceof Globe);
        Object.assign(globe, { lon, lat, still: false }); return globe.spread(globe.covariance[k], n, globe.turned[k]); }""",
        [k, lon, lat, n],
    )
    east = np.array([-np.sin(lon), np.cos(lon), 0.0])
    e = n[0] * east + n[1] * np.cross(unit(np.degrees(lon), np.degrees(lat)), east)
    P = np.zeros((3, 3))
    P[np.triu_indices(3)] = path.spread[k]
    P += np.triu(P, 1).T
    assert sigma == pytest.approx(np.sqrt(e @ P @ e), rel=1e-3)


def test_the_globe_turns_by_keys_and_by_dragging(open_page, report):
    page = open_page(report)
    where = "() => { const g = TABS[0].drawings.find((d) => d instanceof Globe); return [g.lon, g.lat, g.zoom, g.still]; }"
    first = page.evaluate(where)
    page.locator("svg.globe").focus()
    for key in ("ArrowRight", "ArrowUp", "+"):
        page.keyboard.press(key)
    assert page.evaluate(where) == pytest.approx([first[0] + 0.09, first[1] + 0.09, 1.25, True])
    page.keyboard.press("Home")
    assert page.evaluate(where) == first
    box = page.locator("svg.globe").bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x - 60, y, steps=2)
    page.mouse.up()
    assert page.evaluate(where)[0] > first[0] + 0.1
    page.get_by_role("button", name="Turn with the Earth").click()
    assert page.evaluate(where)[3] is False


def test_the_cursor_moves_the_object(open_page, report):
    page = open_page(report)
    dot = "() => [...document.querySelectorAll('.object')].map((e) => e.getAttribute('cx'))"
    before = page.evaluate(dot)
    page.locator("input.time").focus()
    page.keyboard.press("Home")
    assert page.evaluate(dot) != before


def test_pointing_at_a_rejected_residual_tells_why(open_page, report, found):
    page = open_page(report)
    place = page.evaluate(
        """() => { const chart = TABS[0].drawings.find((d) => d.spec.title === "Residuals of x");
        chart.box.scrollIntoView({ block: "center" });
        const line = chart.lines.find((l) => l.kind === "crosses"); const box = chart.svg.getBoundingClientRect();
        return [box.left + chart.sx.place(line.x[0]), box.top + 60]; }"""
    )
    page.mouse.move(*place)
    assert found.reasons[7] in page.locator("#tip").inner_text()


@pytest.mark.parametrize(("kind", "begins"), [("svg", b"<svg"), ("png", b"\x89PNG"), ("csv", b"series,")])
def test_every_drawing_is_saved(open_page, report, kind, begins):
    page = open_page(report)
    figures = page.locator("figure:visible").all()
    assert len(figures) >= 7
    for figure in (figures[0], figures[1], figures[2]):
        with page.expect_download() as download:
            figure.locator(f"button[data-as={kind}]").click()
        data = Path(download.value.path()).read_bytes()
        assert data.startswith(begins) and len(data) > 400
        assert download.value.suggested_filename.endswith(f".{kind}")


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_letters_stand_out_and_everything_has_a_name(open_page, report, scheme):
    check_looks(open_page(report, scheme=scheme))


@pytest.mark.parametrize("width", [360, 1280])
def test_nothing_scrolls_sideways(open_page, report, width):
    page = open_page(report, width=width)
    page.evaluate("() => document.querySelectorAll('details').forEach((d) => (d.open = true))")
    page.evaluate("async () => { for (let i = 0; i < 3; i++) await new Promise(requestAnimationFrame); }")
    assert page.evaluate("() => document.documentElement.scrollWidth <= innerWidth")
    assert page.locator("details figure svg[role=img]").count() >= 10  # what was folded is drawn


def test_the_command_and_hostile_names_are_text(open_page, found, tmp_path):
    hostile = "</script><script>hacked=1</script><img src=x onerror=hacked=1>"
    bad = replace(found, notes={"command": f"piazzi determine {hostile}"})
    page = open_page(write_page(tmp_path / "p.html", hostile, [replace(tab(bad), title=hostile)]))
    assert page.evaluate("() => window.hacked") is None
    assert page.locator("img").count() == 0
    assert hostile in page.locator("pre").inner_text()


@pytest.mark.slow
def test_a_page_of_two_thousand_measurements_is_small_and_quick(browser, tmp_path):
    """At most 1.5 MB, and ready to be used within a second of being asked for, the best of three times."""
    t = 60.0 * np.arange(667)
    noisy = truth(t)[:, :3] + SIGMA * np.random.default_rng(1).standard_normal((len(t), 3))
    many = pz.determine(observations(noisy, t, SIGMA))
    assert len(table(many)["t"]) >= 2000
    path = many.report(tmp_path / "page.html")
    assert path.stat().st_size <= 1.5e6
    times = []
    for _ in range(3):
        page = browser.new_page()
        page.goto(path.as_uri())
        page.wait_for_selector("html[data-ready]")
        times.append(page.evaluate("performance.now()"))
        page.close()
    assert min(times) < 1000.0
