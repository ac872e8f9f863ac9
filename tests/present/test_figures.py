"""Pictures: every function draws what it was given on the axes it was given, and whole pages can be saved."""

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Ellipse
from numpy.testing import assert_allclose

import piazzi as pz
from piazzi.evaluate import Comparison, compare
from piazzi.evaluate.observing import observability
from piazzi.evaluate.window_lengths import windows
from piazzi.evaluate.window_trade import WindowTrade
from piazzi.present.figures import (
    bound_sigmas,
    error_overlay,
    innovations,
    measurements,
    nees_track,
    nis_track,
    orbit,
    path_beside_truth,
    position_at,
    residuals,
    singular_values,
    state_error,
    timing,
    window_consistency,
    window_cost,
    window_trade,
)
from piazzi.present.figures.errors import claim_overlay
from piazzi.present.figures.measured import residuals_of
from piazzi.present.figures.pages import nearest, orbit_page, pages, save
from piazzi.present.figures.space import planes
from piazzi.present.figures.style import COLOURS, MOST_POINTS, colour_of, drawn, line_of
from piazzi.present.stands import stands
from piazzi.scenarios import load_scenario


@pytest.fixture(scope="module")
def comparison() -> Comparison:
    scenario = load_scenario("b612-range")
    tracking = pz.simulate(scenario.problem, scenario.times, np.random.default_rng(0))
    estimators = {"ekf": pz.ExtendedKalmanFilter(), "window:20": pz.SlidingWindow(lag=20)}
    return compare(scenario.problem, tracking, estimators)


@pytest.fixture
def ax():
    return Figure().subplots()


@pytest.fixture
def ekf(comparison):
    return comparison.estimates["ekf"]


def whole(ax, patch) -> bool:
    """Whether the patch is within the limits of its axes."""
    box = patch.get_path().transformed(patch.get_patch_transform()).get_extents()
    (left, right), (bottom, top) = ax.get_xlim(), ax.get_ylim()
    return left <= box.x0 and box.x1 <= right and bottom <= box.y0 and box.y1 <= top


def test_orbit_shows_planet_path_truth_and_whole_ellipses(ax, ekf):
    assert orbit(ax, ekf, name="ekf", planet_radius=10.0) is ax
    (planet,) = [p for p in ax.patches if isinstance(p, Circle)]
    assert planet.radius == 10
    ellipses = [p for p in ax.patches if isinstance(p, Ellipse) and not isinstance(p, Circle)]
    assert len(ellipses) == 9
    assert all(whole(ax, p) for p in (planet, *ellipses))
    lines = {line.get_label(): line for line in ax.lines}
    assert [*lines][:2] == ["ekf", "truth"]
    assert_allclose(lines["ekf"].get_xydata(), ekf.mean[:, :2])
    assert ax.get_aspect() == 1
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("x [m]", "y [m]")


def test_an_ellipse_is_the_curve_of_three_sigma(ax, ekf):
    orbit(ax, ekf, ellipses=1)
    (patch,) = [p for p in ax.patches if isinstance(p, Ellipse) and not isinstance(p, Circle)]
    curve = patch.get_patch_transform().transform(patch.get_path().vertices[:-1]) - ekf.mean[0, :2]
    distance = np.einsum("ki,ki->k", curve, np.linalg.solve(ekf.covariance[0, :2, :2], curve.T).T)
    on_curve = distance[::3]  # ends of the Bezier pieces
    assert_allclose(on_curve, 9.0, rtol=1e-6)


def test_orbits_are_shown_in_kilometres_when_large(ax, ekf):
    large = replace(ekf, mean=1e6 * ekf.mean, tracking=replace(ekf.tracking, truth=1e6 * ekf.tracking.truth))
    orbit(ax, large)
    assert ax.get_xlabel() == "x [km]"
    assert_allclose(ax.lines[0].get_xdata(), 1e3 * ekf.mean[:, 0])


def test_a_model_without_positions_has_no_orbit(ax, ekf):
    problem = replace(ekf.problem, model=replace(ekf.problem.model, groups={}))
    with pytest.raises(ValueError, match='group "position"'):
        orbit(ax, replace(ekf, problem=problem))


def test_an_orbit_in_space_is_seen_from_three_sides(ax):
    model = pz.Model(
        ["x", "y", "z"],
        {"x": "0", "y": "0", "z": "0"},
        pz.Sensor("place", ["x", "y", "z"]),
        groups={"position": ["x", "y", "z"]},
    )
    problem = pz.Problem(
        model, pz.Gaussian([1.0, 2.0, 3.0], [1.0] * 3), [1e-3] * 3, pz.Station("a", "place", [0.1] * 3), prior_time=0.0
    )
    tracking = pz.simulate(problem, np.arange(4.0), np.random.default_rng(1))
    assert planes(problem) == [(0, 1), (0, 2), (1, 2)]
    comparison = pz.compare(problem, tracking, {"ekf": pz.ExtendedKalmanFilter(), "graph": pz.FactorGraph()})
    figure = orbit_page(comparison)
    assert [a.get_ylabel()[0] for a in figure.axes] == ["y", "z", "z", "y"]
    off = {key: np.mean(np.sum((e.mean[2:] - tracking.truth[2:]) ** 2, axis=1)) for key, e in comparison.views.items()}
    assert nearest(comparison)[0] == min(off, key=off.get)


def test_stations_are_where_they_stand(ax, ekf):
    """At the numbers that the sensor takes off the position; others have no place."""
    orbit(ax, ekf)
    (mark,) = [line for line in ax.lines if line.get_marker() == "^"]
    (station,) = ekf.problem.stations
    assert mark.get_xydata().tolist() == [[station.numbers["mx"], station.numbers["my"]]]
    assert mark.get_label() == f"station {station.name}"


@pytest.mark.slow
def test_stations_of_the_earth_are_where_they_measured():
    """On its surface, by a turn of a sidereal day."""
    scenario = load_scenario("lageos2-laser")
    tracking = pz.simulate(scenario.problem, scenario.times, np.random.default_rng(0))
    found = stands(scenario.problem, tracking)
    assert list(found) == [s.name for s in scenario.problem.stations]
    index = tracking.stations_of(scenario.problem)
    for s, place in enumerate(found.values()):
        t = np.unique(tracking.row_times[index == s])
        assert len(place) == len(t)
        assert_allclose(np.linalg.norm(place, axis=1), 6.371e6, rtol=3e-3)
        turned = np.unwrap(np.arctan2(place[:, 1], place[:, 0]))[-1] - np.arctan2(place[0, 1], place[0, 0])
        off = np.remainder(turned - 7.2921159e-5 * (t[-1] - t[0]) + np.pi, 2 * np.pi) - np.pi
        assert abs(off) < 4e-3  # the pole is 1.6e-3 rad from that of the GCRF, times the tangent of the latitude, both ways


@pytest.mark.parametrize(
    ("equations", "there"),
    [
        (["hypot(x - a, y - b)"], ["a", "b"]),
        (["atan2(y - b, x - a)", "(x - a)**2 + (y - b)**2"], ["a", "b"]),
        (["hypot(x - b, y - a)"], ["b", "a"]),
        (["hypot(x - a, y - b) + x"], []),
        (["hypot(x - a, y) + b"], []),
    ],
)
def test_a_place_is_what_positions_are_counted_from(equations, there):
    sensor = pz.Sensor("s", {f"c{i}": e for i, e in enumerate(equations)})
    model = pz.Model(["x", "y"], {"x": "0", "y": "0"}, sensor, groups={"position": ["x", "y"]})
    numbers = {"a": 3.0, "b": 4.0}
    station = pz.Station("here", "s", [1.0] * len(equations), numbers)
    problem = pz.Problem(model, pz.Gaussian([9.0, 9.0], [1.0] * 2), [1e-3] * 2, station, prior_time=0.0)
    found = stands(problem, pz.Tracking([0.0], np.ones((1, len(equations)))))
    assert [place.tolist() for place in found.values()] == ([[[numbers[n] for n in there]]] if there else [])


def test_a_path_is_not_drawn_where_nothing_was_measured_for_long(ax, ekf):
    """A chord through the planet would be no path."""
    times = ekf.tracking.times.copy()
    times[50:] += 1000.0
    late = replace(ekf, tracking=pz.Tracking(times, ekf.tracking.values, truth=ekf.tracking.truth))
    orbit(ax, late, name="ekf")
    for label in ("ekf", "truth"):
        (line,) = [line for line in ax.lines if line.get_label() == label]
        assert np.flatnonzero(np.isnan(line.get_xdata())).tolist() == [50]


def test_what_is_behind_the_planet_is_dotted(ax):
    model = pz.Model(
        ["x", "y", "z"], {"x": "0", "y": "0", "z": "0"}, pz.Sensor("p", ["x", "y", "z"]), groups={"position": ["x", "y", "z"]}
    )
    problem = pz.Problem(model, pz.Gaussian([0.0] * 3, [1.0] * 3), [1e-3] * 3, pz.Station("a", "p", [1.0] * 3), prior_time=0.0)
    turn = np.linspace(0.0, 2 * np.pi, 40, endpoint=False)
    path = 2.0 * np.column_stack([0 * turn, np.cos(turn), np.sin(turn)])
    estimate = pz.ExtendedKalmanFilter().estimate(problem, pz.Tracking(turn, path))
    estimate = replace(estimate, mean=path)
    for plane, depth in (((0, 1), path[:, 2]), ((0, 2), -path[:, 1]), ((1, 2), path[:, 0])):
        ax.clear()
        orbit(ax, estimate, name="ekf", planet_radius=1.0, plane=plane)
        dotted = [line for line in ax.lines if line.get_linestyle() == ":"]
        hidden = (np.hypot(*path[:, list(plane)].T) < 1.0) & (depth < 0)
        assert sum(np.isfinite(line.get_xdata()).sum() for line in dotted) == hidden.sum()


def test_last_positions_are_relative_to_the_truth(ax, comparison, ekf):
    position_at(ax, comparison.views)
    dot = next(line for line in ax.lines if line.get_marker() == "o")
    assert_allclose(dot.get_xydata()[0], ekf.mean[-1, :2] - ekf.tracking.truth[-1, :2])
    assert len(ax.patches) == 3  # the filter, and both views of the window


def test_errors_lie_in_a_band_of_three_sigma(ax, ekf):
    state_error(ax, ekf, "vx", name="ekf")
    (error,) = [line for line in ax.lines if line.get_label() == "error"]
    assert_allclose(error.get_ydata(), ekf.mean[:, 2] - ekf.tracking.truth[:, 2])
    upper = max(ax.lines, key=lambda line: np.max(line.get_ydata()))
    assert_allclose(upper.get_ydata(), 3 * np.sqrt(ekf.covariance[:, 2, 2]))
    low, high = ax.get_ylim()
    assert high == -low > np.abs(error.get_ydata()).max()
    assert ax.get_ylabel() == "error of vx [m/s]"


def test_without_truth_there_is_a_band_and_no_error(ax, ekf):
    state_error(ax, replace(ekf, tracking=replace(ekf.tracking, truth=None)), "x")
    assert "error" not in [line.get_label() for line in ax.lines]
    assert ax.collections


def test_bands_that_shrink_a_lot_are_drawn_on_a_logarithmic_scale(ax, ekf):
    shrink = np.geomspace(1e6, 1, len(ekf.mean))[:, None, None]
    state_error(ax, replace(ekf, covariance=ekf.covariance * shrink), "x")
    assert ax.get_yscale() == "symlog"
    assert len(ax.get_yticks()) <= 9


def test_an_unknown_state_or_group_is_refused(ax, ekf, comparison):
    with pytest.raises(ValueError, match="unknown state 'z'; known: x, y, vx, vy"):
        state_error(ax, ekf, "z")
    with pytest.raises(ValueError, match="unknown group 'clock'; known: position, velocity"):
        error_overlay(ax, comparison, "clock")


def test_overlay_has_a_line_for_each_view(ax, comparison, ekf):
    error_overlay(ax, comparison, "position")
    assert [line.get_label() for line in ax.lines] == ["ekf", "window:20, real time", "window:20, delayed"]
    length = np.linalg.norm((ekf.mean - ekf.tracking.truth)[:, :2], axis=1)
    assert_allclose(ax.lines[0].get_ydata(), length)
    assert ax.get_yscale() == "log"


def test_claims_are_the_root_of_the_summed_variances(ax, comparison, ekf):
    claim_overlay(ax, comparison, "velocity")
    assert_allclose(ax.lines[0].get_ydata(), np.sqrt(ekf.covariance[:, 2, 2] + ekf.covariance[:, 3, 3]))


def test_measurements_are_drawn_in_degrees_and_hours_where_that_suits(ax):
    scenario = load_scenario("satellite-bearing")
    bearing = np.linspace(-3, 3, 1441)
    measurements(ax, scenario.problem, pz.Tracking(scenario.times, bearing))
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("time [h]", "bearing [deg]")
    assert_allclose(ax.lines[0].get_ydata(), np.degrees(bearing))
    assert_allclose(ax.lines[0].get_xdata()[-1], 6.0)


def test_innovations_stay_in_sight(ax, ekf):
    wild = ekf.innovations.copy()
    wild[5] = 1e6
    innovations(ax, replace(ekf, innovations=wild), name="ekf")
    assert ax.get_ylim()[1] < 10
    (above,) = [line for line in ax.lines if line.get_marker() == "^"]
    assert len(above.get_xdata()) == 1
    assert above.get_ydata()[0] < ax.get_ylim()[1]


def test_missing_measurements_are_left_out(ax, ekf):
    values = ekf.tracking.values.copy()
    values[::2] = np.nan
    measurements(ax, ekf.problem, replace(ekf.tracking, values=values))
    assert len(ax.lines[0].get_xdata()) == 50


def test_nees_is_drawn_over_its_range(ax, comparison, ekf):
    nees_track(ax, comparison)
    e = ekf.mean[-1] - ekf.tracking.truth[-1]
    shown = next(line for line in ax.lines if line.get_label() == "ekf").get_ydata()
    assert_allclose(shown[-1], e @ np.linalg.solve(ekf.covariance[-1], e))
    (band,) = ax.patches
    assert_allclose(
        band.get_extents().transformed(ax.transData.inverted()).intervaly, [0.4844, 11.143], rtol=1e-3
    )  # chi-square of 4
    assert ax.get_ylabel() == "NEES (ideal 4)"


def test_nees_needs_the_truth(ax, comparison):
    bare = compare(comparison.problem, replace(comparison.tracking, truth=None), {"ekf": pz.ExtendedKalmanFilter()})
    with pytest.raises(ValueError, match="needs the truth"):
        nees_track(ax, bare)


def test_nis_is_drawn_as_running_means(ax, comparison, ekf):
    nis_track(ax, comparison)
    nis = (ekf.innovations[:, 0] ** 2 / ekf.innovation_covariances[:, 0, 0])[:3].mean()  # three rows: a thirtieth of the run
    assert_allclose(ax.lines[1].get_ydata()[1], nis)
    assert ax.get_ylabel() == "mean NIS of 3 rows (ideal 1)"


def test_residuals_are_taken_at_the_estimate(ax, ekf):
    residuals(ax, ekf, name="ekf")
    x, y = ekf.mean[:, 0], ekf.mean[:, 1]
    assert_allclose(ax.lines[0].get_ydata(), ekf.tracking.values[:, 0] - np.hypot(x - 10, y), atol=1e-12)
    assert ax.get_ylabel() == "residual of range [m]"


def test_residuals_of_angles_wrap():
    scenario = load_scenario("satellite-bearing")
    tracking = pz.simulate(scenario.problem, scenario.times[:50], np.random.default_rng(0))
    estimate = pz.ExtendedKalmanFilter().estimate(scenario.problem, tracking)
    turned = replace(tracking, values=tracking.values + 2 * np.pi)
    left, sigma = residuals_of(replace(estimate, tracking=turned))
    assert_allclose(left, residuals_of(estimate)[0], atol=1e-12)
    assert np.abs(left).max() < 4 * sigma.max() == pytest.approx(4 * np.radians(0.2))


def test_a_path_beside_the_truth(ax, ekf):
    path_beside_truth(ax, ekf.mean[:, :2], ekf.tracking.truth[:, :2], name="ekf")
    assert_allclose(ax.lines[1].get_xydata(), ekf.tracking.truth[:, :2])
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("x [m]", "y [m]")


# ---- windows and observability -------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def trade(comparison) -> WindowTrade:
    return windows(comparison.problem, comparison.tracking, (1, 5, 20))


def test_window_trades_are_drawn_beside_the_graph(ax, trade):
    window_trade(ax, trade, "position")
    assert_allclose(ax.lines[0].get_xydata(), np.stack([[1, 5, 20], trade.rmse("position")], axis=1))
    assert_allclose(ax.lines[1].get_ydata(), trade.rmse("position", "delayed"))
    assert_allclose(ax.lines[2].get_ydata(), trade.graph.rmse_last_half["position"])
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("window length [states]", "position RMSE, last half [m]")


def test_consistency_and_cost_of_windows(trade):
    nees_ax, cost_ax, time_ax = Figure().subplots(1, 3)
    window_consistency(nees_ax, trade)
    assert nees_ax.lines[-1].get_ydata()[0] == 4
    window_cost(cost_ax, trade)
    assert_allclose(cost_ax.lines[0].get_ydata(), trade.microseconds_per_step)
    assert cost_ax.get_ylabel() == "time per step [us]"
    timing(time_ax, np.array([10, 100, 1000]), np.array([1e-3, np.nan, 2.0]))
    assert (time_ax.get_xlabel(), time_ax.get_ylabel()) == ("length of the run [epochs]", "time [s]")


def test_windows_without_truth_have_no_errors_to_draw(ax, comparison):
    bare = windows(comparison.problem, replace(comparison.tracking, truth=None), (1, 5), graph=False)
    with pytest.raises(ValueError, match="without truth"):
        window_trade(ax, bare, "position")


def test_information_grows(comparison):
    found = observability(comparison.problem, comparison.tracking, twins=False)
    left, right = Figure().subplots(1, 2)
    singular_values(left, found)
    assert [line.get_label() for line in left.lines] == ["best seen", "direction 2", "direction 3", "worst seen", "prior"]
    assert_allclose(left.lines[0].get_ydata()[-1], found.singular_values[0])
    bound_sigmas(right, found)
    assert_allclose(right.lines[2].get_ydata()[-1], found.crlb_sigma[2] / found.scale[2])
    assert left.get_xlabel() == right.get_xlabel() == "time [s]"


# ---- style ---------------------------------------------------------------------------------------------------------------


def test_an_estimator_has_one_colour_whatever_its_options():
    assert colour_of("window:10") == colour_of("window:100x3") == COLOURS["window"]
    assert len(set(COLOURS.values())) == len(COLOURS)
    assert line_of("ekf", "realtime")["color"] == line_of("ekf", "realtime", ("graph", "ekf"))["color"]
    assert line_of("window:10", "realtime", ("window:5", "window:10")) != line_of(
        "window:5", "realtime", ("window:5", "window:10")
    )
    assert line_of("window:5", "delayed") != line_of("window:5", "realtime")


def luminance(colour: str) -> float:
    """Relative luminance of WCAG 2."""
    channels = [int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5)]
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in channels]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def test_colours_stand_out_from_white_paper():
    assert all(1.05 / (luminance(c) + 0.05) > 2.0 for c in COLOURS.values())


@pytest.mark.parametrize("count", [1, 100, MOST_POINTS, MOST_POINTS + 1, 10**6])
def test_no_picture_draws_more_points_than_it_can_show(count):
    shown = len(range(count)[drawn(count)])
    assert min(count, MOST_POINTS // 2) <= shown <= MOST_POINTS


# ---- pages ---------------------------------------------------------------------------------------------------------------


def test_pages_are_saved_whole(comparison, tmp_path):
    for name, figure in pages(comparison, title="Costs $5 and more", planet_radius=10.0):
        assert save(figure, tmp_path / f"{name}.png").stat().st_size > 10_000
    assert sorted(p.name for p in tmp_path.iterdir()) == [
        f"{name}.png" for name in ("comparison", "consistency", "errors", "measurements", "orbit")
    ]


@pytest.mark.parametrize("kind", ["png", "pdf", "svg"])
def test_a_picture_has_the_same_bytes_each_time(ekf, tmp_path, kind):
    for name in ("one", "two"):
        figure = Figure()
        state_error(figure.subplots(), ekf, "x", name="ekf")
        save(figure, tmp_path / f"{name}.{kind}")
    assert (tmp_path / f"one.{kind}").read_bytes() == (tmp_path / f"two.{kind}").read_bytes()


def test_pages_need_no_truth(comparison, tmp_path):
    tracking = replace(comparison.tracking, truth=None)
    bare = compare(comparison.problem, tracking, {"ekf": pz.ExtendedKalmanFilter()})
    for name, figure in pages(bare):
        save(figure, tmp_path / f"{name}.png")
    assert len(list(tmp_path.iterdir())) == 5


def test_one_epoch_makes_pictures(comparison, tmp_path):
    tracking = pz.Tracking([0.0], [1.0])
    short = compare(comparison.problem, tracking, {"ekf": pz.ExtendedKalmanFilter()})
    for name, figure in pages(short, planet_radius=10.0):
        save(figure, tmp_path / f"{name}.png")


def test_estimates_that_are_not_finite_make_pictures(comparison, ekf, tmp_path):
    mean, covariance = ekf.mean.copy(), ekf.covariance.copy()
    mean[50:], covariance[50:] = np.nan, np.inf
    lost = replace(ekf, mean=mean, covariance=covariance)
    for name, figure in pages(replace(comparison, estimates={"ekf": lost})):
        save(figure, tmp_path / f"{name}.png")


def test_a_picture_ends_in_a_known_format(comparison, tmp_path):
    with pytest.raises(ValueError, match=r"\.png, \.pdf, \.svg, not '\.gif'"):
        save(Figure(), tmp_path / "x.gif")
    assert not list(tmp_path.iterdir())
