"""Precise orbits of agencies, each by what one command does: a scenario of forces, and the file."""

import numpy as np
import pytest

import piazzi as pz
from piazzi.determination.recorded import recorded
from piazzi.scenarios import Recording

pytestmark = pytest.mark.slow  # a kernel of a minute or so
SCENARIO = """
[earth]
gravity = "{field}"
degree = {degree}
radiation = "cannonball"
empirical = ["along"]
[parameters]
cr_a_m = {{ value = {cr}, sigma = {sigma}, role = "estimated" }}
along = {{ value = 0.0, sigma = {along}, role = "estimated" }}
"""


@pytest.mark.parametrize(
    ("file", "chosen", "field", "degree", "cr", "along", "most"),
    [
        ("sp3/gps_g01_g05_20150505.sp3", "G01", "EGM2008", 12, (0.02, 0.01), 1e-9, 0.12),
        ("sp3/gps_g01_g05_20150505.sp3", "G05", "EGM2008", 12, (0.02, 0.01), 1e-9, 0.2),
        ("sp3/nsgf.orb.stella.v00.sp3.gz", None, "GGM05S.gfc", 40, (1.05e-3, 1e-6), 1e-7, 0.13),
        ("sp3/nsgf.orb.stella.v00.sp3.gz", None, "GGM05S.gfc", 70, (1.05e-3, 1e-6), 1e-7, 0.1),
        ("lageos2/lageos2_cpf_160213_5441.sgf", None, "EGM2008", 20, (7.9e-4, 1e-6), 1e-7, 0.05),
    ],
)
def test_left_over(data_dir, tmp_path, file, chosen, field, degree, cr, along, most):
    if field.endswith(".gfc"):
        (tmp_path / field).write_bytes((data_dir / "earth" / "gravity" / field).read_bytes())
    (tmp_path / "s.toml").write_text(SCENARIO.format(field=field, degree=degree, cr=cr[0], sigma=cr[1], along=along))
    problem, tracking = recorded(data_dir / "earth" / file, tmp_path / "s.toml", Recording(chosen=chosen))
    estimate = pz.BatchLeastSquares().estimate(problem, tracking)
    assert estimate.success
    left = np.linalg.norm(estimate.mean[:, :3] - tracking.values[:, :3], axis=1)
    assert np.sqrt(np.mean(left**2)) < most
