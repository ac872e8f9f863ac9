"""Orbits from ranges to stations on the ground: what is assumed and asked for, honest covariances, and a real satellite."""

from dataclasses import replace

import numpy as np
import pytest

import piazzi as pz
from piazzi import earth
from piazzi.determination import Guess, measured
from piazzi.determination.approach import approached
from piazzi.determination.case import Case
from piazzi.determination.common import BIASES, LASER, with_wider_biases
from piazzi.determination.determining import prepared, read, solved
from piazzi.determination.fit import estimators
from piazzi.estimate.chi_square import quantile
from piazzi.evaluate.information import predicted
from piazzi.formats import Correction, Observations, Segment
from piazzi.problem.inputs import prepare

EPOCH = pz.Epoch("2016-02-13T12:00:00 UTC")
STATE = np.array([9643000.0, 6000000.0, 4600000.0, -3600.0, 4000.0, 1800.0])  # m, m/s, GCRF: near 12,000 km
SITES = ("7090", "7119", "7825", "7941")
SIGMA = 0.03


def ranges(t, stations, values=None, **segment):
    """Two-way laser ranges at transmission, in order of time."""
    told = {"way": "two-way", "range_is": "half", "tag": "transmit", "wavelength": 5.32e-7} | segment
    return Observations(
        epoch=EPOCH,
        t=t,
        value=np.full(len(t), 7e6) if values is None else values,
        kinds=("range",),
        kind=np.zeros(len(t), dtype=int),
        participants=(*SITES, "LAGEOS-2"),
        station=stations,
        object=len(SITES),
        segments=(Segment("UTC", **told),),
        sigma=SIGMA,
        tag=1,
    )


def a_day(**words):
    """The setup of a day of passes over four stations, five rows each."""
    t = np.concatenate([3600.0 * k + np.arange(0.0, 1500.0, 300.0) for k in range(0, 24, 2)])
    station = np.repeat(np.arange(12) % 4, 5)
    return prepared(ranges(t, station), guess=Guess(EPOCH, STATE[:3], STATE[3:], "test"), stations="ilrs", **words)


@pytest.fixture(scope="module")
def given():
    """Its setup with values that are those of the orbit without noise."""
    made = a_day()
    inputs = prepare(made.problem, made.tracking)
    z = predicted(made.problem, inputs, made.states)
    return replace(
        made, tracking=pz.Tracking(made.tracking.row_times, z, made.tracking.row_stations, epoch=made.tracking.epoch)
    )


def noisy(given, seed, off=0.0):
    rng = np.random.default_rng(seed)
    z = given.tracking.values + SIGMA * rng.standard_normal(given.tracking.values.shape)
    tracking = pz.Tracking(given.tracking.row_times, z, given.tracking.row_stations, epoch=given.tracking.epoch)
    guess = replace(given.guess, position=given.guess.position + off)
    return replace(given, tracking=tracking, guess=guess)


def with_biases(given, seed, size):
    """Noise, and a bias of each pass, whose rows are 300 s apart and the next ones' two hours later."""
    rng = np.random.default_rng(seed)
    t = given.tracking.row_times
    of_pass = np.concatenate([[0], np.cumsum(np.diff(t) > 1000.0)])
    z = given.tracking.values + size * rng.standard_normal(12)[of_pass][:, None]
    shifted = pz.Tracking(t, z, given.tracking.row_stations, epoch=given.tracking.epoch)
    return noisy(replace(given, tracking=shifted), 100 + seed)


def test_each_pass_of_a_laser_has_a_bias_unless_the_user_says_what_ranges_are_off_by(given):
    """Residuals do not tell: the orbit takes up the biases of a few passes."""
    new = given.problem.model.constants
    assert len(new) == 12 and set(given.measured.parameters) == set(new)
    assert given.labels["range_bias_1"].name == "bias.range.7090/2016-02-13T12:00:00"
    assert "in its pass 2016-02-13 12:00 to 12:20" in given.labels["range_bias_1"].words
    assert given.assumed.count(BIASES) == 1
    picked = np.array([[dict(s.numbers)[f"is_{name}"] for name in new] for s in given.problem.stations])
    assert (picked.sum(axis=1) == 1.0).all() and (picked.sum(axis=0) == 1.0).all()
    said = a_day(estimate="bias.range.7090=1m")
    names = [said.labels[c].name for c in said.problem.model.constants]
    assert [n for n in names if "7090" in n] == ["bias.range.7090"] and len(names) == 1 + 9 and BIASES in said.assumed
    sigmas = [float(said.problem.parameters[c].covariance[0, 0]) ** 0.5 for c in said.problem.model.constants]
    assert sigmas == pytest.approx([1.0, *[LASER] * 9])
    assert a_day(estimate="bias.range=1m").problem.model.constants == tuple(f"range_bias_{k}" for k in range(1, 5))
    radar = prepared(
        ranges(np.arange(0.0, 1500.0, 300.0), np.zeros(5, dtype=int), wavelength=None),
        guess=Guess(EPOCH, STATE[:3], STATE[3:], "test"), stations="ilrs", corrections="applied",
    )  # fmt: skip
    assert not radar.problem.model.constants and BIASES not in radar.assumed


def test_biases_of_passes_are_not_made_of_rows_that_others_may_follow():
    """Which pass a later row is of is not known when its station begins."""
    rows = ranges(np.arange(0.0, 1500.0, 300.0), np.zeros(5, dtype=int))
    case = Case(guess=Guess(EPOCH, STATE[:3], STATE[3:], "test"), stations="ilrs")
    whole, live = read([rows], case)[0], read([rows], case, passes=False)[0]
    assert list(whole.parameters) == ["range_bias_1"] and not live.parameters and BIASES not in live.assumed


@pytest.mark.parametrize("option", ["estimate", "consider"])
def test_what_no_orbit_has_is_refused_before_one_is_looked_for(option, monkeypatch):
    monkeypatch.setattr("piazzi.determination.unguided.unguided", lambda *_: pytest.fail("looked for orbits"))
    rows = ranges(np.arange(0.0, 1500.0, 300.0), np.zeros(5, dtype=int))
    with pytest.raises(ValueError, match="'nonsense' is no unknown of these forces"):
        prepared(rows, stations="ilrs", **{option: "nonsense=1"})


def test_a_station_of_larger_biases_is_known_by_them_and_one_with_a_fault_is_not(given):
    t = given.tracking.row_times
    of_pass = np.concatenate([[0], np.cumsum(np.diff(t) > 1000.0)])
    mine = np.char.startswith(given.tracking.row_stations.astype(str), given.tracking.row_stations[2 * 5][:4])
    usual = with_biases(given, 5, LASER)
    for size, wide in ((0.1, True), (3.0, False)):
        off = size * np.array([1.0, -1.0, 1.2, -0.8])[of_pass // 4]
        z = usual.tracking.values + np.where(mine, off, 0.0)[:, None]
        moved = replace(usual, tracking=pz.Tracking(t, z, given.tracking.row_stations, epoch=given.tracking.epoch))
        found = with_wider_biases(approached(moved))
        problem = found.problem
        named = {found.labels[c].name.split("/")[0]: problem.parameters[c] for c in problem.model.constants}
        sigma = {name: float(one.covariance[0, 0]) ** 0.5 for name, one in named.items()}
        assert {name for name, one in sigma.items() if one > 1.01 * LASER} == ({"bias.range.7825"} if wide else set())
        if wide:
            assert 0.05 < sigma["bias.range.7825"] < 0.2 and any("at 7825" in text for text in found.assumed)
        else:
            assert BIASES in found.assumed


@pytest.mark.parametrize("role", ["estimated", "considered"])
def test_biases_of_passes_stand_beside_other_constants_of_the_instruments(given, role):
    """Of which a considered one is no value of the model, and an estimated one is not in metres."""
    before = a_day(**{"estimate" if role == "estimated" else "consider": "scale.range.7090=1e-6"})
    moved = with_biases(given, 6, 0.1).tracking
    found = with_wider_biases(approached(replace(before, tracking=moved)))
    (scale,) = (name for name in found.measured.parameters if name.startswith("range_scale"))
    known, prior = found.measured.parameters[scale]
    assert known == role and float(prior.covariance) == pytest.approx(1e-12)
    assert any("m at 7" in text for text in found.assumed)


@pytest.mark.slow
def test_biases_of_passes_are_no_outliers_and_leave_honest_covariances(given):
    runs, total = 12, 0.0
    for seed in range(runs):
        one = approached(with_biases(given, seed, LASER))
        found = solved(one, estimators(("graph",)))
        assert found.determined and found.keep.mean() > 0.9
        error = found.estimate.mean[-1, :6] - given.states[-1, :6]
        P = found.estimate.covariance[-1, :6, :6]
        scale = np.sqrt(np.diag(P))
        total += error / scale @ np.linalg.solve(P / np.outer(scale, scale), error / scale)
    assert quantile(0.0005, 6 * runs) < total < quantile(0.9995, 6 * runs)


@pytest.mark.slow
def test_estimators_agree_also_in_real_time(given):
    found = solved(approached(noisy(given, 1)), estimators(["graph", "batch", "ekf"]))
    assert found.verdict["agreed"].ok is True


def test_what_is_assumed(given):
    said = " ".join(given.assumed)
    assert "centre of mass of LAGEOS-2: 0.251 m" in said and "weather at 7090: standard" in said
    numbers = [s.numbers for s in given.problem.stations]
    assert all(n["centre_of_mass"] == 0.251 and n["wavelength"] == 5.32e-7 for n in numbers)


def test_what_is_applied_already_is_not_applied_again():
    t, station = np.arange(3.0), np.zeros(3, dtype=int)
    said = (Correction("troposphere", None, True), Correction("centre of mass", None, True))
    made = measured(ranges(t, station, corrections=said))
    assert all("mendes" not in s.name for s in made.sensors)
    assert all(s.numbers["centre_of_mass"] == 0.0 for s in made.stations)


@pytest.mark.parametrize("name", ["range", "station delay"])
@pytest.mark.parametrize(("range_is", "share"), [("half", 1.0), ("sum", 0.5)])
def test_what_the_file_states_and_has_not_applied_is_added_once(name, range_is, share):
    """Of a range that is all of the way the correction is too."""
    t, station = np.arange(3.0), np.zeros(3, dtype=int)
    plain = measured(ranges(t, station, range_is=range_is)).tracking.values
    for applied, more in ((True, 0.0), (False, -12.5 * share)):
        made = measured(ranges(t, station, range_is=range_is, corrections=(Correction(name, -12.5, applied),)))
        np.testing.assert_allclose(made.tracking.values - plain, more, atol=1e-9)
        assert any(f"correction of {name}" in text for text in made.assumed) is not applied


def test_a_delay_without_a_number_is_refused_by_name():
    t, station, lost = np.arange(3.0), np.zeros(3, dtype=int), (Correction("station delay", None, False),)
    rows = ranges(t, station, corrections=lost, participants=("7090", "LAGEOS-2"))
    with pytest.raises(ValueError, match="ranges of 7090 have the delay of the station in them"):
        measured(rows)
    sites = [replace(earth.ilrs_stations()["7090"], bias={"range": 7.5})]
    assert [s.numbers["range_bias"] for s in measured(rows, sites).stations] == [7.5]


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"way": None}, "--range two-way"),
        ({"way": "three-way"}, "the file does not say which station sent the three-way signals"),
        ({"range_is": None}, "--range round-trip"),
        ({"mode": "single_diff"}, "differences of ranges"),
    ],
)
def test_what_is_open_is_asked_for(change, says):
    with pytest.raises(ValueError, match=says):
        prepared(ranges(np.arange(3.0), np.zeros(3, dtype=int), **change), guess=Guess(EPOCH, STATE[:3], STATE[3:], "test"))


def test_a_station_that_nobody_gave():
    rows = replace(ranges(np.arange(3.0), np.zeros(3, dtype=int)), participants=("NOWHERE", *SITES[1:], "LAGEOS-2"))
    with pytest.raises(ValueError, match="no station NOWHERE in --stations"):
        prepared(rows, guess=Guess(EPOCH, STATE[:3], STATE[3:], "test"))
    radio = replace(rows, segments=(replace(rows.segments[0], wavelength=None),))
    with pytest.raises(ValueError, match="where is station NOWHERE"):
        prepared(radio, guess=Guess(EPOCH, STATE[:3], STATE[3:], "test"))


@pytest.mark.slow
@pytest.mark.parametrize("off", [0.0, 6e4])
def test_lageos_2_by_one_command(data_dir, tmp_path, off):
    """State within 0.7 m of the published one, residuals below 0.06 m, a day of another's prediction within 0.5 m."""
    folder = data_dir / "earth" / "lageos2"
    place = ("x", 7526990.0), ("y", -9646310.0), ("z", 1464110.0)
    guess = " ".join(f"{name}={value + off}m" for name, value in place) + " vx=3033m/s vy=1715m/s vz=-4447m/s"
    found = pz.determine(
        folder / "lageos2_20160214.npt",
        guess=f"{guess} epoch=2016-02-13T16:00:00Z frame=EME2000",
        stations=[folder / "SLRF2014_POS+VEL_2030.0_200428.snx"],
        epoch="2016-02-13T16:00:00 UTC",
        frame="EME2000",
    )
    assert found.determined
    published = [7526994.072, -9646309.832, 1464110.239]
    assert np.linalg.norm(found.orbit.at()[:3] - published) < 0.7
    assert np.sqrt(np.mean(found.analysis.residual[found.setup.rows >= 0] ** 2)) < 0.06
    found.write(tmp_path / "l2.oem", span=("2016-02-13T00:00:00 UTC", "2016-02-14T00:00:00 UTC"), step=300.0)
    assert pz.difference(tmp_path / "l2.oem", folder / "lageos2_cpf_160213_5441.sgf").rms_3d < 0.5


def test_the_station_of_a_file_gives_its_sigma():
    site = earth.ilrs_stations()["7090"]
    known = replace(site, sigma={"range": 0.5})
    rows = replace(ranges(np.arange(3.0), np.zeros(3, dtype=int)), sigma=np.nan)
    assert np.sqrt(np.asarray(measured(rows, [known]).stations[0].noise)[0, 0]) == pytest.approx(0.5)
