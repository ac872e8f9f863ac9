"""Fixes of an antenna that is not at the centre of mass."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

import piazzi as pz
from piazzi.formats import Arc, Ephemeris, oem_text
from piazzi.orbit import state_axes
from tests.determination.fixing import EPOCH, truth

ARM = np.array([3.0, -40.0, 20.0])  # m along R, T and N


@pytest.mark.slow
def test_the_orbit_is_that_of_the_centre_of_mass(tmp_path):
    t = np.arange(0.0, 86400.0, 1800.0)
    states = truth(t)
    noise = 0.1 * np.random.default_rng(2).standard_normal((len(t), 3))
    turned = np.array([state_axes(s[:3], s[3:])[:3, :3].T @ ARM for s in states])
    said = {"frame": "GCRF", "centre": "EARTH", "scale": "UTC", "name": "SAT"}
    arc = Arc(epoch=EPOCH, t=t, position=states[:, :3] + turned + noise, velocity=states[:, 3:], **said)
    (tmp_path / "fixes.oem").write_text(oem_text(Ephemeris(arcs=(arc,))))
    (tmp_path / "case.toml").write_text("[determine]\nsigma = ['0.1m', '1m/s']\n[object]\nantenna = [3.0, -40.0, 20.0]\n")
    found = pz.determine(tmp_path / "case.toml", tmp_path / "fixes.oem")
    assert found.determined and found.verdict["honest"].ok
    miss = found.orbit.at() - states[-1]
    assert_allclose(miss / np.sqrt(np.diag(found.orbit.covariance())), 0.0, atol=4.5)
    assert np.linalg.norm(miss[:3]) < 0.5  # 45 m without the arm
