"""Half a day of a GPS satellite fitted, the other half predicted: what the covariance is worth."""

import numpy as np
import pytest

import piazzi as pz
from piazzi import earth

pytestmark = pytest.mark.slow  # one kernel
POSITION = pz.Sensor("position", {"px": "x", "py": "y", "pz": "z"})
FORCES = earth.Forces("EGM2008", 12, radiation="cannonball", empirical=("constant", "once-per-rev"))
PANELS = ("along_panels", "across_panels")  # Y and B of ECOM: the panels' axis is normal to the satellite's place and the Sun
PULLED = {
    "panels": "sqrt(side_x**2 + side_y**2 + side_z**2)",
    "pull_y": "lit*along_panels/panels",
    "pull_b": "lit*across_panels/(panels*sun_d)",
}
PULLS = {
    "vx": "pull_y*side_x + pull_b*(sun_dy*side_z - sun_dz*side_y)",
    "vy": "pull_y*side_y + pull_b*(sun_dz*side_x - sun_dx*side_z)",
    "vz": "pull_y*side_z + pull_b*(sun_dx*side_y - sun_dy*side_x)",
}
SIGMA = 0.03
MOST = 14.16  # chi-squared of three degrees of freedom, 99.73 %
NOTHING = 1e-20  # a sigma that holds an acceleration at zero


def fitted(data_dir, satellite, sigmas, part=0.5):
    """How far a part of the arc is off, by which covariance, how many rows were seen, and the estimate."""
    arc = pz.read_ephemeris(data_dir / "earth" / "sp3" / "gps_g01_g05_20150505.sp3").of(satellite)[0]
    t, at = arc.t[::6], [arc.epoch + s for s in arc.t[::6]]
    place = earth.transform(arc.position[::6], None, "ITRF", "GCRF", at)[0]
    near = earth.transform(arc.position[:9], None, "ITRF", "GCRF", [arc.epoch + s for s in arc.t[:9]])[0]
    velocity = np.polyfit(arc.t[:9] - arc.t[0], near, 8)[-2]
    priors = {name: pz.Gaussian(0.0, sigmas.get(name, sigmas.get("every", NOTHING)) ** 2) for name in FORCES.empirical}
    priors |= {name: pz.Gaussian(0.0, sigmas.get(name, NOTHING) ** 2) for name in PANELS}
    problem = pz.Problem(
        FORCES.model([POSITION], dict.fromkeys(["cr_a_m", *priors], "estimated"), PULLS, PULLED),
        pz.Gaussian([*place[0], *velocity], [1e4] * 3 + [1.0] * 3),
        stations=[pz.Station("orbit", "position", [SIGMA] * 3)],
        parameters={**FORCES.values, "cr_a_m": pz.Gaussian(0.02, 1.0), **priors},
        integrator=pz.RungeKutta8(10),
        functions=FORCES.functions(arc.epoch),
        epoch=arc.epoch,
        prior_time=t[0],
    )
    half = round(part * len(t))
    seen = place.copy()
    seen[half:] = np.nan
    estimate = pz.BatchLeastSquares().estimate(problem, pz.Tracking(t, seen, epoch=arc.epoch))
    assert estimate.success
    off = estimate.mean[:, :3] - place
    S = estimate.covariance[:, :3, :3] + SIGMA**2 * np.eye(3)
    return off, S, half, estimate


def predicted(data_dir, satellite, sigmas):
    """RMS in space of both halves (m), and the part of the second within three sigma."""
    off, S, half, _ = fitted(data_dir, satellite, sigmas)
    distance = np.einsum("ki,ki->k", off, np.linalg.solve(S, off[..., None])[..., 0])
    rms = [float(np.sqrt(np.mean(np.sum(part**2, axis=1)))) for part in (off[:half], off[half:])]
    return *rms, np.mean(distance[half:] < MOST)


def test_what_a_cannonball_leaves_out_is_not_in_its_covariance(data_dir):
    fit, prediction, covered = predicted(data_dir, "G05", {})
    assert 0.1 < fit < 0.15
    assert 1.2 < prediction < 1.6
    assert covered < 0.5


@pytest.mark.parametrize(("satellite", "most"), [("G05", 0.45), ("G01", 0.25)])
def test_waves_of_a_revolution_make_it_honest(data_dir, satellite, most):
    fit, prediction, covered = predicted(data_dir, satellite, {"every": 1e-9})
    assert fit < 0.05
    assert prediction < most
    assert covered == 1.0


def test_panels_are_what_a_sphere_lacks(data_dir):
    """A constant along the panels of G05 is there at ten sigma; with one across them half a day predicts the rest honestly."""
    sphere, panels = (fitted(data_dir, "G05", sigmas, 1.0) for sigmas in ({}, dict.fromkeys(PANELS, 1e-9)))
    rms = [np.sqrt(np.mean(np.sum(off**2, axis=1))) for off, *_ in (sphere, panels)]
    assert 0.3 < rms[0] < 0.4
    assert rms[1] < 0.1
    names = list(FORCES.model(parameters=["cr_a_m"]).states)
    y = len(names) + 1 + len(FORCES.empirical)
    mean, covariance = panels[3].mean[0], panels[3].covariance[0]
    assert abs(mean[y]) > 10 * np.sqrt(covariance[y, y])
    assert abs(mean[y]) < 2e-9  # those of GPS are below it
    _, prediction, covered = predicted(data_dir, "G05", dict.fromkeys(PANELS, 1e-9))
    assert prediction < 1.5
    assert covered == 1.0
