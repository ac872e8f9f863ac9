"""Who sees what, when: nothing is measured where a rule or a schedule says no, everything else is, with the same noise."""

import dataclasses

import numpy as np
import pytest
from numpy.testing import assert_array_equal

import piazzi as pz
from piazzi.kernels import KernelSpec
from piazzi.scenarios import ScenarioError, load_scenario
from piazzi.scenarios.write import problem_from_tables, problem_to_tables
from piazzi.simulation.visibility import seen
from piazzi.study.runs import simulated
from piazzi.study.tasks import Task
from tests.references.drawn import same_tracking

RATE = 2 * np.pi / 600.0  # a body on a circle of 7000 km about the origin, once in ten minutes; stations on one of 6378 km
R, EARTH = 7000e3, 6378e3
MASK = np.radians(10)
VISIBLE = ["elevation - mask"]
ELEVATION = {
    "east": "x - px",
    "north": "y - py",
    "up": "(east*px + north*py)/hypot(px, py)",
    "elevation": "asin(up/hypot(east, north))",
}


def problem(visible=VISIBLE, schedules=(None, None), masks=(MASK, MASK), **changes):
    numbers = ["px", "py"] + (["mask"] if visible else [])
    definitions = ELEVATION if visible else {k: ELEVATION[k] for k in ("east", "north")}
    radar = pz.Sensor("radar", {"rng": "hypot(east, north)"}, definitions=definitions, visible=visible)
    model = pz.Model(["x", "y"], [f"-{RATE!r}*y", f"{RATE!r}*x"], [radar], groups={"position": ["x", "y"]})
    places = [{"px": EARTH, "py": 0.0, "mask": masks[0]}, {"px": 0.0, "py": EARTH, "mask": masks[1]}]
    stations = [
        pz.Station(name, "radar", 100.0, {k: place[k] for k in numbers}, schedule=schedule)
        for name, place, schedule in zip(("a", "b"), places, schedules, strict=True)
    ]
    prior = pz.Gaussian.from_sigma([R, 0.0], [1e3, 1e3])
    steps = {"integrator": pz.ConstantAcceleration(max_step=0.5)}  # in gaps too
    return pz.Problem(model, prior, None, stations, prior_time=0.0, **steps | changes)


TIMES = np.arange(0.0, 1200.0, 5.0)


def elevation(states, place):
    """Angle of a sight above the horizon, by the textbook."""
    sight = states - place
    return np.arcsin(sight @ place / np.linalg.norm(place) / np.linalg.norm(sight, axis=1))


def simulate(given, seed=0, times=TIMES):
    return pz.simulate(given, times, np.random.default_rng(seed))


def rows(tracking):
    return {(t, s): z for t, s, z in zip(tracking.row_times, tracking.row_stations, tracking.values[:, 0], strict=True)}


def test_measured_is_what_is_above_the_mask_and_nothing_else():
    whole = simulate(problem(visible=()))
    wanted = set()
    for name, place in (("a", [EARTH, 0.0]), ("b", [0.0, EARTH])):
        above = elevation(whole.truth, np.array(place)) > MASK
        assert 0 < above.sum() < len(TIMES) / 3
        wanted |= {(t, name) for t in TIMES[above]}
    assert rows(simulate(problem())).keys() == wanted


def test_the_noise_of_a_row_is_the_same_whoever_else_sees_something():
    whole, part, other = (rows(simulate(p)) for p in (problem(visible=()), problem(), problem(masks=(MASK, 1.0))))
    assert other.keys() < part.keys() < whole.keys()
    for found in (part, other):
        assert all(z == whole[key] for key, z in found.items())


def test_rows_keep_their_truth_and_the_prior_its_time():
    part, whole = simulate(problem()), simulate(problem(visible=()))
    at = np.searchsorted(whole.times, part.times)
    assert_array_equal(part.truth, whole.truth[at])
    free = dataclasses.replace(problem(), prior_time=None, prior=pz.Gaussian.from_sigma([0.7 * R, -0.7 * R], [1e3, 1e3]))
    found = simulate(free, times=TIMES + 100.0)  # nobody sees anything at the beginning
    assert found.times[0] == 100.0
    assert np.isnan(found.values[0]).all()


def test_rules_are_all_above_zero_and_where_one_has_no_value_nothing_is_seen():
    day = problem(visible=["elevation - mask", "sin(t*0.01)"])
    for t, _ in rows(simulate(day)):
        assert np.sin(t * 0.01) > 0
    with pytest.raises(
        ValueError, match=r"no station sees anything at these 240 times: a: elevation - mask \+ log\(-1 - t\) > 0"
    ):
        simulate(problem(visible=["elevation - mask + log(-1 - t)"]))


@pytest.mark.parametrize(
    ("schedule", "wanted"),
    [
        (pz.Schedule(every=20.0), TIMES[::4]),
        (pz.Schedule(every=15.0, start=5.0), TIMES[1::3]),
        (pz.Schedule(start=100.0, until=200.0), TIMES[20:41]),
        (pz.Schedule(), TIMES),
    ],
)
def test_a_schedule_says_when(schedule, wanted):
    given = problem(visible=(), schedules=(schedule, pz.Schedule(until=0.0)))
    assert_array_equal([t for t, s in rows(simulate(given)) if s == "a"], wanted)


def test_a_schedule_forgives_rounding_only():
    times = np.arange(10**5) * 0.1
    assert pz.Schedule(every=0.3).has(times).sum() == len(times[::3])
    assert not pz.Schedule(every=1.0).has(np.array([1.0 + 1e-7]))[0]
    assert pz.Schedule(until=0.3).has(np.array([0.1 + 0.2]))[0]


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({"every": 0.0}, "every is 0 s; it must be positive"),
        ({"start": np.nan}, "start is nan; it must be finite"),
        ({"start": 2.0, "until": 1.0}, "until is 1 s, before the start at 2 s"),
    ],
)
def test_a_schedule_that_cannot_be_is_refused(keys, message):
    with pytest.raises(ValueError, match=message):
        pz.Schedule(**keys)


def test_a_study_sees_what_a_simulation_sees():
    given = problem()
    study = pz.Study(given, TIMES, ["ekf"], runs=3)
    runs = simulated(study, Task(0, 0, 3))
    for i in range(3):
        for s, place in enumerate(([EARTH, 0.0], [0.0, EARTH])):
            above = elevation(runs.truth[i], np.array(place)) > MASK
            assert_array_equal(~np.isnan(runs.z[i].reshape(len(TIMES), 2)[:, s]), above)
    everything = simulated(pz.Study(problem(visible=()), TIMES, ["ekf"], runs=3), Task(0, 0, 3))
    seen = ~np.isnan(runs.z)
    assert_array_equal(runs.z[seen], everything.z[seen])


def test_a_study_of_passes_is_scored_and_bounded_by_what_was_seen(tmp_path):
    found = pz.Study(problem(), TIMES, ["ekf"], runs=4).run(tmp_path / "s.nc", workers=0).summary
    everything = pz.Study(problem(visible=()), TIMES, ["ekf"], runs=4).run(tmp_path / "t.nc", workers=0).summary
    (line,), (free,) = found.lines, everything.lines
    assert line.failed == 0
    bound, all_seen = (one.rmse_last_half["position"] / one.over_bound["position"] for one in (line, free))
    assert bound > all_seen


def test_a_run_without_any_measurement_says_so():
    study = pz.Study(problem(masks=(1.6, 1.6)), TIMES, ["ekf"], runs=1)
    assert simulated(study, Task(0, 0, 1)).wrong == ["no station sees anything"]


def test_an_added_station_counts_where_it_sees():
    given = problem()
    tracking = simulate(given)
    blind = dataclasses.replace(given.stations[1], name="blind", numbers={**given.stations[1].numbers, "mask": 1.6})
    seeing = dataclasses.replace(blind, name="seeing", numbers=given.stations[1].numbers)
    found = [pz.observability(given, tracking, add=[s], twins=False) for s in (blind, seeing)]
    assert_array_equal(found[0].added.information.singular_values, found[0].information.singular_values)
    assert (found[1].added.information.singular_values > found[0].information.singular_values).any()


def test_the_truth_may_have_another_mask():
    one = problem()
    lower = pz.Model(
        one.model.states,
        one.model.dynamics,
        [pz.Sensor("radar", {"rng": "hypot(east, north)"}, definitions=ELEVATION, visible=["elevation - low"])],
        ["low"],
    )
    stations = [pz.Station(s.name, "radar", 100.0, {k: s.numbers[k] for k in ("px", "py")}) for s in one.stations]
    truth = pz.Truth(parameters={"low": MASK})
    given = pz.Problem(lower, one.prior, None, stations, {"low": 1.6}, one.integrator, prior_time=0.0, truth=truth)
    assert rows(simulate(given)).keys() == rows(simulate(one)).keys()


def test_estimated_numbers_of_a_station_may_stand_in_a_rule():
    given = problem()
    uncertain = dict(given.stations[0].numbers) | {"px": pz.Gaussian([EARTH], [1.0])}
    moved = dataclasses.replace(given, stations=[dataclasses.replace(given.stations[0], numbers=uncertain), given.stations[1]])
    assert moved.model.sensor(moved.stations[0].sensor).visible == tuple(VISIBLE)
    assert {s for _, s in rows(simulate(moved))} == {"a", "b"}


def test_a_rule_builds_no_kernel():
    one, other = problem(), problem(visible=["elevation - 2*mask"])
    specs = [p.spec("transition", "simulate") for p in (one, other)]
    assert isinstance(specs[0], KernelSpec)
    assert specs[0].digest() == specs[1].digest()
    assert problem(visible=()).spec("transition", "simulate").digest() != specs[0].digest()  # it has a number less


def test_passes_are_rows_without_a_long_gap():
    given = problem()
    tracking = simulate(given)
    found = pz.passes(given, tracking)
    assert [p.station for p in found] == ["a", "b", "a", "b", "a"]  # it begins and ends above the first
    assert sum(p.measurements for p in found) == len(tracking.row_times)
    assert found == sorted(found, key=lambda p: p.start)
    for p in found:
        inside = [t for t, s in rows(tracking) if s == p.station and p.start <= t <= p.stop]
        assert len(inside) == p.measurements == round((p.stop - p.start) / 5.0) + 1
    assert [p.station for p in pz.passes(given, tracking, gap=3600.0)] == ["a", "b"]
    with pytest.raises(ValueError, match="gap is 0; it must be positive"):
        pz.passes(given, tracking, gap=0)


SCENARIO = """\
states = { x = "m", y = "m" }
{head}
[parameters]
w = 0.010471975511965976
limit = "2 km"
[dynamics]
x = "-w*y"
y = "w*x"
[sensors.radar]
numbers = {{ px = "m", mask = "10 deg" }}
visible = {visible}
{schedule}
[sensors.radar.definitions]
up = "x - px"
elevation = "atan2(up, abs(y))"
[sensors.radar.components]
rng = {{ equation = "hypot(x - px, y)", unit = "m" }}
[[stations]]
name = "a"
noise = {{ sigma = 10.0 }}
numbers = {{ px = 6378e3 }}
[[stations]]
name = "b"
noise = {{ sigma = 10.0 }}
numbers = {{ px = -6378e3, mask = 5.0 }}
{station}
[prior]
mean = [7000e3, 0.0]
sigma = [1e3, 1e3]
[times]
step = 10.0
count = 121
""".replace("{ x", "{{ x").replace('"m" }\n{', '"m" }}\n{')


def scenario(folder, head="", visible='["elevation - mask", "hypot(x - px, y) - limit"]', schedule="", station=""):
    path = folder / "passes.toml"
    path.write_text(SCENARIO.format(head=head, visible=visible, schedule=schedule, station=station))
    return path


def test_a_scenario_says_who_sees_what(tmp_path):
    found = load_scenario(scenario(tmp_path, schedule='every = "20 s"\nuntil = "10 min"', station="from = 100\nevery = 30"))
    a, b = found.problem.stations
    assert (a.numbers["mask"], b.numbers["mask"]) == (np.radians(10), np.radians(5))
    assert found.problem.parameters["limit"] == 2000.0
    assert (a.schedule, b.schedule) == (pz.Schedule(20.0, None, 600.0), pz.Schedule(30.0, 100.0, 600.0))
    assert found.problem.model.sensors[0].visible == ("elevation - mask", "hypot(x - px, y) - limit")


def test_dates_say_when(tmp_path):
    head = 'epoch = "2016-12-31T23:50:00 UTC"'
    found = load_scenario(
        scenario(tmp_path, head, schedule='from = "2016-12-31T23:59:60 UTC"\nuntil = "2017-01-01T00:05:00 UTC"')
    )
    assert found.problem.stations[0].schedule == pz.Schedule(None, 600.0, 901.0)


def test_a_scenario_comes_back(tmp_path):
    given = load_scenario(scenario(tmp_path, schedule="every = 20")).problem
    again = problem_from_tables(problem_to_tables(given), given.name, "")
    assert [s.schedule for s in again.stations] == [s.schedule for s in given.stations]
    assert again.model.sensors[0].visible == given.model.sensors[0].visible
    times = np.arange(121) * 10.0
    assert same_tracking(simulate(again, times=times), simulate(given, times=times))


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({"visible": '["elevatoin - mask"]'}, r"sensors.radar.visible\[0\]: .*unknown name 'elevatoin'"),
        ({"visible": '["elevation > mask"]'}, r"sensors.radar.visible\[0\]"),
        ({"visible": "3"}, "sensors.radar.visible: must be text, or a list"),
        ({"schedule": "every = -1"}, r"sensors.radar: schedule: every is -1 s; it must be positive"),
        ({"schedule": 'every = "10 km"'}, r"sensors.radar.every: is '10 km', which is no time"),
        ({"schedule": "every = 15"}, r"stations\[0\]: measures every 15 s, no multiple of the step of \[times\], 10 s"),
        ({"station": "from = 5000"}, r"stations\[1\]: measures from 5000 s: at none of the 121 times"),
        ({"schedule": 'from = "2016-12-31 UTC"'}, "sensors.radar.from: is '2016-12-31 UTC', but the file has no epoch"),
        ({"schedule": 'from = "soon"', "head": 'epoch = "2016-12-31 UTC"'}, "sensors.radar.from: date 'soon' cannot be read"),
        ({"station": "untill = 3"}, r"stations\[1\].untill: unknown key"),
    ],
)
def test_bad_rules_are_refused_with_their_place(tmp_path, keys, message):
    with pytest.raises(ScenarioError, match=message) as error:
        load_scenario(scenario(tmp_path, **keys))
    assert "\n" not in str(error.value)


def test_passes_are_shown_as_bars(tmp_path):
    import matplotlib.figure

    from piazzi.cli.simulate import to_dict
    from piazzi.present.figures import passes
    from piazzi.present.report import comparison_tab, write_page
    from piazzi.present.tables import summary

    given = problem()
    tracking = simulate(given)
    found = pz.passes(given, tracking)
    ax = passes(matplotlib.figure.Figure().add_subplot(), given, tracking)
    bars = [c.get_paths()[0].get_extents() for c in ax.collections]
    factor = 1 / 60  # minutes
    assert [(round(b.x0 / factor), round(b.x1 / factor)) for b in bars] == [(p.start, p.stop) for p in found]
    assert [label.get_text() for label in ax.get_yticklabels()] == ["a", "b"]
    assert f"{len(tracking.row_times)} measurements by 2 stations in 5 passes" in summary(given, tracking, "")
    assert [p["start"] for p in to_dict(given, tracking, "", 0, None)["passes"]] == [p.start for p in found]
    page = write_page(tmp_path / "a.html", "", [comparison_tab(pz.compare(given, tracking, ["ekf"]))])
    assert '"spans"' in page.read_text()
    whole = simulate(problem(visible=()))
    assert "passes" not in summary(problem(visible=()), whole, "") and "passes" not in to_dict(given, whole, "", 0, None)


def test_a_gap_is_crossed_with_the_steps_of_the_times(tmp_path):
    """An orbit: the estimate after a long gap is that of a run which has every time, most without a value."""
    orbit = """
    states = ["x", "y", "u", "v"]
    [dynamics]
    x = "u"
    y = "v"
    u = "-3.986e14*x/hypot(x, y)**3"
    v = "-3.986e14*y/hypot(x, y)**3"
    [sensors.fix]
    visible = ["x - 6.5e6"]
    [sensors.fix.components]
    px = "x"
    py = "y"
    [[stations]]
    name = "s"
    noise = { sigma = [50.0, 50.0] }
    [prior]
    mean = [7e6, 0.0, 0.0, 7546.0]
    sigma = [100.0, 100.0, 1.0, 1.0]
    [times]
    step = 20
    count = 600
    """
    (tmp_path / "orbit.toml").write_text(orbit)
    given, tracking = pz.load(tmp_path / "orbit.toml", seed=2)
    assert np.diff(tracking.times).max() > 4000.0
    times = np.arange(600) * 20.0
    values = np.full((600, 2), np.nan)
    values[np.searchsorted(times, tracking.times)] = tracking.values
    found = pz.ExtendedKalmanFilter().estimate(given, tracking)
    whole = pz.ExtendedKalmanFilter().estimate(given, pz.Tracking(times, values))
    at = np.searchsorted(times, tracking.times)
    sigma = np.sqrt(np.diagonal(found.covariance, axis1=1, axis2=2))
    assert (np.abs(found.mean - whole.mean[at]) < 1e-3 * sigma).all()
    error = (found.mean - tracking.truth) / sigma
    assert np.sqrt((error**2).mean()) < 3.0


@pytest.mark.parametrize("kind", ["discrete", "noise per step"])
def test_every_epoch_stays_where_what_happens_depends_on_how_many_there_are(kind):
    sensor = pz.Sensor("s", {"z": "x"}, visible=["x"])
    model = pz.Model(["x"], ["-x"], [sensor], discrete=kind == "discrete")
    noise = None if kind == "discrete" else pz.ProcessNoise([4.0], per="step")
    given = pz.Problem(model, pz.Gaussian([1.0], [1e-6]), noise, [pz.Station("s", "s", 1e-6)], prior_time=0.0)
    tracking = simulate(given, times=np.arange(20.0))
    assert_array_equal(tracking.times, np.arange(20.0))
    assert_array_equal(np.isnan(tracking.values[:, 0]), tracking.truth[:, 0] <= 0)
    assert 0 < np.isnan(tracking.values).sum() < 20


# ---- what visibility leaves between -----------------------------------------------------------------------------------


def watched_once_a_turn(integrator):
    """A mask that leaves half a minute of every ten, by one station."""
    p = problem(masks=(np.radians(30), np.radians(89.9)), integrator=integrator)
    return dataclasses.replace(p, truth=pz.Truth(integrator=pz.RungeKutta8(max_step=1.0)))


def test_steps_that_are_too_long_for_a_gap_are_told_with_it_and_with_what_helps():
    with pytest.warns(
        UserWarning, match=r"gap from t = .* has 1 substep, .* 'a' .* sigma; give the integrator max_step=5 in"
    ) as told:
        tracking = simulate(watched_once_a_turn(pz.RungeKutta4(1)))
    assert len(told) == 1 and "\n" not in str(told[0].message)
    k = int(np.argmax(np.diff(tracking.times)))
    for t in tracking.times[k : k + 2]:
        assert f"t = {t:g} s" in str(told[0].message)


@pytest.mark.parametrize("integrator", [pz.RungeKutta4(max_step=5.0), pz.RungeKutta4(300), pz.DormandPrince()])
def test_nothing_is_told_where_steps_suit_the_gap(integrator):
    simulate(watched_once_a_turn(integrator))  # warnings are errors


def test_rules_of_the_time_alone_hold_for_many_runs_at_once():
    """Marks of several truths together are those of each by itself, though one rule is the same for all."""
    given = problem(visible=["elevation - mask", f"sin({RATE!r}*t)"])
    angle = RATE * TIMES + np.array([[0.0], [0.3], [2.0]])
    states = R * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    together = seen(given, TIMES, states)
    assert together.shape == (3, len(TIMES), 2) and together.any() and not together.all()
    for one, marks in zip(states, together, strict=True):
        assert_array_equal(seen(given, TIMES, one), marks)
