"""Pages without a browser: what they hold, how large they are, and that nothing in them can do harm."""

import json
import re
from base64 import b64decode
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

import piazzi as pz
from piazzi.evaluate import Comparison, compare
from piazzi.evaluate.consistency import Check
from piazzi.evaluate.consistency_tests import ConsistencyTests
from piazzi.present.colours import COLOURS, mixed, shade_of, shades
from piazzi.present.report import Key, Section, Tab, comparison_tab, page, write_page
from piazzi.present.report.blocks import Table, Text
from piazzi.present.report.html import Pool, packed, script_json
from piazzi.present.report.views import MOST_POINTS, Thinning
from piazzi.present.report.words import listed, points
from piazzi.present.squares import running_mean
from piazzi.scenarios import load_scenario

WINDOWS = {f"window:{lag}": pz.SlidingWindow(lag=lag) for lag in (10, 50, 100, 200)}
SIX = {"ekf": pz.ExtendedKalmanFilter(), "graph": pz.FactorGraph(), **WINDOWS}


def unpacked(text: str) -> np.ndarray:
    """24-bit floats, most significant byte last."""
    raw = np.frombuffer(b64decode(text), dtype=np.uint8).reshape(-1, 3).astype(np.uint32)
    return ((raw[:, 0] << 8) | (raw[:, 1] << 16) | (raw[:, 2] << 24)).view(np.float32)


def data_of(html: str) -> dict:
    """The strict JSON that a page holds."""

    def refuse(name: str) -> None:
        raise AssertionError(f"{name} is not JSON")

    (text,) = re.findall(r'<script type="application/json" id="data">(.*?)</script>', html, re.DOTALL)
    return json.loads(text, parse_constant=refuse)


@pytest.fixture(scope="module")
def comparison() -> Comparison:
    scenario = load_scenario("satellite-bearing")
    tracking = pz.simulate(scenario.problem, scenario.times, np.random.default_rng(0))
    return compare(scenario.problem, tracking, SIX, source="satellite-bearing")


# ---- numbers -------------------------------------------------------------------------------------------------------------


@given(st.lists(st.floats(width=32, allow_nan=True, allow_infinity=True), max_size=20))
def test_packed_numbers_come_back(values):
    array = np.array(values, dtype=float)
    back = unpacked(packed(array))
    kept = np.isfinite(array) & (np.abs(array) < 1e38) & ((np.abs(array) > 1e-37) | (array == 0))
    assert_allclose(back[kept], array[kept], rtol=2**-16)
    assert np.isnan(back[~np.isfinite(array)]).all()


def test_an_array_is_kept_once():
    pool = Pool()
    x = np.geomspace(1, 1e9, 50)
    assert pool.add(x) == pool.add(x.copy()) == 0
    assert pool.add_length((x, -x)) == 2  # its second part is new
    assert pool.entries[2] == {"length": [0, 1]}
    times = np.arange(1441) * 15.0
    assert pool.entries[pool.add_exactly(times)] == [0.0, 15.0, 1441]
    uneven = np.array([0.0, 1.0, 3.0])
    assert_allclose(np.frombuffer(b64decode(pool.entries[pool.add_exactly(uneven)]["double"])), uneven)


@given(st.text(), st.text())
def test_json_in_a_page_ends_no_script(key, value):
    text = script_json({key: [value, "</script><!--\u2028\u2029&"]})
    assert text.isascii()
    assert not set(text) & set("<>&")
    assert json.loads(text) == {key: [value, "</script><!--\u2028\u2029&"]}


def test_numbers_that_are_not_finite_are_no_json():
    with pytest.raises(ValueError, match="JSON"):
        script_json({"a": float("nan")})


# ---- thinning ------------------------------------------------------------------------------------------------------------


@given(st.integers(1, 20_000), st.integers(0, 2**32 - 1))
def test_thinning_keeps_every_spike_and_the_order(count, seed):
    thin = Thinning(count)
    values = np.random.default_rng(seed).standard_normal(count)
    places, shown = thin.places, thin.extremes(values)
    assert len(places) == len(shown) == len(thin.at_places(values)) <= MOST_POINTS + 1
    assert (np.diff(places) > 0).all() and places[0] >= 0 and places[-1] < count
    assert shown.max() == values.max() and shown.min() == values.min()
    if count <= MOST_POINTS:
        assert (shown == values).all()
    else:  # each value stays in its bucket
        at = {v: i for i, v in enumerate(values)}
        moved = np.array([at[v] for v in shown]) - places
        assert np.abs(moved).max() < thin.size


def test_samples_are_typical_and_keep_what_is_wild():
    values = np.random.default_rng(0).standard_normal(100_000)
    values[54_321] = -30.0
    shown = Thinning(100_000).sample(values, np.full(100_000, 6.0))
    assert len(shown) == len(Thinning(100_000).places)
    assert (shown == -30.0).sum() == 1
    assert np.isin(shown, values).all()
    assert np.std(shown[shown > -30.0]) == pytest.approx(1.0, abs=0.1)  # 3.9 standard deviations of a sample of 1500
    assert (Thinning(10).sample(values[:10], np.zeros(10)) == values[:10]).all()


def test_thinning_leaves_out_what_is_not_finite():
    values = np.full(10_000, np.nan)
    values[5000], values[5001] = 3.0, np.inf
    shown = Thinning(10_000).extremes(values)
    assert set(shown[np.isfinite(shown)]) == {3.0}


def test_a_million_epochs_make_a_page(comparison):
    """Estimates repeated to a million epochs: the page stays small, and its spike is there."""
    ekf = comparison.estimates["ekf"]
    K, times = 1_000_000, 700
    mean, truth, P, nu, S, z = (
        np.concatenate([a] * times)[:K]
        for a in (
            ekf.mean,
            ekf.tracking.truth,
            ekf.covariance,
            ekf.innovations,
            ekf.innovation_covariances,
            ekf.tracking.values,
        )
    )
    mean[654_321, 2] += 1e7
    tracking = pz.Tracking(np.arange(K) * 15.0, z, truth=truth)
    long = replace(ekf, tracking=tracking, mean=mean, covariance=P, innovations=nu, innovation_covariances=S)
    html = page("Long", [comparison_tab(replace(comparison, tracking=tracking, estimates={"ekf": long}))])
    assert len(html) < 400_000
    assert "Of every 1,334 of 1,000,000 values the smallest and the largest are drawn." in html
    found = data_of(html)
    (chart,) = [d for d in found["tabs"][0]["drawings"] if d["title"] == "Error of vx"]
    (line,) = [line for line in chart["lines"] if line["kind"] == "line"]
    assert unpacked(found["pool"][line["y"]]).max() == pytest.approx(1e7, rel=1e-3)


# ---- pages ---------------------------------------------------------------------------------------------------------------


def test_two_problems_and_six_estimators_fit(comparison):
    other = replace(
        comparison, source="again", estimates={n: replace(e, mean=e.mean * 1.01) for n, e in comparison.estimates.items()}
    )
    html = page("Two", [comparison_tab(comparison), comparison_tab(other)])
    assert len(html.encode()) <= 2_500_000
    data_of(html)


def test_a_page_asks_for_nothing(comparison):
    html = page("Page", [comparison_tab(comparison)])
    assert "default-src 'none'" in html
    assert not re.findall(
        r"""(?:src|href)=["'](?!data:,)|url\((?!#)|@import|fetch\(|XMLHttp|https?://(?!www\.w3\.org/2000/svg)""", html
    )
    tags = re.findall(r"<script[^>]*>", html)
    assert tags == ['<script type="application/json" id="data">', "<script>"]


def test_the_same_comparison_gives_the_same_page(comparison):
    assert page("Page", [comparison_tab(comparison)]) == page("Page", [comparison_tab(comparison)])


def test_a_tab_can_be_anything():
    """A study: no time, no legend; a table and words."""
    table = Table([("case", ""), ("error", "m")], [["<b>one</b>", "1.0"]], caption="Cases")
    html = page(
        "Study",
        [Tab("Study", "two cases", [], [Section("Results", [table, Text(["It is <so>."])])], keys=[Key("a", "#123456")])],
    )
    assert "&lt;b&gt;one&lt;/b&gt;" in html and "It is &lt;so&gt;." in html
    assert "Look closely" not in html  # where no chart shows one estimator alone


def test_pages_are_written_whole_into_a_folder(tmp_path):
    tab = Tab("T", "", [], [])
    assert write_page(tmp_path, "T", [tab]).name == "report.html"
    assert write_page(tmp_path / "mine.html", "T", [tab]) == tmp_path / "mine.html"
    assert sorted(p.name for p in tmp_path.iterdir()) == ["mine.html", "report.html"]
    with pytest.raises(OSError, match="nowhere"):
        write_page(tmp_path / "nowhere" / "x.html", "T", [tab])


def test_a_report_from_python(comparison, tmp_path):
    path = pz.write_report(tmp_path, comparison, comparison, title="Both")
    assert path == tmp_path / "report.html"
    assert len(data_of(path.read_text())["tabs"]) == 2
    with pytest.raises(ValueError, match="no comparison"):
        pz.write_report(tmp_path)


def test_a_lost_estimate_leaves_gaps(comparison):
    ekf = comparison.estimates["ekf"]
    mean, P = ekf.mean.copy(), ekf.covariance.copy()
    mean[700:], P[700:] = np.nan, np.inf
    lost = replace(ekf, mean=mean, covariance=P)
    html = page("Lost", [comparison_tab(replace(comparison, estimates={"ekf": lost}))])
    found = data_of(html)
    (chart,) = [d for d in found["tabs"][0]["drawings"] if d["title"] == "Error of x"]
    (line,) = [line for line in chart["lines"] if line["kind"] == "line"]
    values = unpacked(found["pool"][line["y"]])
    assert np.isfinite(values[:700]).all() and np.isnan(values[700:]).all()


# ---- words ---------------------------------------------------------------------------------------------------------------


def said(comparison: Comparison) -> dict[str, str]:
    return {point.heading: point.text for point in points(comparison)}


def with_rows(comparison: Comparison, **changes) -> Comparison:
    """The first row changed."""
    first, *rest = comparison.rows
    return replace(comparison, rows=(replace(first, **changes), *rest))


def test_the_best_is_named_with_its_error(comparison):
    rows = [r for r in comparison.rows if r.view == "realtime"]
    best = min(rows, key=lambda r: r.rmse_last_half["position"])
    text = said(comparison)["Best in real time"]
    assert text.startswith(best.estimator)
    assert f"{best.rmse_last_half['position'] / 1e3:.4g}" in text
    rows = [r for r in comparison.rows if r.view == "delayed"]
    best = min(rows, key=lambda r: r.rmse["position"])
    text = said(comparison)["Best with all measurements"]
    assert text.startswith(best.estimator)
    assert f"{best.rmse['position'] / 1e3:.4g}" in text


def test_who_is_not_to_be_trusted_is_named_with_the_reason(comparison):
    assert "ekf" in said(with_rows(comparison, diverged=True))["Diverged"]
    failed = said(with_rows(comparison, success=False, message="the state left the planet"))
    assert failed["Did not succeed"] == "ekf: the state left the planet."
    assert "ekf" not in failed["Best in real time"]
    assert said(with_rows(comparison, message="noise is near rounding"))["Note"] == "ekf: noise is near rounding."


def with_nees(row, value: float, low: float = 3.0, high: float = 5.0):
    """The row with this mean NEES, tested against these bounds."""
    check = Check(value, low, high, 100.0)
    return replace(row, mean_nees=value, mean_nees_last_half=value, tests=ConsistencyTests(nees=check, nees_last_half=check))


def test_consistency_is_judged_by_the_tests_where_there_are_any(comparison):
    fair = [with_nees(r, 4.0) for r in comparison.rows]
    assert said(replace(comparison, rows=tuple(fair)))["Consistent covariance"].startswith("Errors of all are consistent with")
    sure = said(replace(comparison, rows=(with_nees(fair[0], 36.0), *fair[1:])))
    assert sure["Optimistic covariance"].startswith("Errors of ekf are about 3.0 times what the covariance predicts")
    assert sure["Consistent covariance"].startswith("Errors of all but ekf are")
    assert "ekf" in said(replace(comparison, rows=(with_nees(fair[0], 1.0), *fair[1:])))["Pessimistic covariance"]
    wide = with_nees(fair[0], 36.0, 0.1, 50.0)  # a run so correlated in time that even this proves nothing
    assert "Optimistic covariance" not in said(replace(comparison, rows=(wide, *fair[1:])))


def test_consistency_is_judged_by_a_factor_without_tests(comparison):
    rows = [replace(with_nees(r, 4.0), tests=ConsistencyTests()) for r in comparison.rows]
    rows[0] = replace(with_nees(rows[0], 36.0), tests=ConsistencyTests())
    assert "Errors of ekf are about 3.0" in said(replace(comparison, rows=tuple(rows)))["Optimistic covariance"]


def test_innovations_that_are_not_noise_are_told(comparison):
    rows = [with_nees(r, 4.0) for r in comparison.rows]
    odd = replace(rows[0], tests=replace(rows[0].tests, whiteness=Check(99.0, 0.0, 18.3, 10), bias=Check(9.0, 0.0, 3.8, 1)))
    text = said(replace(comparison, rows=(odd, *rows[1:])))["Innovations are not white noise"]
    assert "those of ekf are correlated in time and have a mean other than zero" in text
    assert "Innovations are not white noise" not in said(replace(comparison, rows=tuple(rows)))


def test_without_truth_the_summary_says_so(comparison):
    bare = replace(comparison.tracking, truth=None)
    found = said(compare(comparison.problem, bare, {"ekf": pz.ExtendedKalmanFilter()}))
    assert "no truth" in found["Errors unknown"]
    assert found["Consistent covariance"].startswith("Innovations of ekf")


def test_lists_of_names():
    assert listed(["a"]) == "a"
    assert listed(["a", "b", "a"]) == "a and b"
    assert listed(["a", "b", "c"]) == "a, b and c"


def test_both_views_of_a_window_are_one_name(comparison):
    def cautious(*chosen: tuple[str, str]) -> str:
        rows = [with_nees(r, 1.0 if (r.estimator, r.view) in chosen else 4.0) for r in comparison.rows]
        return said(replace(comparison, rows=tuple(rows)))["Pessimistic covariance"]

    both = (("ekf", "realtime"), ("window:10", "realtime"), ("window:10", "delayed"))
    assert cautious(*both).startswith("Errors of ekf and window:10 are")
    assert cautious(both[2]).startswith("Errors of window:10 delayed are")
    assert cautious(both[1]).startswith("Errors of window:10 in real time are")


# ---- NIS and colours -----------------------------------------------------------------------------------------------------


def test_running_means_of_nis(comparison):
    from piazzi.evaluate.metrics import nis

    found = nis(comparison.estimates["ekf"])
    mean = running_mean(found, 48)
    assert_allclose(mean[500], found.value[500 - 24 : 500 + 24].mean())
    assert_allclose(mean[0], found.value[:48].mean())
    assert_allclose(running_mean(found, 1), found.value)


def test_an_estimator_has_its_colour_in_any_company():
    alone = {name: shades([name])[name] for name in ("ekf", "window:10", "window:200", "ekf:gate")}
    assert {name: shades([*COLOURS, *alone])[name] for name in alone} == alone
    assert len({shade_of(f"window:{lag}") for lag in (5, 10, 20, 50, 100, 200, 500)}) == 7
    assert shade_of("window:100x3") == shade_of("window:100") == COLOURS["window"]
    assert mixed("#000000", 255, 0.5) == "#808080"


def test_names_of_the_users_own_differ_from_each_other_and_from_known_ones():
    found = shades(["mine", "yours", "ekf"])
    assert len(set(found.values())) == 3
