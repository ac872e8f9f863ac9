"""A file of tracking with a scenario: its rows instead of the scenario's times and measurements, in every command."""

import numpy as np
import pytest

import piazzi as pz
from piazzi import earth
from piazzi.cli.main import main
from piazzi.determination.recorded import recorded
from piazzi.formats import Arc, Ephemeris
from piazzi.formats.write_odm import oem_text
from piazzi.scenarios import Recording, ScenarioError

GM = earth.gravity_field("EGM2008").gm
EPOCH = pz.Epoch("2016-02-13T16:00:00.25 UTC")
R, V = np.array([7000e3, 100e3, -50e3]), np.array([10.0, 5.0e3, 5.5e3])
T = 60.0 * np.arange(12.0)
SCENARIO = """
[earth]
degree = 0
bodies = []
tides = []
relativity = false
[recording]
sigma = ["2m", "0.1m/s"]
"""


PLAIN = """
states = { x = "m" }
dynamics = { x = "0" }
prior = { mean = [1.0], sigma = [1.0] }
recording = { sigma = ["2m", "0.1m/s"] }
"""


@pytest.fixture(autouse=True)
def _plain(monkeypatch):
    monkeypatch.setenv("PIAZZI_JIT", "0")


def arc(name, shift=0.0):
    r, v = pz.propagate_kepler(R, V, GM, T)
    return Arc(epoch=EPOCH, t=T, position=r + shift, velocity=v, centre="EARTH", frame="GCRF", scale="UTC", name=name)


@pytest.fixture
def files(tmp_path):
    """Positions of two bodies, and a scenario with nothing but forces."""
    (tmp_path / "one.oem").write_text(oem_text(Ephemeris(arcs=(arc("A"),))))
    (tmp_path / "two.oem").write_text(oem_text(Ephemeris(arcs=(arc("A"), arc("B", 1e3)))))
    (tmp_path / "s.toml").write_text(SCENARIO)
    return tmp_path


def orbit(problem, tracking):
    """The first state that batch least squares finds, and the true one."""
    estimate = pz.BatchLeastSquares().estimate(problem, tracking)
    assert estimate.success
    return estimate.mean[0, :6], np.concatenate(pz.propagate_kepler(R, V, GM, 0.0))


def test_a_file_of_positions_gives_times_measurements_and_start(files):
    problem, tracking = recorded(files / "one.oem", files / "s.toml", Recording())
    assert len(tracking.times) == 12
    assert problem.prior_time == tracking.times[0]
    assert problem.epoch + float(tracking.times[0]) - EPOCH == pytest.approx(0.0, abs=1e-9)
    assert problem.stations[0].noise[0, 0] == 4.0
    np.testing.assert_allclose(problem.prior.mean[:3], R, atol=1e-3)
    np.testing.assert_allclose(problem.prior.mean[3:], V, atol=0.1)
    found, true = orbit(problem, tracking)
    np.testing.assert_allclose(found[:3], true[:3], atol=0.01)


def test_prior_epoch_and_forces_are_those_of_the_scenario(files):
    text = 'units = "km"\nepoch = "2016-02-13T15:59:00.25 UTC"\n' + SCENARIO
    r, v = pz.propagate_kepler(R, V, GM, -60.0)
    text += (
        f"[prior]\nmean = {[*(r / 1e3).tolist(), *(v / 1e3).tolist()]}\nsigma = [1.0, 1.0, 1.0, 0.1, 0.1, 0.1]\ntime = 0.0\n"
    )
    (files / "s.toml").write_text(text)
    problem, tracking = recorded(files / "one.oem", files / "s.toml", Recording())
    assert problem.epoch == EPOCH + -60.0
    assert problem.prior_time == 0.0
    np.testing.assert_allclose(tracking.times, 60.0 + T)
    np.testing.assert_allclose(problem.prior.mean, [*r, *v], rtol=1e-14)
    found, true = orbit(problem, tracking)
    np.testing.assert_allclose(found[:3], true[:3], atol=0.01)


def test_the_object_is_chosen_on_the_command_line_or_in_the_scenario(files):
    with pytest.raises(ValueError, match="2 objects, A, B: say which with --object"):
        recorded(files / "two.oem", files / "s.toml", Recording())
    problem, tracking = recorded(files / "two.oem", files / "s.toml", Recording(chosen="B", sigma=("5m", "1m/s")))
    np.testing.assert_allclose(tracking.values[0, :3], R + 1e3, rtol=1e-12)
    assert problem.stations[0].noise[0, 0] == 25.0
    (files / "s.toml").write_text(SCENARIO + 'object = "B"\n')
    assert recorded(files / "two.oem", files / "s.toml", Recording())[1].values[0, 0] == tracking.values[0, 0]


def test_sigmas_of_a_prior_are_kept_where_the_file_gives_the_start(files):
    (files / "s.toml").write_text(SCENARIO + "[prior]\nsigma = [1.0, 2.0, 3.0, 0.1, 0.2, 0.3]\n")
    problem, _ = recorded(files / "one.oem", files / "s.toml", Recording())
    np.testing.assert_allclose(np.sqrt(np.diag(problem.prior.covariance)), [1.0, 2.0, 3.0, 0.1, 0.2, 0.3])


def test_commands_take_it(files, capsys):
    assert main(["compare", str(files / "one.oem"), "--scenario", str(files / "s.toml"), "--with", "batch"]) == 0
    assert "12 measurements by fixes" in capsys.readouterr().out
    assert (
        main(["estimate", str(files / "two.oem"), "--scenario", str(files / "s.toml"), "--object", "A", "--with", "batch"]) == 0
    )
    assert "Left over (RMS)" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("scenario", "message"),
    [
        (SCENARIO.replace("degree = 0", "degre = 0"), "earth.degre: unknown key"),
        (SCENARIO + "[prior]\nmean = [1.0]\nsigma = 1.0\n", "prior.mean: has 1 value; it needs 6"),
        (PLAIN, "files of tracking measure orbits"),
        (SCENARIO.replace("2m", "2parsec"), "parsec"),
        (SCENARIO + 'epoch = "1990-01-01 UTC"\n', "recording.epoch: unknown key"),
        ('epoch = "1990-01-01 UTC"\n' + SCENARIO, "from the epoch"),
    ],
)
def test_scenarios_that_do_not_fit_are_refused(files, scenario, message):
    (files / "s.toml").write_text(scenario)
    with pytest.raises((ScenarioError, ValueError), match=message):
        recorded(files / "one.oem", files / "s.toml", Recording())


def test_files_that_are_no_tracking_are_refused_in_one_line(files, capsys):
    (files / "page.txt").write_text("hello\n")
    assert main(["compare", str(files / "page.txt"), "--scenario", str(files / "s.toml")]) == 2
    assert main(["compare", str(files / "none.sp3"), "--scenario", str(files / "s.toml")]) == 2
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 2
    assert "No such file" in lines[1]


def test_a_table_of_fixes_is_tracking_for_a_scenario_without_stations(files):
    found, _ = recorded(files / "one.oem", files / "s.toml", Recording(sigma=("2m", "0.1m/s")))[:2]
    r, _ = pz.propagate_kepler(R, V, GM, T)
    week = (EPOCH - pz.Epoch("1980-01-06T00:00:00 GPS") + T) / 604800.0
    rows = [
        f"{np.floor(w):.0f},{604800.0 * (w - np.floor(w)):.9f},{x},{y},{z}"
        for w, (x, y, z) in zip(week, (r / 1e3).tolist(), strict=True)
    ]
    (files / "a.csv").write_text("\n".join(["gps_week,gps_tow,X,Y,Z", *rows]) + "\n")
    said = Recording(
        columns={"week": "gps_week", "sow": "gps_tow", "x": "X[km]", "y": "Y[km]", "z": "Z[km]"}, frame="GCRF", sigma=("2m",)
    )
    problem, tracking = recorded(files / "a.csv", files / "s.toml", said)
    given, true = orbit(problem, tracking)
    np.testing.assert_allclose(given[:3], true[:3], atol=1e-2)
    np.testing.assert_allclose(given[3:], true[3:], atol=1e-4)
    assert problem.epoch - found.epoch == pytest.approx(0.0, abs=1.0)
    columns = "week=gps_week sow=gps_tow x=X[km] y=Y[km] z=Z[km]"
    words = ["--scenario", f"{files}/s.toml", "--columns", columns, "--frame", "GCRF", "--sigma", "2m", "--with", "batch"]
    assert main(["compare", f"{files}/a.csv", *words]) == 0


def test_a_prior_that_is_later_than_the_file_begins_is_propagated_back(files):
    r, v = pz.propagate_kepler(R, V, GM, T[6])
    prior = f"[prior]\nmean = {[*r.tolist(), *v.tolist()]}\nsigma = [1.0, 1.0, 1.0, 0.1, 0.1, 0.1]\ntime = {T[6]}\n"
    (files / "s.toml").write_text(f'epoch = "{EPOCH.to("UTC")}"\n' + SCENARIO + prior)
    problem, tracking = recorded(files / "one.oem", files / "s.toml", Recording())
    assert problem.prior_time == tracking.times[0] == pytest.approx(0.0, abs=1e-9)
    np.testing.assert_allclose(problem.prior.mean, np.concatenate(pz.propagate_kepler(R, V, GM, 0.0)), rtol=1e-8)


def test_stations_turn_with_the_epoch_of_the_scenario(files, data_dir):
    """Where a station stands is a table of the time past the epoch: the same measurements whatever that is."""
    start = pz.Epoch("2016-02-11T00:00:00 UTC")
    prior = f"[prior]\ntime = 0.0\nmean = {[*R.tolist(), *V.tolist()]}\nsigma = {[1.0] * 6}\n"
    found = []
    for epoch in ("", f'epoch = "{start}"\n'):
        (files / "s.toml").write_text(epoch + SCENARIO + prior)
        found.append(recorded(data_dir / "earth/lageos2/lageos2_20160214.npt", files / "s.toml", Recording(stations=("ilrs",))))
    (own, rows), (other, same) = found
    assert other.epoch == start and 48575.0 < own.epoch - start < 48577.0  # 13:29:36.7
    np.testing.assert_allclose(same.times - rows.times, own.epoch - start, atol=1e-9)
    assert other.prior_time == 0.0
    for a, b in zip(own.stations, other.stations, strict=True):
        x, y = (np.asarray(s.place.station.place(own.epoch)) for s in (a, b))
        assert a.place.epoch == own.epoch and b.place.epoch == start and (x == y).all()


@pytest.mark.parametrize("there", ["a word", "the scenario"])
def test_what_a_file_leaves_open_is_said_as_a_word_or_in_the_scenario(files, there):
    """Columns of a radar whose ranges are there and back, corrected already."""
    rows = "\n".join(f"2016-02-13T16:0{i}:00Z,D,{2 * (1e6 + 1e4 * i)}" for i in range(4))
    (files / "pass.csv").write_text(f"time,station,range [m]\n{rows}\n")
    (files / "d.toml").write_text('[[stations]]\nname = "D"\nlatitude = "50 deg"\nlongitude = "8 deg"\nheight = "100 m"\n')
    prior = f"[prior]\ntime = 0.0\nmean = {[*R.tolist(), *V.tolist()]}\nsigma = {[1.0] * 6}\n"
    said = {"range": "round-trip", "tag": "receive", "corrections": "applied"}
    told = "".join(f'{name} = "{word}"\n' for name, word in said.items()) if there == "the scenario" else ""
    scenario = SCENARIO.replace('["2m", "0.1m/s"]', '["2m"]') + told + prior
    (files / "s.toml").write_text(scenario)
    words = {} if told else said
    problem, tracking = pz.load(files / "pass.csv", scenario=files / "s.toml", stations=files / "d.toml", **words)
    np.testing.assert_allclose(tracking.values[:, 0], 1e6 + 1e4 * np.arange(4.0))
    assert [s.name for s in problem.model.sensors] == ["range_two_way_reception"]
    with pytest.raises(ValueError, match="--range"):
        (files / "s.toml").write_text(scenario.replace('range = "round-trip"\n', ""))
        pz.load(files / "pass.csv", scenario=files / "s.toml", stations=files / "d.toml", tag="receive")


def test_a_file_of_tracking_without_a_scenario_is_refused_with_what_it_needs(files):
    with pytest.raises(ValueError, match=r"one.oem: .*those of tracking need a scenario"):
        pz.load(files / "one.oem")
    with pytest.raises(ValueError, match="--range is for files of tracking"):
        pz.load("b612-range", range="two-way")
