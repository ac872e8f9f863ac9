"""Orbits carried on row by row: what whole runs say, whatever the stations and whenever rows come; in a pipe, to its end."""

import numpy as np
import pytest

import piazzi as pz
from piazzi import earth
from piazzi.determination import Guess
from piazzi.determination.determining import prepared
from piazzi.evaluate.information import predicted
from piazzi.formats import TAGS, Observations, Segment, tdm_text
from piazzi.problem.inputs import prepare
from tests.determination.fixing import EPOCH, STATE, truth

T = np.arange(0.0, 36000.0, 300.0)
SIGMA, WRONG = 10.0, 60
FORCES = "gravity=EGM2008 degree=12 radiation=cannonball"


@pytest.fixture(scope="module")
def orbit():
    return truth(T)


@pytest.fixture(scope="module")
def table(orbit):
    """Lines of a table of fixes, one of which is wrong by five kilometres."""
    path = orbit[:, :3] + SIGMA * np.random.default_rng(1).standard_normal((len(T), 3))
    path[WRONG] += 5e3
    lines = ["# frame = GCRF\n", "time[UTC],x[m],y[m],z[m],sigma x[m],sigma y[m],sigma z[m]\n"]
    for t, r in zip(T, path.tolist(), strict=True):
        lines.append(",".join([(EPOCH + t).to("UTC").split()[0], *map(repr, r), "10,10,10\n"]))
    return lines


def nees(found, orbit):
    """Per degree of freedom, of the state at its last row."""
    error, P = found.orbit.at() - orbit, found.orbit.covariance()
    scale = np.sqrt(np.diag(P))
    return float(error / scale @ np.linalg.solve(P / np.outer(scale, scale), error / scale)) / 6


@pytest.mark.slow
@pytest.mark.parametrize("with_", ["ekf:gate", "window:3h"])
def test_rows_one_by_one_are_the_whole_run(table, orbit, with_):
    """From the first rows' orbit the session's numbers are those of the estimator over all rows, from the same prior."""
    live = pz.Following(with_=with_, forces=FORCES)
    taken = list(live.read(line for line in table if "nothing" not in line))
    assert len(taken) == len(T) and live.success and not live.waiting
    found = live.determination()
    inputs = found.setup
    keep = np.array([row.used or row.reason == "beyond the gate" for row in taken])
    from piazzi.determination.fit import kept

    whole = live.estimator.estimate(inputs.problem, kept(inputs.tracking, keep))
    np.testing.assert_allclose(found.estimate.mean[-1], whole.mean[-1], rtol=1e-9)
    np.testing.assert_allclose(found.estimate.covariance[-1], whole.covariance[-1], rtol=1e-6, atol=1e-12)
    if with_ == "ekf:gate":
        assert [row.reason for row in taken].index("beyond the gate") == WRONG and sum(not row.used for row in taken) == 1
        assert found.determined and nees(found, orbit[-1]) < 4.0
        assert {one["reason"] for one in found.to_dict()["rejected"]} == {"beyond the gate"}
        sigma = np.sqrt(np.diag(found.orbit.covariance(axes="RTN")))[:3]
        np.testing.assert_allclose(taken[-1].sigma, sigma, rtol=1e-6)


SITES = {"BER": (0.9, 0.2), "TEN": (0.5, -0.3), "SAN": (-0.6, -1.2)}


def radar(noise, seed=3):
    """Ranges and angles of three radars over five hours, one after the other, as a TDM; and the orbit at the last of them."""
    t = np.arange(0.0, 18000.0, 120.0)
    who = (t // 1800.0).astype(int) % 3
    names = tuple(SITES)
    sigma = (SIGMA, np.radians(0.01), np.radians(0.01))
    rows = Observations(
        epoch=EPOCH, t=np.repeat(t, 3), value=np.tile([2e7, 1.0, 0.5], len(t)), kinds=("range", "azimuth", "elevation"),
        kind=np.tile(np.arange(3), len(t)), participants=(*names, "SAT"), station=np.repeat(who, 3), object=3,
        segments=(Segment("UTC", way="two-way", range_is="half", tag="receive"),), sigma=np.tile(sigma, len(t)),
        tag=TAGS.index("receive"),
    )  # fmt: skip
    stations = [earth.Station.geodetic(name, *place, 100.0) for name, place in SITES.items()]
    made = prepared(rows, guess=Guess(EPOCH, STATE[:3], STATE[3:], "test"), stations=stations, forces=FORCES)
    z = predicted(made.problem, prepare(made.problem, made.tracking), made.states)
    value = np.empty(3 * len(t))
    there = made.rows >= 0
    value[made.rows[there]] = z[there]
    value += noise * np.tile(sigma, len(t)) * np.random.default_rng(seed).standard_normal(len(value))
    from dataclasses import replace

    return replace(rows, value=value, sigma=np.nan), stations, made.states[-1, :6]


def messages(rows):
    """Lines of a TDM with a segment for each half hour of one radar, in order of time."""
    lines = []
    for half in range(10):
        text = tdm_text(rows[(rows.t >= 1800.0 * half) & (rows.t < 1800.0 * (half + 1))]).splitlines()
        lines += text[text.index("META_START") if lines else 0 :]
    return lines


@pytest.fixture(scope="module")
def pointed():
    return radar(1.0)


WORDS = {"sigma": ["10m", "azimuth=0.01deg", "elevation=0.01deg"], "range": "two-way", "forces": FORCES}


@pytest.mark.slow
def test_stations_and_kinds_that_come_later_are_taken_up(pointed):
    """Begun on the first radar alone; the others are no part of the problem then, and the numbers are those of one run."""
    rows, stations, last = pointed
    live = pz.Following(with_="ekf", stations=stations, **WORDS)
    taken = list(live.read(messages(rows)))
    assert len(taken) == 300 and all(row.used for row in taken) and {row.station for row in taken} == set(SITES)
    found = live.determination()
    assert found.determined and nees(found, last) < 4.0
    assert {one["station"] for one in found.to_dict()["residuals"]} == set(SITES)
    chi = [value for row in taken[60:] for value in row.residuals.values()]
    assert 0.8 < np.mean(np.square(chi)) < 1.25


@pytest.mark.slow
def test_the_air_of_a_low_orbit_is_a_process_that_goes_on():
    """A stream has no last row: where there is drag its density departs for ever, and what was predicted is judged by it."""
    from tests.determination.fixing import observations

    t = np.arange(0.0, 10800.0, 60.0)
    r, v = np.array([6.7e6, 0.0, 1e5]), np.array([0.0, 1.0e3, 7.65e3])
    fixes = observations(np.tile(r, (len(t), 1)), t, 5.0)
    made = prepared(fixes, guess=Guess(EPOCH, r, v, "test"))
    path = made.states[:, :3] + 5.0 * np.random.default_rng(0).standard_normal((len(t), 3))
    live = pz.Following()
    for rows in np.split(np.arange(3 * len(t)), 60):
        live.take(observations(path, t, 5.0)[rows])
    found = live.determination()
    assert "cd_a_m_change" in found.problem.model.names and any("correlated over" in text for text in found.setup.assumed)
    assert found.determined and found.verdict["honest"].ok is True and nees(found, made.states[-1, :6]) < 4.0
