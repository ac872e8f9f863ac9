"""Orbits of a tracking without a guess, by the full model: the truth is among them, and their covariance is honest."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

import piazzi as pz
from piazzi import earth
from piazzi.determination.sights import rows_of
from piazzi.orbit import Keplerian
from piazzi.orbit.fits import DIRECTION, RANGE
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
