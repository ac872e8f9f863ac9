"""Orbits of the SGP4 theory: published states, what a wrong set says, and a prior that grows as it is said to."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

import piazzi as pz
from piazzi import earth
from piazzi.formats import Arc
from piazzi.formats.tle import tle_text
from piazzi.orbit import fit_sgp4, orbit_axes, propagate_kepler, read_tle, sgp4_covariance, sgp4_states
from piazzi.orbit.mean_elements import MU

VANGUARD = """VANGUARD 1
1 00005U 58002B   00179.78495062  .00000023  00000-0  28098-4 0  4753
2 00005  34.2682 348.7242 1859667 331.7664  19.3264 10.82419157413667
"""
ROUND = """1 25544U 98067A   16343.50000000  .00000000  00000-0  00000-0 0  9990
2 25544  51.6400  10.0000 0001000  20.0000  30.0000 15.00000000 00000
"""


def with_checksums(text):
    lines = [line[:68] for line in text.splitlines()]
    sums = [sum(int(c) if c.isdigit() else c == "-" for c in line) % 10 for line in lines]
    return "\n".join(f"{line}{total}" for line, total in zip(lines, sums, strict=True)) + "\n"


def test_states_published_with_the_theory():
    """AIAA 2006-6753, object 00005 at its epoch and 360 minutes later."""
    mean = read_tle(VANGUARD)
    assert mean.name == "VANGUARD 1"
    assert mean.identifier == "1958-002B"
    r, v = sgp4_states(mean, [mean.epoch, mean.epoch + 360 * 60.0])
    assert_allclose(r[0] / 1e3, [7022.46529266, -1400.08296755, 0.03995155], atol=1e-7)
    assert_allclose(v[0] / 1e3, [1.893841015, 6.405893759, 4.534807250], atol=1e-9)
    assert_allclose(r[1] / 1e3, [-7154.03120202, -3783.17682504, -3536.19412294], atol=1e-7)
    assert_allclose(v[1] / 1e3, [4.741887409, -4.151817765, -2.093935425], atol=1e-9)


def test_one_date_or_many_in_any_frame():
    mean = read_tle(VANGUARD)
    dates = [mean.epoch + 60.0 * k for k in range(-3, 4)]
    teme, gcrf = sgp4_states(mean, dates), sgp4_states(mean, dates, "GCRF")
    turned = earth.transform(*teme, "TEME", "GCRF", dates)
    assert_allclose(gcrf[0], turned[0], atol=1e-7)
    assert_allclose(gcrf[1], turned[1], atol=1e-10)
    assert_allclose(sgp4_states(mean, dates[2], "GCRF")[0], gcrf[0][2], atol=1e-7)


def test_a_leap_second_counts():
    """Over the end of 2016 a day has 86401 seconds: the object moves on for all of them."""
    mean = read_tle(with_checksums(ROUND.replace("16343.5", "16366.0")))
    assert mean.epoch == pz.Epoch("2016-12-31T00:00:00 UTC")
    r, _ = sgp4_states(mean, [pz.Epoch("2016-12-31T23:59:59 UTC"), pz.Epoch("2017-01-01T00:00:00 UTC")])
    assert np.linalg.norm(r[1] - r[0]) == pytest.approx(2 * 7.6e3, rel=0.02)


def test_a_file_of_many_sets(tmp_path):
    file = tmp_path / "objects.txt"
    file.write_text(VANGUARD + with_checksums(ROUND) + VANGUARD)
    found = pz.read_ephemeris(file)
    assert found.format == "TLE"
    assert [mean.name for mean in found.mean] == ["VANGUARD 1", "25544", "VANGUARD 1"]
    assert found.mean[0] == found.mean[2] == read_tle(VANGUARD)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (VANGUARD.replace("4753", "4754"), "line 2: the checksum is '4', and that of the line is 3"),
        (VANGUARD.replace("28098-4", "2809-4"), "line 2: the line has 68 characters"),
        ("\n".join(VANGUARD.splitlines()[:2]), "line 2: no line 2 follows"),
        ("\n".join(VANGUARD.splitlines()[2:]), "line 1: a line 2 without a line 1"),
        (with_checksums(ROUND.replace("2 25544", "2 25545")), "line 2: line 2 is of object 25545, and line 1 of 25544"),
        (with_checksums(ROUND.replace("51.6400", "5l.6400")), "line 2: the inclination is"),
        (with_checksums(ROUND.replace("16343.5", "16x43.5")), "line 1: the epoch is"),
        (with_checksums(ROUND.replace("16343.5", "16399.5")), "line 1: the day of the epoch is 399"),
        (VANGUARD * 2, "holds 2 two-line element sets"),
        ("", "holds 0 two-line element sets"),
    ],
)
def test_a_wrong_set_says_where_it_is_wrong(text, message):
    with pytest.raises(ValueError, match=message):
        read_tle(text)


def test_what_the_theory_has_no_state_for():
    mean = read_tle(VANGUARD)
    with pytest.raises(ValueError, match="are of the theory SGP4-XP"):
        sgp4_states(replace(mean, theory="SGP4-XP"), mean.epoch)
    with pytest.raises(ValueError, match="have no mean motion"):
        sgp4_states(replace(mean, elements=mean.elements[1:]), mean.epoch)
    low = with_checksums(ROUND.replace("00000-0 0", "99999-1 0").replace("15.00000000", "16.40000000"))
    falling = read_tle(low)
    with pytest.raises(ValueError, match=r"no state of 25544 at 20\d\d-.* UTC: "):
        sgp4_states(falling, falling.epoch + 40 * 86400.0)


def test_the_prior_is_positive_definite_and_grows_along_the_track_as_it_says():
    """Of many states drawn from the prior at the epoch, those of a day later spread as the prior of a day later."""
    mean = read_tle(with_checksums(ROUND))
    r, v = sgp4_states(mean, mean.epoch, "GCRF")
    P = sgp4_covariance(mean, mean.epoch)
    np.linalg.cholesky(P)
    rng = np.random.default_rng(0)
    drawn = np.hstack([r, v]) + rng.multivariate_normal(np.zeros(6), P, 4000, method="cholesky")
    period = 2 * np.pi / dict(mean.elements)["mean_motion"]
    span = period * round(86400 / period)  # whole turns, so that the rest is back where it was
    a = 1 / (2 / np.linalg.norm(r) - v @ v / MU)
    there = propagate_kepler(r, v, MU, 2 * np.pi * np.sqrt(a**3 / MU) * round(86400 / period))
    later, _ = propagate_kepler(drawn[:, :3], drawn[:, 3:], MU, 2 * np.pi * np.sqrt(a**3 / MU) * round(86400 / period))
    spread = (later - there[0]) @ orbit_axes(*there).T
    assert_allclose(spread.std(axis=0)[[0, 2]], 1000, rtol=0.1)
    assert spread.std(axis=0)[1] == pytest.approx(np.hypot(1000, 2000), rel=0.1)
    aged = sgp4_covariance(mean, mean.epoch + span)
    R = orbit_axes(*sgp4_states(mean, mean.epoch + span, "GCRF"))
    assert_allclose(np.sqrt(np.diag(R @ aged[:3, :3] @ R.T)), [1000, np.hypot(1000, 2000), 1000], rtol=0.02)


def rows_of(mean, dates):
    r, v = sgp4_states(mean, dates)
    return Arc(
        epoch=dates[0], t=np.array([d - dates[0] for d in dates]), position=r, velocity=v, frame="TEME", centre="EARTH",
        scale="UTC", name="X",
    )  # fmt: skip


@pytest.mark.parametrize("text", [VANGUARD, ROUND.replace("0001000", "0000000").replace("51.6400", " 0.0000")])
def test_a_fit_to_states_of_the_theory_gives_its_elements(text):
    """Circular and equatorial too, where single angles mean nothing: the positions are the same."""
    mean = read_tle(with_checksums(text) if text is not VANGUARD else text)
    dates = [mean.epoch + 240.0 * k for k in range(-30, 60)]
    found = fit_sgp4(rows_of(mean, dates), epoch=mean.epoch, drag=text is VANGUARD)
    assert found.rms < 1e-3
    assert_allclose(found.residuals, 0, atol=1e-2)
    later = mean.epoch + 86400.0
    assert np.linalg.norm(sgp4_states(found.mean, later)[0] - sgp4_states(mean, later)[0]) < 1.0
    if text is VANGUARD:
        for (_, was), (_, value) in zip(mean.elements, found.mean.elements, strict=True):
            assert value == pytest.approx(was, abs=1e-10)
        assert float(dict(found.mean.said)["BSTAR"]) == pytest.approx(2.8098e-5, abs=1e-9)


def test_fits_to_precise_orbits_are_as_good_as_the_theory_is(data_dir):
    """A few hundred metres, and better than mean elements that are moved a little in any direction."""
    for file, name, bound in (("sp3/nsgf.orb.stella.v00.sp3.gz", None, 250), ("sp3/gps_g01_g05_20150505.sp3", "G01", 150)):
        path = data_dir / "earth" / file
        found = fit_sgp4(path, object=name)
        assert found.rms < bound
        assert pz.difference(path, found.mean, object=name).rms_3d == pytest.approx(found.rms, rel=1e-3)
        for key, value in found.mean.elements:
            for change in (-1e-5, 1e-5):
                moved = dict(found.mean.elements) | {key: value + change * (value if key == "mean_motion" else 1.0)}
                other = replace(found.mean, elements=tuple(moved.items()))
                assert pz.difference(path, other, object=name).rms_3d > found.rms


def test_what_cannot_be_fitted_is_refused():
    mean = read_tle(VANGUARD)
    with pytest.raises(ValueError, match="has 2 rows; 6 mean elements need more"):
        fit_sgp4(rows_of(mean, [mean.epoch, mean.epoch + 60.0]))
    with pytest.raises(ValueError, match="has no rows"):
        fit_sgp4(mean)
    fast = rows_of(mean, [mean.epoch + 60.0 * k for k in range(9)])
    with pytest.raises(ValueError, match="these elements are for ellipses"):
        fit_sgp4(replace(fast, velocity=3 * fast.velocity))


def test_two_line_elements_are_written_as_they_were_read():
    assert tle_text(read_tle(VANGUARD)) == VANGUARD
    mean = fit_sgp4(rows_of(read_tle(VANGUARD), [read_tle(VANGUARD).epoch + 300.0 * k for k in range(40)])).mean
    back = read_tle(tle_text(mean))
    assert_allclose([v for _, v in back.elements], [v for _, v in mean.elements], rtol=0, atol=2e-6)
    assert abs(back.epoch - mean.epoch) < 1e-3
    with pytest.raises(ValueError, match="do not fit into two-line elements"):
        tle_text(replace(mean, elements=(("mean_motion", 10.0), *mean.elements[1:])))


def test_a_prior_without_size_is_refused():
    mean = read_tle(VANGUARD)
    with pytest.raises(ValueError, match="all must be positive"):
        sgp4_covariance(mean, mean.epoch, sigma=(0.0, 1.0, 1.0))
