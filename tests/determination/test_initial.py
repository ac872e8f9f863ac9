"""Orbits of a tracking without a guess, by the full model: the truth is among them, and their covariance is honest."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

import piazzi as pz
from piazzi import earth
from piazzi.determination.determining import fitting_orbits
from piazzi.determination.extending import Refined, drift
from piazzi.determination.sights import rows_of
from piazzi.orbit import Keplerian
from piazzi.orbit.fits import DIRECTION, RANGE
from piazzi.scenarios import load_scenario
from tests.determination.fixing import EPOCH, STATE, observations, truth

T = np.arange(0.0, 43200.0, 900.0)


def test_fixes_give_their_orbit():
    path = truth(T)
    noisy = path[:, :3] + 5.0 * np.random.default_rng(1).standard_normal((len(T), 3))
    solved = pz.determine(observations(noisy, T, 5.0))
    found = pz.initial_orbits(solved.problem, solved.tracking)
    (mode,) = found.modes
    assert mode.epoch - EPOCH == 0.0
    off = mode.mean - STATE
    assert off @ np.linalg.solve(mode.covariance, off) < 30.0
    assert mode.rows == noisy.size
    assert_allclose(mode.probability, 1.0)


def test_what_no_sensor_can_tell_is_said():
    model = earth.Forces(degree=2).model([pz.Sensor("height", {"h": "sqrt(x**2 + y**2 + z**2)"})])
    problem = pz.Problem(
        model,
        pz.Gaussian(STATE, np.eye(6)),
        stations=[pz.Station("altimeter", "height", 1.0)],
        parameters=earth.Forces(degree=2).values,
        functions=earth.Forces(degree=2).functions(EPOCH),
        epoch=EPOCH,
        prior_time=0.0,
    )
    with pytest.raises(ValueError, match="measures distances, their rates, directions or positions"):
        pz.initial_orbits(problem, pz.Tracking([0.0, 60.0], [[7e6], [7e6]], epoch=EPOCH))


def test_a_graph_begins_at_the_orbits_that_fit():
    """The prior is on the far side of the Earth and as wide as the orbit: the graph comes to the truth, in one mode."""
    path = truth(T)
    noisy = path[:, :3] + 5.0 * np.random.default_rng(1).standard_normal((len(T), 3))
    solved = pz.determine(observations(noisy, T, 5.0))
    wide = pz.Gaussian(-STATE, np.diag([3e7**2] * 3 + [5e3**2] * 3))
    problem = replace(solved.problem, prior=wide)
    found = pz.FactorGraph(start="orbits").estimate(problem, solved.tracking)
    assert found.success, found.message
    assert found.details["start"] == "orbits" and len(found.details["modes"]) == 1
    off = found.mean[0, :6] - STATE
    assert off @ np.linalg.solve(found.covariance[0, :6, :6], off) < 30.0
    by_words = pz.determine(observations(noisy, T, 5.0), with_="graph:orbits")
    assert_allclose(by_words.orbit.at(), solved.orbit.at(), rtol=1e-9)


def test_a_graph_of_other_states_has_no_orbits_to_begin_at():
    problem = load_scenario("b612-range").problem
    tracking = pz.simulate(problem, [0.0, 0.1], np.random.default_rng(0))
    with pytest.raises(ValueError, match="initial orbits need a problem with states x, y, z, vx, vy, vz"):
        pz.FactorGraph(start="orbits").estimate(problem, tracking)


def test_the_sigma_of_the_mean_motion_is_by_its_derivative():
    mu, x = 3.986004418e14, STATE
    root = np.diag([30.0, 20.0, 10.0, 0.03, 0.02, 0.01]) @ np.tril(np.random.default_rng(3).normal(size=(6, 6)))

    def motion(state):
        a = 1.0 / (2.0 / np.linalg.norm(state[:3]) - state[3:] @ state[3:] / mu)
        return np.sqrt(mu / a**3)

    h = np.array([1.0] * 3 + [1e-3] * 3)
    slope = np.array([(motion(x + e) - motion(x - e)) / (2 * e.sum()) for e in np.diag(h)])
    one = Refined(None, x, root @ root.T, 0.0, 6, EPOCH)
    assert_allclose(drift(one, mu), np.linalg.norm(slope @ root), rtol=1e-6)


@pytest.mark.parametrize("days", [0.3, 90.0])
def test_rows_are_taken_as_far_as_turns_can_be_counted(days):
    """Fifty kilometres over two hours are about a hundredth of the mean motion: turns in months."""
    at = np.concatenate([np.arange(0.0, 7200.0, 900.0), 86400.0 * days + np.array([0.0, 900.0])])
    path = truth(at if days < 1.0 else at[:-2])[:, :3]
    path = np.concatenate([path, np.tile(STATE[:3], (len(at) - len(path), 1))])  # far away it does not matter where it is
    rows = observations(path + 5e4 * np.random.default_rng(4).standard_normal((len(at), 3)), at, 5e4)
    found = fitting_orbits(rows)
    (mode,) = found.modes
    if days < 1.0:
        assert mode.rows == 3 * len(at) and found.beyond is None
        return
    assert mode.rows == 3 * (len(at) - 2)
    assert found.beyond.rows == 2 and found.beyond.turns > 1.0
    assert_allclose(found.beyond.gap, 86400.0 * days - at[-3], rtol=1e-9)
    assert "2 rows do not belong to that arc: the nearest is 89.9 days away" in str(found)
    assert found.to_dict()["beyond"]["rows"] == 2


@pytest.mark.slow
def test_real_files_of_passes_weeks_and_years_apart(data_dir):
    """Laser ranges to LAGEOS-1: 14 over 47 days belong to one orbit; of 29 over 16 months two nights are a ridge."""
    (mode,) = fitting_orbits(str(data_dir / "ilrs/lageos1-test.npt"), stations="ilrs").modes
    assert mode.rows == 14 and mode.weighted_rms < 2.0
    a = 1.0 / (2.0 / np.linalg.norm(mode.mean[:3]) - mode.mean[3:] @ mode.mean[3:] / 3.986004418e14)
    assert abs(a - 12270e3) < 20e3  # of LAGEOS-1
    found = fitting_orbits(str(data_dir / "ilrs/Rollover.frd"), stations="ilrs")
    assert not found.modes and found.ridge.known == 4 and found.beyond.rows == 11 and found.beyond.turns > 1.0


@pytest.mark.slow
@pytest.mark.parametrize("what", ["radar", "telescope"])
def test_tracking_of_stations(what):
    """A low orbit over three stations: within what its covariance says, and the rows are the directions that they should be."""
    S = earth.sensors
    sensors = [S.range(), S.azimuth_elevation()] if what == "radar" else [S.right_ascension_declination("astrometric")]
    sigma = {"range": 20.0, "azimuth_elevation": 1e-3, "right_ascension_declination": 1e-5}
    places = [
        earth.Station.geodetic(n, *np.radians(where), 100.0) for n, *where in (("A", 50, 10), ("B", 40, 20), ("C", 45, -5))
    ]
    stations = [pz.Station(**s.at(p, EPOCH, sigma[s.name], name=f"{p.name}.{s.name}")) for s in sensors for p in places]
    forces = earth.Forces("EGM2008", degree=4)
    functions = forces.functions(EPOCH)
    for sensor in sensors:
        functions |= sensor.functions(EPOCH)
    model = forces.model(sensors, {})
    rng = np.random.default_rng(2)
    t = np.arange(0.0, 6000.0, 20.0)
    while True:
        elements = [7.6e6, 0.003, rng.uniform(0.9, 1.9), *rng.uniform(0, 2 * np.pi, 3)]
        x = np.concatenate(Keplerian().to_state(np.array(elements), 3.986004415e14))
        problem = pz.Problem(
            model,
            pz.Gaussian(x, np.diag([1e8] * 3 + [1e4] * 3)),
            stations=stations,
            parameters=forces.values,
            functions=functions,
            integrator=pz.RungeKutta8(max_step=60.0),
            epoch=EPOCH,
            prior_time=0.0,
        )
        path = problem.arc(t).x
        rows = []
        for station in stations:
            place = station.place.at([EPOCH + float(v) for v in t])
            seen = path[:, :3] - place
            high = np.sum(seen * place, axis=1) / np.linalg.norm(seen, axis=1) / np.linalg.norm(place, axis=1) > 0.17
            rows += [(t[k], station.name, k) for k in np.flatnonzero(high)]
        if len(rows) > 40:
            break
    rows.sort(key=lambda row: row[0])
    values = np.full((len(rows), model.width), np.nan)
    for i, (at, name, k) in enumerate(rows):
        z = problem.measure(name, path[k], at)
        noise = sigma[name[2:]] * rng.normal(size=len(z))
        if (what == "radar" and len(z) == 2) or what == "telescope":
            noise[0] /= np.cos(z[1])
        values[i, : len(z)] = z + noise
    tracking = pz.Tracking([r[0] for r in rows], values, [r[1] for r in rows], epoch=EPOCH)
    unknown = pz.Problem(
        model,
        pz.Gaussian([7e6, 1e3, 1e3, 10.0, 7.5e3, 10.0], np.diag([1e8] * 3 + [1e4] * 3)),
        stations=stations,
        parameters=forces.values,
        functions=functions,
        integrator=pz.RungeKutta8(max_step=60.0),
        epoch=EPOCH,
        prior_time=0.0,
    )
    sights, index = rows_of(unknown, tracking)
    states = np.array([path[rows[j][2]] for j in index])
    seen = states[:, :3] - sights.observer
    late = np.linalg.norm(seen, axis=1, keepdims=True) / 299792458.0
    seen = seen - states[:, 3:] * late
    rho = np.linalg.norm(seen, axis=1)
    directions = sights.kind == DIRECTION
    off = np.linalg.norm(seen / rho[:, None] - sights.value, axis=1)[directions] / sights.sigma[directions, 0]
    assert np.sqrt(np.mean(off**2)) < 1.7  # the square root of two, for two components
    ranges = sights.kind == RANGE
    assert not ranges.any() or np.abs(rho - sights.value[:, 0])[ranges].max() < 5 * 20.0 + 20.0
    found = pz.initial_orbits(unknown, tracking)
    mode = found.modes[0]
    assert mode.probability > 0.99
    error = mode.mean - path[round((mode.epoch - EPOCH) / 20.0)]
    assert error @ np.linalg.solve(mode.covariance, error) < 30.0
    assert 0.7 < mode.weighted_rms < 1.3


def test_a_determination_begins_by_itself_where_fixes_are_too_few_for_a_polynomial():
    """Two fixes a quarter of a revolution apart, and two later ones: no velocity follows from neighbours."""
    at = np.array([0.0, 9000.0, 21000.0, 30000.0])
    path = truth(at)
    found = pz.determine(observations(path[:, :3], at, 5.0))
    assert found.determined
    assert found.setup.guess.source == "initial orbits"
    assert found.verdict["alone"].ok
    assert np.linalg.norm(found.orbit.at(EPOCH)[:3] - STATE[:3]) < 5.0
    assert found.modes[0]["probability"] > 0.99
