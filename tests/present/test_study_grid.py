"""A study against what was varied, beside the same from its runs."""

from itertools import product

import numpy as np
import pytest
from numpy.testing import assert_allclose

from piazzi.present.figures.grids import against, heat_map, map_values
from piazzi.present.figures.studies import study_pages
from piazzi.present.grid import Scale, colour, file_name, letters, measures, shares, spreads
from piazzi.study import run_study
from piazzi.study.grid import Grid
from tests.present.looks import check_looks
from tests.study.studies import small

SCALES, LAGS = (0.5, 1, 50), (3, 10)


@pytest.fixture(scope="module")
def stored(tmp_path_factory):
    study = small(runs=12, estimators=("ekf", "window"), vary={"lag": LAGS[::-1], "R.scale": SCALES})
    return run_study(study, tmp_path_factory.mktemp("grid") / "s.nc", workers=0)


@pytest.fixture(scope="module")
def grid(stored):
    return Grid.of(stored.summary)


@pytest.fixture
def ax():
    from matplotlib.figure import Figure

    return Figure().subplots()


def test_every_number_that_was_varied_is_an_axis(grid):
    """Of the problem and of estimators; in order, however they were given."""
    assert grid.axes == {"R.scale": SCALES, "lag": LAGS}
    assert grid.estimators == [("ekf", "realtime"), ("window", "realtime"), ("window", "delayed")]


def test_every_line_is_where_its_values_are(grid, stored):
    for scale, lag in product(SCALES, LAGS):
        at = {"R.scale": scale, "lag": lag}
        point = stored.points.index([scale])
        for who, label in ((("ekf", "realtime"), "ekf"), (("window", "delayed"), f"window:{lag}")):
            row = stored.rows.index((label, who[1]))
            assert grid.line(who, at) is stored.summary.lines[point * len(stored.rows) + row]
    assert grid.has(("window", "delayed"), "lag")
    assert not grid.has(("ekf", "realtime"), "lag")


def test_spreads_are_those_of_the_runs(grid, stored):
    errors, _, nees, divergence = measures(stored.summary)
    lines = grid.along("R.scale", {"lag": 10})["window", "realtime"]
    row = stored.rows.index(("window:10", "realtime"))
    for k, scale in enumerate(SCALES):
        runs = stored.row(stored.points.index([scale]), row)
        low, middle, high = np.quantile(runs.numbers["rmse_last_half"][:, 0], [0.05, 0.5, 0.95])
        assert_allclose(spreads(errors, lines)[:, k], [middle, low, high])
        own = runs.numbers["mean_nees_last_half"]
        assert_allclose(spreads(nees, lines)[:, k], [own.mean(), *np.quantile(own, [0.05, 0.95])])
        rate, low, high = spreads(divergence, lines)[:, k]
        assert rate == runs.diverged.mean()
        assert low <= rate <= high


def test_a_line_for_each_estimator_against_an_axis(ax, grid, stored):
    measure = measures(stored.summary)[0]
    against(ax, grid, "lag", measure, {"R.scale": 1})
    lines = {line.get_label(): line for line in ax.lines}
    assert list(lines) == ["ekf", "window, real time", "window, delayed"]
    assert len(set(lines["ekf"].get_ydata())) == 1  # it has no lag
    found = grid.along("lag", {"R.scale": 1})["window", "delayed"]
    assert_allclose(lines["window, delayed"].get_ydata(), spreads(measure, found)[0] * measure.show.factor)
    assert_allclose(lines["window, delayed"].get_xdata(), LAGS)
    assert [text.get_text() for text in ax.get_xticklabels()] == ["3", "10"]
    assert ax.get_ylabel() == measure.show.label("position error,\nlast half, median")


def test_cells_of_a_map_say_their_numbers_in_letters_that_stand_out(ax, grid, stored):
    measure = measures(stored.summary)[2]
    values = map_values(grid, ("R.scale", "lag"), measure, ("window", "realtime"), {})
    heat_map(ax, grid, ("R.scale", "lag"), measure, values, shares(measure, values))
    expected = [[grid.line(("window", "realtime"), {"R.scale": s, "lag": g}).mean_nees_last_half for s in SCALES] for g in LAGS]
    assert_allclose(values, expected)
    texts = {text.get_position(): text.get_text() for text in ax.texts}
    assert texts == {(i, j): measure.text(values[j, i]) for j in range(2) for i in range(3)}


def test_colours_of_maps_keep_the_order_and_letters_their_contrast(stored):
    """By relative luminance (WCAG 2): at least 4.5 to 1; a NEES as it should be is the palest."""

    def luminance(shade):
        parts = [int(shade[i : i + 2], 16) / 255 for i in (1, 3, 5)]
        return np.dot([0.2126, 0.7152, 0.0722], [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in parts])

    for measure in measures(stored.summary):
        scale = [colour(measure, share) for share in np.linspace(0, 1, 41)]
        light = np.array([luminance(shade) for shade in scale])
        ink = np.array([luminance(letters(shade)) for shade in scale])
        assert ((np.maximum(light, ink) + 0.05) / (np.minimum(light, ink) + 0.05) >= 4.5).all()
        if measure.ideal is None:
            assert (np.diff(light) < 0).all()
        else:
            assert light.argmax() == 20
            assert shares(measure, np.array([measure.ideal, 3 * measure.ideal]))[0] == 0.5


def test_axes_are_logarithmic_where_values_span_much_and_words_stand_side_by_side():
    assert Scale.of((0.1, 1, 10)).kind == "log"
    assert Scale.of((10, 20, 30)).kind == Scale.of((0, 1, 100)).kind == "linear"
    words = Scale.of(("huber", "tukey"))
    assert (words.texts, words.places.tolist()) == (("huber", "tukey"), [0.0, 1.0])


def test_pictures_are_named_after_their_point(stored):
    names = [name for name, _ in study_pages(stored.summary)]
    assert names[:3] == ["study-against-R.scale", "study-against-lag", "study-map-R.scale-lag"]
    assert names[3:6] == ["study-errors-R.scale=0.5", "study-nees-R.scale=0.5", "study-cost-R.scale=0.5"]
    assert len(names) == 3 + 3 * 3
    assert file_name({"R.a/b.scale": 1e-3, "lag": 5}) == "R.a-b.scale=0.001_lag=5"


def test_a_study_draws_itself_against_what_was_varied(stored, ax):
    assert stored.plot(ax, against="lag", measure="NEES", point=1) is ax
    assert ax.get_xlabel() == "lag"
    with pytest.raises(ValueError, match=r"unknown axis 'lags'; known: R\.scale, lag"):
        stored.plot(ax, against="lags")


@pytest.fixture
def study_page(stored, tmp_path):
    from piazzi.present.report import study_tabs, write_page

    return write_page(tmp_path, "Grid", study_tabs(stored.summary, "Grid"))


def test_a_point_is_picked_by_its_values(open_page, study_page):
    page = open_page(study_page)
    assert page.locator("article:not(.away)").count() == 1
    picker = page.get_by_role("combobox", name="R.scale")
    picker.select_option("50")
    assert page.locator("article:not(.away) h2").inner_text() == "R.scale = 50"
    page.locator("article:not(.away) .chip", has_text="ekf").click()
    picker.select_option("1")  # what is switched off stays so
    assert page.locator("article:not(.away) .chip", has_text="ekf").get_attribute("aria-pressed") == "false"
    page.get_by_role("button", name="Whole grid").click()
    assert page.locator("article:not(.away) h2").inner_text() == "Grid"
    assert page.get_by_role("button", name="Whole grid").get_attribute("aria-pressed") == "true"


def test_the_page_shows_maps_and_spreads(open_page, study_page, grid, stored):
    page = open_page(study_page)
    figure = page.locator("figure", has_text="NEES, window, delayed")
    measure = measures(stored.summary)[2]
    values = map_values(grid, ("R.scale", "lag"), measure, ("window", "delayed"), {})
    assert figure.locator(".cells text").all_text_contents() == [measure.text(v) for v in values.ravel()]
    figure.scroll_into_view_if_needed()
    box = figure.locator(".plot").bounding_box()
    page.mouse.move(box["x"] + box["width"] - 40, box["y"] + 50)
    assert page.locator("#tip strong").inner_text() == "R.scale = 50, lag = 10"
    chart = page.locator("figure", has_text="Position error against lag").first
    chart.scroll_into_view_if_needed()
    box = chart.locator(".plot").bounding_box()
    page.mouse.move(box["x"] + box["width"] - 20, box["y"] + 80)
    assert "5 to 95 % of runs" in page.locator("#tip").inner_text()


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_nothing_of_the_page_is_wider_than_a_phone(open_page, study_page, scheme):
    page = open_page(study_page, width=390, scheme=scheme)
    for _ in range(2):
        assert page.evaluate("document.documentElement.scrollWidth") <= 390
        page.get_by_role("combobox", name="R.scale").select_option("50")
        check_looks(page)


def test_of_many_points_there_are_maps_and_no_pictures_of_some(stored, monkeypatch):
    from piazzi.present.figures import studies

    monkeypatch.setattr(studies, "MOST_POINTS", 2)
    names = [name for name, _ in study_pages(stored.summary)]
    assert names and all(name.startswith(("study-against-", "study-map-")) for name in names)


def test_points_without_a_tab_are_told_of(stored, monkeypatch):
    from piazzi.present.report import study

    monkeypatch.setattr(study, "MOST_TABS", 2)
    whole, *points = study.study_tabs(stored.summary, "Grid")
    assert len(points) == 2
    assert "2 of 3 points have a page of their own" in whole.sections[-1].blocks[0].paragraphs[-1]
