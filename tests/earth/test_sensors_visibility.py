"""Who sees what in simulation: above the mask, in the dark, in sunlight."""

import numpy as np
import pytest

import piazzi as pz
from piazzi import earth
from piazzi.earth import sensors
from piazzi.simulation import seen
from tests.references.signals import EPOCH, FORCES, YARRAGADEE, orbit


@pytest.fixture(autouse=True)
def _plain(monkeypatch):
    monkeypatch.setenv("PIAZZI_JIT", "0")  # the same source uncompiled


TIMES = np.arange(0.0, 86400.0, 480.0)


def marks(kind, rules, mask=0.2):
    """Which of the times are seen, of a satellite on a circle."""
    sensor = sensors.right_ascension_declination("astrometric", visible=rules)
    given = {"mask": mask} if "above" in rules else {}
    station = pz.Station(**sensor.at(YARRAGADEE, EPOCH, 1e-5, **given))
    x = orbit(kind)
    p = pz.Problem(
        FORCES.model(sensor),
        pz.Gaussian(x, [1.0] * 6),
        None,
        station,
        FORCES.values,
        prior_time=0.0,
        functions={**FORCES.functions(EPOCH), **sensor.functions(EPOCH)},
        epoch=EPOCH,
    )
    a = TIMES / 900.0
    circle = np.cos(a)[:, None] * x + np.sin(a)[:, None] * np.r_[np.cross([0, 0, 1], x[:3]), x[3:]]
    return seen(p, TIMES, circle)[:, 0], circle


def test_above_is_above_the_mask_of_the_station():
    found, states = marks("LEO", ["above"])
    epochs = [EPOCH + t for t in TIMES]
    there = (earth.rotation("GCRF", "ITRF", epochs) @ states[:, :3, None])[..., 0]
    elevation = YARRAGADEE.look(there, epochs)[1]
    np.testing.assert_array_equal(found, elevation > 0.2)
    assert 0 < found.sum() < 180


def test_dark_is_the_sun_twelve_degrees_down():
    found, _ = marks("LEO", ["dark"])
    epochs = [EPOCH + t for t in TIMES]
    sun = (earth.rotation("GCRF", "ITRF", epochs) @ earth.body("sun", epochs)[0][..., None])[..., 0]
    elevation = YARRAGADEE.look(YARRAGADEE.position(EPOCH) + sun, epochs)[1]
    np.testing.assert_array_equal(found, elevation < np.radians(-12.0))
    assert 40 < found.sum() < 80  # a summer's night of less than ten hours


def test_sunlit_is_out_of_a_cylinder_behind_the_earth():
    found, states = marks("LEO", ["sunlit"])
    sun = earth.body("sun", [EPOCH + t for t in TIMES])[0]
    sun /= np.linalg.norm(sun, axis=1)[:, None]
    along = np.einsum("ki,ki->k", states[:, :3], sun)
    aside = np.linalg.norm(states[:, :3] - along[:, None] * sun, axis=1)
    np.testing.assert_array_equal(found, (along > 0) | (aside > 6378137.0))
    assert 0 < found.sum() < 180


def test_tables_give_arrays_as_they_give_values():
    t, r = np.array([10.0, 5000.0, 90000.0]), np.array([[7e6, 1e6, 2e6], [1.0, 2.0, 3.0], [-4e7, 0.0, 1e3]])
    turn = FORCES.functions(EPOCH)["fixed"]
    back = FORCES.functions(EPOCH)["free"]
    for function in (turn, back):
        rows = [function.value(a, *v) for a, v in zip(t, r, strict=True)]
        np.testing.assert_allclose(function.arrays(t, *r.T), rows, rtol=1e-14, atol=1e-8)
    for function in (earth.Body("sun", EPOCH), earth.Place(YARRAGADEE, EPOCH)):
        np.testing.assert_allclose(function.arrays(t), [function.value(a) for a in t], rtol=1e-13)
