"""`piazzi propagate`: files of orbits and scenarios, what is written, and bad input in one line."""

import csv
import json
from dataclasses import replace

import numpy as np
import pytest

import piazzi as pz
from piazzi import earth
from piazzi.formats import Arc, Ephemeris
from piazzi.formats.write_odm import oem_text, opm_text

EPOCH = pz.Epoch("2016-02-13T16:00:00 UTC")
X = np.array([7000e3, 100e3, -50e3, 10.0, 5.0e3, 5.5e3])
P = np.diag([100.0, 400.0, 50.0, 1e-4, 2e-4, 3e-4])
MU = 3.986004415e14
TWO = "none"


@pytest.fixture(autouse=True)
def _plain(monkeypatch):
    monkeypatch.setenv("PIAZZI_JIT", "0")


def arc(frame="GCRF", x=X, axes="GCRF", P=P, **more):
    r, v = earth.transform(x[:3], x[3:], "GCRF", frame, EPOCH)
    blocks = {"covariance_t": [0.0], "covariance": [P], "covariance_frames": (axes,)} if axes else {}
    return Arc(
        epoch=EPOCH, t=[0.0], position=[r], velocity=[v], centre="EARTH", frame=frame, scale="UTC", name="A", **blocks, **more
    )


@pytest.fixture
def opm(tmp_path):
    path = tmp_path / "a.opm"
    path.write_text(opm_text(arc()))
    return path


def test_two_bodies_with_covariance(call, opm, tmp_path):
    """Against motion and transition matrix in closed form; OEM, and the same in ITRF as CSV."""
    out = tmp_path / "b.oem"
    found = call("propagate", opm, "--forces", TWO, "--to", "2 h", "--step", "10 min", "-o", out, "--json").document
    assert (found["schema"], found["count"], found["forces"]) == (
        "piazzi.propagate/1", 13, "EGM2008 to degree 0 (two bodies)"
    )  # fmt: skip
    r, v = pz.propagate_kepler(X[:3], X[3:], MU, 7200.0)
    np.testing.assert_allclose(found["last"]["mean"], [*r, *v], atol=1e-2)
    Phi = pz.kepler_transition(X[:3], X[3:], MU, 7200.0)
    expected = Phi @ P @ Phi.T
    np.testing.assert_allclose(found["last"]["sigma"], np.sqrt(np.diag(expected)), rtol=1e-5)
    R = pz.orbit.state_axes(r, v, "RTN")
    np.testing.assert_allclose(found["last"]["sigma_rtn"], np.sqrt(np.diag(R @ expected @ R.T)), rtol=1e-5)
    (written,) = pz.read_ephemeris(out).arcs
    assert (written.frame, len(written), len(written.covariance)) == ("GCRF", 13, 13)
    np.testing.assert_allclose(written.covariance[-1], expected, atol=1e-5 * np.abs(expected).max())
    assert np.linalg.eigvalsh(written.covariance[-1]).min() > 0

    table = tmp_path / "b.csv"
    call("propagate", opm, "--forces", TWO, "--to", "2016-02-13T18:00:00 UTC", "--step", 3600, "--frame", "ITRF", "-o", table)
    rows = list(csv.DictReader(table.read_text().splitlines()))
    assert [row["time"] for row in rows] == [f"2016-02-13T{h}:00:00.000000000 UTC" for h in (16, 17, 18)]
    fixed = earth.transform(r, v, "GCRF", "ITRF", EPOCH + 7200.0)
    np.testing.assert_allclose(
        [float(rows[-1][n]) for n in ("x", "y", "z", "vx", "vy", "vz")], np.concatenate(fixed), atol=1e-2
    )


@pytest.mark.parametrize("axes", ["RTN", "ITRF"])
def test_covariances_of_other_axes_are_turned(call, tmp_path, axes):
    path = tmp_path / "a.oem"
    path.write_text(oem_text(Ephemeris(arcs=(arc(axes=axes),))))
    found = call("propagate", path, "--forces", TWO, "--to", "0", "--json").document
    if axes == "RTN":
        np.testing.assert_allclose(found["first"]["sigma_rtn"], np.sqrt(np.diag(P)), rtol=1e-9)
        return
    W, rate = earth.rotation_rate("ITRF", "GCRF", EPOCH)
    J = np.block([[W, np.zeros((3, 3))], [rate, W]])
    np.testing.assert_allclose(found["first"]["sigma"], np.sqrt(np.diag(J @ P @ J.T)), rtol=1e-9)


def test_the_forces_of_the_height_are_said(call, opm):
    text = call("propagate", opm, "--to", "0").out
    assert "drag (harris-priester) (default at " in text
    assert "Assumed: cr_a_m = 0.013 m2/kg.\nAssumed: cd_a_m = 0.022 m2/kg" in text


def test_sunlight_on_laser_spheres_is_known_and_else_its_doubt_is_said(call, opm, tmp_path):
    """Area over mass of LAGEOS-2: pi 0.3^2 m2 over 405.4 kg (ILRS)."""
    (tmp_path / "b.opm").write_text(opm_text(replace(arc(x=np.array([12.2e6, 0.0, 0.0, 0.0, 3.5e3, 4.5e3])), name="LAGEOS-2")))
    found = call("propagate", tmp_path / "b.opm", "--to", "60s", "--json").document["assumed"]
    (sphere,) = [text for text in found if text.startswith("cr = 1.13 and")]
    assert float(sphere.split()[4]) == pytest.approx(np.pi * 0.3**2 / 405.38, rel=2e-3)
    assert not any("cr_a_m" in text or "not in the covariance" in text for text in found)
    other = call("propagate", opm, "--to", "60s", "--json").document["assumed"]
    assert "what these coefficients are off by is not in the covariance" in other


def test_two_line_elements_have_a_rule_of_thumb(call, tmp_path):
    path = tmp_path / "a.tle"
    path.write_text(
        "VANGUARD 1\n1 00005U 58002B   00179.78495062  .00000023  00000-0  28098-4 0  4753\n"
        "2 00005  34.2682 348.7242 1859667 331.7664  19.3264 10.82419157413667\n"
    )
    found = call("propagate", path, "--forces", TWO, "--to", "0", "--json").document
    mean = pz.read_ephemeris(path).mean[0]
    r, v = pz.orbit.sgp4_states(mean, mean.epoch, "GCRF")
    np.testing.assert_allclose(found["first"]["mean"], [*r, *v], rtol=1e-12)
    np.testing.assert_allclose(found["first"]["sigma_rtn"][:3], 1000.0, rtol=1e-6)
    assert "rule of thumb" in found["source"]


def test_without_covariance_none_is_made(call, tmp_path):
    path = tmp_path / "a.opm"
    path.write_text(opm_text(arc(axes="")))
    result = call("propagate", path, "--forces", TWO, "--to", "10 min", "-o", tmp_path / "b.oem")
    assert "There is no covariance, and none is made." in result.out
    assert not len(pz.read_ephemeris(tmp_path / "b.oem").arcs[0].covariance)


def test_a_scenario_of_any_kind(call, tmp_path):
    """Its prior, its forces and its times; nothing of an orbit about the Earth is needed."""
    found = call("propagate", "b612-range-q0", "-o", tmp_path / "a.nc", "--json").document
    problem = pz.load("b612-range-q0")[0]
    times = np.arange(100) * 0.1
    np.testing.assert_allclose(found["last"]["mean"], pz.propagate(problem, times).mean[-1], rtol=1e-12)
    assert (tmp_path / "a.nc").stat().st_size > 1000
    call("propagate", "b612-range-q0", "--to", "5", "--step", "1", "-o", tmp_path / "a.csv")
    assert len(list(csv.DictReader((tmp_path / "a.csv").read_text().splitlines()))) == 6


def test_backwards(call, opm):
    found = call("propagate", opm, "--forces", TWO, "--to", "-600", "--json").document
    r, v = pz.propagate_kepler(X[:3], X[3:], MU, -600.0)
    np.testing.assert_allclose(found["first"]["mean"], [*r, *v], atol=1e-2)
    assert (found["first"]["t"], found["last"]["t"]) == (-600.0, 0.0)


@pytest.mark.parametrize(
    ("more", "message"),
    [
        (("--forces", "gravity=EGM2009"), "gravity model 'EGM2009' is neither in the package"),
        (("--forces", "degre=4"), "forces: degre is not known; did you mean 'degree'"),
        (("--forces", "degree=4 kernel=nowhere.bsp"), "nowhere.bsp: No such file"),
        (("--forces", "degree=4 bodies=vulcan"), "bodies has 'vulcan'"),
        (("--to", "soon"), "--to"),
        (("--to", "2016-02-14T16:00:00"), "scale"),
        (("--step", "10 km"), "--step is '10 km'; write a length of time"),
        (("--step", "-1"), "--step is '-1'; it must be a positive"),
        (("--frame", "GRCF"), "GRCF"),
        (("--step", "1e-9"), "at most 1e+07 are allowed"),
        (("-o", "b.txt"), "the file must end in .oem, .nc, .csv"),
    ],
)
def test_bad_input_is_one_line(call, opm, more, message):
    assert message in call("propagate", opm, *more).refused()


def test_orbits_that_are_none_are_refused(call, tmp_path):
    path = tmp_path / "a.opm"
    low = X.copy()
    low[3:] *= 0.5
    path.write_text(opm_text(arc(x=low)))
    assert "it is below the surface" in call("propagate", path).refused()
    assert "No such file" in call("propagate", tmp_path / "none.oem").refused()
    assert "--forces is for files" in call("propagate", "b612-range-q0", "--forces", "none").refused()
    assert "an OEM holds orbits" in call("propagate", "b612-range-q0", "-o", tmp_path / "b.oem").refused()


def test_mean_elements_as_json_are_no_determination(call, tmp_path):
    mean = {
        "OBJECT_NAME": "A", "OBJECT_ID": "2020-003C", "EPOCH": "2020-12-29T03:57:59.406624", "MEAN_MOTION": 15.27989249,
        "ECCENTRICITY": 0.0013356, "INCLINATION": 97.297, "RA_OF_ASC_NODE": 66.4161, "ARG_OF_PERICENTER": 110.6345,
        "MEAN_ANOMALY": 334.7107, "NORAD_CAT_ID": 45018, "BSTAR": 8.4553e-05,
        "MEAN_MOTION_DOT": 2.241e-05, "MEAN_MOTION_DDOT": 0,
    }  # fmt: skip
    path = tmp_path / "omm.json"
    path.write_text(json.dumps(mean))
    assert call("propagate", path, "--to", "10min", "--step", "5min", "--json").document["assumed"] is not None
