"""How far two orbits are apart: known offsets come back along the right axes, in metres and in sigma."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

import piazzi as pz
from piazzi import earth
from piazzi.formats import Arc, Ephemeris
from piazzi.orbit import Keplerian, orbit_axes, propagate_kepler, read_tle, sgp4_states, state_axes
from piazzi.orbit.interpolation import polynomial

MU = 3.986004418e14
START = pz.Epoch("2020-03-01T00:00:00 UTC")
R, V = Keplerian().to_state([7.2e6, 0.05, 1.0, 0.3, 0.2, 0.1], MU)


def kepler(dates):
    return propagate_kepler(R, V, MU, np.array([date - START for date in dates]))


def arc(step=60.0, count=121, velocity=True, offset=(0.0, 0.0, 0.0), frame="GCRF", noise=None, **more):
    """Two-body motion moved by an offset along R, T and N."""
    t = step * np.arange(count)
    r, v = propagate_kepler(R, V, MU, t)
    moved = np.einsum("kij,i->kj", orbit_axes(r, v), np.asarray(offset, dtype=float))
    r = r + moved + (0.0 if noise is None else noise)
    if frame != "GCRF":
        r, v = earth.transform(r, v, "GCRF", frame, [START + float(x) for x in t], earth.SubdailyEOP())
    given = {"velocity": v} if velocity else {}
    return Arc(epoch=START, t=t, position=r, frame=frame, centre="EARTH", scale="UTC", name="X", **given, **more)


def test_an_offset_comes_back_along_its_axes():
    found = pz.difference(arc(), arc(offset=(1.0, -2.0, 3.0)))
    assert_allclose(found.position, np.tile([1.0, -2.0, 3.0], (121, 1)), atol=1e-8)
    assert_allclose(found.rms, [1, 2, 3], atol=1e-8)
    assert_allclose(found.maximum, [1, 2, 3], atol=1e-8)
    assert found.rms_3d == pytest.approx(np.sqrt(14))
    assert found.covered is None
    assert found.to_dict()["in_sigma"] is None
    assert found.told[0] == {"method": "rows", "degree": 0, "error": 0.0}


def test_the_order_of_the_two_changes_the_sign():
    found = pz.difference(arc(offset=(1.0, -2.0, 3.0)), arc())
    assert_allclose(found.position, np.tile([-1.0, 2.0, -3.0], (121, 1)), atol=1e-4)  # the axes of the other, a little turned


def test_axes_of_the_velocity_and_frames():
    a, b = arc(), arc(offset=(1.0, -2.0, 3.0))
    tnw, itrf = pz.difference(a, b, "TNW"), pz.difference(a, b, "ITRF")
    r, v = kepler([START])
    expected = state_axes(r[0], v[0], "TNW")[:3, :3] @ (orbit_axes(r[0], v[0]).T @ [1.0, -2.0, 3.0])
    assert_allclose(tnw.position[0], expected, atol=1e-8)
    expected = earth.rotation("GCRF", "ITRF", START) @ (orbit_axes(r[0], v[0]).T @ [1.0, -2.0, 3.0])
    assert_allclose(itrf.position[0], expected, atol=1e-8)
    assert list(itrf.to_dict()["rms"]) == ["X", "Y", "Z", "3d"]


@pytest.mark.parametrize("frame", ["GCRF", "EME2000", "ITRF", "TEME"])
@pytest.mark.parametrize("velocity", [True, False])
def test_between_rows_the_stated_error_bounds_the_true_one(frame, velocity):
    """Rows of three minutes against the exact motion every 50 s, from any axes."""
    found = pz.difference(arc(180.0, 41, velocity, frame=frame), kepler, step=50.0)
    told = found.told[0]
    assert velocity or told["method"] == "Lagrange"
    assert 1e-10 < found.maximum.max() < max(told["error"], 1e-6) < (1e-3 if velocity else 0.5)
    assert np.abs(found.velocity).max() < 1e-2
    assert found.told[1]["method"] == "function"


def test_polynomials_of_their_degree_are_exact():
    rng = np.random.default_rng(0)
    coefficients = rng.normal(size=(8, 3))
    t = np.sort(rng.uniform(-1, 1, 30))
    powers = [np.vander(t, 8, increasing=True) @ coefficients]
    powers.append(np.vander(t, 7, increasing=True) @ (np.arange(1, 8)[:, None] * coefficients[1:]))
    at = rng.uniform(t[0], t[-1], 50)
    exact = np.vander(at, 8, increasing=True) @ coefficients
    slope = np.vander(at, 7, increasing=True) @ (np.arange(1, 8)[:, None] * coefficients[1:])
    for velocity, rows in ((None, 8), (powers[1], 4)):
        value, derivative = polynomial(t, powers[0], velocity, at, rows)
        assert_allclose(value, exact, atol=1e-8)
        assert_allclose(derivative, slope, atol=1e-6)


def test_a_degree_and_that_of_the_file_are_kept():
    every = arc(180.0, 41)
    assert pz.difference(every, kepler, step=50.0, degree=5).told[0]["degree"] == 5
    assert pz.difference(replace(every, degree=7), kepler, step=50.0).told[0]["degree"] == 7


@pytest.mark.parametrize("frame", ["RTN", "GCRF", "ITRF"])
def test_in_sigma_of_both_covariances(frame):
    """Errors drawn from a covariance have an rms of one sigma along each axis, whatever axes it is given in."""
    rng = np.random.default_rng(3)
    count, sigma = 400, np.array([3.0, 20.0, 5.0])
    t = 60.0 * np.arange(count)
    r, v = propagate_kepler(R, V, MU, t)
    axes = orbit_axes(r, v)
    noise = np.einsum("kij,ki->kj", axes, sigma * rng.normal(size=(count, 3)))
    blocks = np.zeros((count, 6, 6))
    in_gcrf = np.einsum("kij,i,kil->kjl", axes, sigma**2, axes)
    turn = {
        "RTN": axes,
        "GCRF": np.tile(np.eye(3), (count, 1, 1)),
        "ITRF": earth.rotation("GCRF", "ITRF", [START + x for x in t]),
    }[frame]
    blocks[:, :3, :3] = turn @ in_gcrf @ np.swapaxes(turn, 1, 2)
    known = {"covariance_t": t, "covariance": blocks / 2, "covariance_frames": (frame,) * count}
    found = pz.difference(arc(count=count, **known), arc(count=count, noise=noise, **known))
    assert_allclose(found.sigma, np.tile(sigma, (count, 1)), rtol=1e-6)
    told = found.to_dict()["in_sigma"]
    assert told["count"] == count
    assert_allclose(list(told["rms"].values()), 1, atol=0.12)
    assert found.covered == told["inside"] >= 0.985


def test_accuracies_of_rows_are_covariances_too():
    found = pz.difference(arc(sigma=np.full((121, 3), 2.0)), arc(offset=(4.0, 0, 0)))
    assert found.to_dict()["in_sigma"]["rms"]["R"] == pytest.approx(2.0)
    assert found.covered == 1.0


def test_only_times_that_both_cover_within_the_span():
    late = replace(arc(count=61), epoch=START)
    assert len(pz.difference(arc(), late).t) == 61
    span = ("2020-03-01T00:10:00 UTC", "2020-03-01T00:20:00 UTC")
    found = pz.difference(arc(), late, span=span)
    assert (found.t[0], found.t[-1], len(found.t)) == (600.0, 1200.0, 11)
    assert len(pz.difference(arc(), late, span=(None, span[1])).t) == 21
    held = replace(arc(), useable=(START + 300.0, START + 900.0))
    assert pz.difference(held, arc()).to_dict()["first"] == "2020-03-01T00:05:00 UTC"
    assert len(pz.difference(kepler, kepler, span=span, step=60.0).t) == 11


def test_two_line_elements_against_their_own_states():
    mean = read_tle("""1 00005U 58002B   00179.78495062  .00000023  00000-0  28098-4 0  4753
2 00005  34.2682 348.7242 1859667 331.7664  19.3264 10.82419157413667""")
    t = 120.0 * np.arange(60)
    r, v = sgp4_states(mean, [mean.epoch + x for x in t])
    rows = Arc(epoch=mean.epoch, t=t, position=r, velocity=v, frame="TEME", centre="EARTH", scale="UTC", name="5")
    assert pz.difference(Ephemeris(arcs=(rows,)), mean).maximum.max() < 1e-6
    found = pz.difference(mean, rows, step=50.0)
    assert found.maximum.max() < 0.01
    # its velocities are not the derivatives of its positions: Hermite's polynomial would be 30 m off
    assert [told["method"] for told in found.told] == ["SGP4", "Lagrange"]


def test_real_orbits_thinned_and_whole(data_dir):
    """Every second row of a GPS satellite, without velocities, and of Stella, with them, against all rows."""
    for file, name, bound in (("gps_g01_g05_20150505.sp3", "G01", 2e-3), ("nsgf.orb.stella.v00.sp3.gz", None, 0.6)):
        path = data_dir / "earth" / "sp3" / file
        (whole,) = pz.read_ephemeris(path).of(name) if name else pz.read_ephemeris(path).arcs
        half = Arc(
            epoch=whole.epoch, t=whole.t[::2], position=whole.position[::2], velocity=whole.velocity[::2], frame=whole.frame,
            centre=whole.centre, scale=whole.scale, name=whole.name,
        )  # fmt: skip
        found = pz.difference(path, half, object=name)
        assert len(found.t) >= len(whole) - 1
        assert 0 < found.rms_3d < bound
        # waves shorter than two steps are in the orbit of Stella, and no polynomial through the rows shows them
        assert found.maximum.max() < 3 * found.told[1]["error"] < 15 * bound


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: pz.difference(arc(), arc(), "LVLH"), "axes 'LVLH' are not known"),
        (lambda: pz.difference(arc(), replace(arc(), epoch=START + 1e6)), "have no time in common"),
        (lambda: pz.difference(kepler, kepler), "neither orbit has dates of its own: give a span"),
        (lambda: pz.difference(kepler, kepler, span=(START, None)), "give a span with both ends"),
        (lambda: pz.difference(arc(), arc(), span=(START + 9.0, START)), "the span ends 9 s before it begins"),
        (lambda: pz.difference(arc(), arc(), step=0.0), "step is 0 s"),
        (lambda: pz.difference(arc(), 3), "not a int"),
        (lambda: pz.difference(arc(count=1), arc()), "has 1 position; two and more"),
        (lambda: pz.difference(replace(arc(), frame=None), arc()), "does not say in which axes"),
        (lambda: pz.difference(replace(arc(), centre="MARS"), arc()), "about MARS"),
        (lambda: pz.difference(Ephemeris(arcs=(arc(), replace(arc(), name="Y"))), arc()), "holds X, Y; say which object"),
        (lambda: pz.difference(arc(), lambda dates: (np.zeros(3), np.zeros(3))), r"gives shapes \(3,\)"),
    ],
)
def test_what_cannot_be_compared_is_refused(call, message):
    with pytest.raises(ValueError, match=message):
        call()


def test_the_truth_of_a_tracking_is_an_orbit():
    t = 60.0 * np.arange(121)
    r, v = propagate_kepler(R, V, MU, t)
    forces = earth.Forces(degree=2, bodies=(), tides=(), relativity=False)
    position = pz.Sensor("position", {"px": "x", "py": "y", "pz": "z"})
    problem = pz.Problem(
        forces.model([position]),
        pz.Gaussian(np.concatenate([R, V]), [1.0] * 6),
        stations=[pz.Station("own", "position", [1.0, 1.0, 1.0])],
        parameters=forces.values,
        functions=forces.functions(START),
        epoch=START,
    )
    tracking = pz.Tracking(t, r, None, np.hstack([r, v]), START)
    found = pz.difference((problem, tracking), arc(offset=(1.0, -2.0, 3.0)))
    assert_allclose(found.rms, [1, 2, 3], atol=1e-8)
    assert found.covered is None
    with pytest.raises(ValueError, match="has no truth"):
        pz.difference((problem, pz.Tracking(t, r, None, None, START)), arc())
    plane, simulated = pz.load("b612-range")
    with pytest.raises(ValueError, match="b612-range is no orbit about the Earth: its states are x, y, vx, vy"):
        pz.difference((plane, simulated), arc())
