"""Directions and rates as parts of a problem: pairs, noise, what is asked for; and a real pass of one radar."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

import piazzi as pz
from piazzi import earth
from piazzi.determination import measured
from piazzi.determination.directions import _by_times
from piazzi.determination.document import document
from piazzi.formats import Observations, Segment

EPOCH = pz.Epoch("2016-02-13T12:00:00 UTC")
SITE = earth.Station.geodetic("RADAR", 0.4, 1.0, 100.0)


def rows(kinds, t, sigma=1e-4, **segment):
    kind = np.array([sorted(set(kinds)).index(k) for k in kinds])
    return Observations(
        epoch=EPOCH,
        t=t,
        value=np.linspace(0.1, 0.9, len(t)),
        kinds=tuple(sorted(set(kinds))),
        kind=kind,
        participants=("RADAR", "SAT"),
        station=0,
        object=1,
        segments=(Segment("UTC", **segment),),
        sigma=sigma,
        correlation=np.where(np.arange(len(t)) % 2 == 1, 0.5, np.nan),
        tag=3,
    )


def test_azimuth_and_elevation_of_one_time_are_one_row():
    found = measured(rows(["azimuth", "elevation"] * 3, np.repeat([0.0, 10.0, 20.0], 2)), [SITE])
    assert found.tracking.values.shape == (3, 2) and (found.rows >= 0).all()
    noise = np.asarray(found.stations[0].noise)
    assert noise == pytest.approx(1e-8 * np.array([[1.0, 0.5], [0.5, 1.0]]))
    assert any("free of refraction" in text for text in found.assumed)


def test_a_direction_with_one_angle_has_the_other_missing():
    found = measured(rows(["right_ascension", "declination", "declination"], [0.0, 0.0, 5.0], angles="astrometric"), [SITE])
    assert np.isnan(found.tracking.values).sum() == 1 and found.rows[1].tolist()[0] == -1


@pytest.mark.parametrize(
    ("kinds", "told", "says"),
    [
        (["right_ascension", "declination"], {}, "--angles"),
        (["range_rate_averaged"] * 2, {"way": "two-way", "range_is": "half"}, "--interval"),
        (["range_rate_averaged"] * 2, {"way": "two-way", "range_is": "half", "interval": 10.0}, "--interval-reference"),
        (["doppler"] * 2, {}, "Doppler shifts of a path that the file does not say"),
        (["doppler"] * 2, {"way": "two-way"}, "at which frequency Doppler shifts were measured"),
    ],
)
def test_what_is_open_is_asked_for(kinds, told, says):
    with pytest.raises(ValueError, match=says):
        measured(rows(kinds, [0.0, 0.0], **told), [SITE])


def test_rates_have_their_count():
    told = {"way": "two-way", "range_is": "half", "interval": 30.0, "interval_reference": "end"}
    found = measured(rows(["range_rate_averaged"] * 2, [0.0, 60.0], **told), [SITE])
    assert found.stations[0].numbers["count"] == 30.0
    assert len(measured(rows(["range_rate"] * 2, [0.0, 60.0], way="two-way", range_is="half"), [SITE]).stations) == 1


@pytest.mark.slow
def test_geos_3_by_one_radar(data_dir, tmp_path):
    """The first pass of Vallado's example 10-4: within 200 m and 3.5 m/s of the book's answer."""
    (tmp_path / "kaena.toml").write_text("""[[stations]]
name = "932"
latitude = 21.572056
longitude = -158.266578
height = "300.2 m"
bias = { range = 80.0, azimuth = "0.0081 deg", elevation = "0.0045 deg" }
sigma = { range = 92.5, azimuth = "0.0224 deg", elevation = "0.0139 deg" }
""")
    guess = "x=5975.2904km y=2568.6400km z=3120.5845km vx=3.983846km/s vy=-2.071159km/s vz=-5.917095km/s"
    found = pz.determine(
        data_dir / "earth" / "geos3" / "GEOS6a.INP",
        stations=[tmp_path / "kaena.toml"],
        guess=f"{guess} epoch=1995-01-29T02:38:37Z frame=EME2000",
        epoch="1995-01-29T02:38:37 UTC",
        frame="EME2000",
    )
    assert found.determined
    book = np.array([5748607.0, 2679932.4, 3442790.2, 4330.460, -1922.874, -5726.562])
    off = found.orbit.at() - book
    assert np.linalg.norm(off[:3]) < 200.0 and np.linalg.norm(off[3:]) < 3.5


@pytest.mark.slow
def test_half_a_day_of_geos_3(data_dir, tmp_path):
    """Two passes of 7734.OBS: within the book's sigmas as noise; as biases of each pass with a noise that the rows show.

    The printed sigmas are 25 times too large for noise.  Answer: one that was computed by another program of the first pass.
    """
    lines = (data_dir / "earth" / "geos3" / "7734.OBS").read_text().splitlines(keepends=True)
    (tmp_path / "half.obs").write_text("".join(line for line in lines if line[9:14] == "95029"))
    place = 'name = "932"\nlatitude = 21.572056\nlongitude = -158.266578\nheight = "300.2 m"\n'
    bias = 'bias = { range = 80.0, azimuth = "0.0081 deg", elevation = "0.0045 deg" }\n'
    (tmp_path / "kaena.toml").write_text(f"[[stations]]\n{place}{bias}")
    guess = "x=5975.2904km y=2568.6400km z=3120.5845km vx=3.983846km/s vy=-2.071159km/s vz=-5.917095km/s"
    common = {
        "repair": "exponent", "stations": [tmp_path / "kaena.toml"],
        "guess": f"{guess} epoch=1995-01-29T02:38:37Z frame=EME2000",
        "epoch": "1995-01-29T02:38:37 UTC", "frame": "EME2000",
    }  # fmt: skip
    book = pz.determine(tmp_path / "half.obs", sigma=["range=92.5m", "azimuth=0.0224deg", "elevation=0.0139deg"], **common)
    assert ranges_left(book) < 60.0
    biases = "bias.range.932/pass=92.5m bias.azimuth.932/pass=0.0224deg bias.elevation.932/pass=0.0139deg"
    found = pz.determine(
        tmp_path / "half.obs", sigma=["range=5m", "azimuth=0.01deg", "elevation=0.01deg"], estimate=biases, **common
    )
    assert ranges_left(found) < 6.0
    off = found.orbit.at()[:3] - np.array([5748730.0, 2679900.0, 3442700.0])
    P = found.orbit.covariance()[:3, :3] + 100.0**2 * np.eye(3)  # the other answer is of one pass with such biases, to 0.1 km
    assert off @ np.linalg.solve(P, off) < 16.3  # chi-square of 3 at 99.9 %
    assert any("mended" in text for text in found.setup.assumed)


def ranges_left(found):
    """RMS of the residuals of ranges that were used, m."""
    (one,) = [group for group in document(found)["residuals"] if group["component"] == "range"]
    return one["rms"]


def test_sigmas_of_times_move_directions_along_their_motion():
    """A direction that moves at a constant rate is uncertain along it by the rate times the sigma of the time."""
    t, rate = np.array([0.0, 60.0, 150.0, 9000.0]), np.array([2e-4, -1e-4])
    values = np.array([6.28, 0.3]) + t[:, None] * rate * [1.0, 1.0]
    values[:, 0] = np.remainder(values[:, 0], 2.0 * np.pi)
    across = np.cos(values[:, 1])
    added = _by_times(t[[2, 0, 1, 3]], values[[2, 0, 1, 3]], np.array([0.5, 0.5, np.nan, 0.5]), across[[2, 0, 1, 3]])
    for k, i in ((0, 2), (1, 0)):
        along = 0.5 * rate * [across[i], 1.0]
        assert_allclose(added[k], np.outer(along, along), rtol=1e-9)
    assert not added[2:].any()  # no sigma of its time, and no row near it
