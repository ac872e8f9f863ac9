"""Small forces: tides by frequency and of the pole, relativity, the Moon's shadow, waves of a revolution, Harris-Priester."""

from dataclasses import replace

import numpy as np
import pytest

import piazzi as pz
from piazzi import earth
from piazzi.earth.atmosphere import TABLE, HarrisPriester
from piazzi.earth.force_options import SUNLIGHT
from piazzi.earth.tidal_harmonics import TidalHarmonics

EPOCH = pz.Epoch("2016-02-13T16:00:00 UTC")
X = np.array([6.6e6, 1.1e6, -1.5e6, 900.0, 5000.0, 5500.0])
T = 1234.5
C, GM_SUN, GM_MOON, GM_EARTH = 299792458.0, 1.32712440041279419e20, 4.902800118e12, 3.98600435507e14
WAVES = [f"{axis}_{wave}" for axis in ("radial", "along", "cross") for wave in ("sin", "cos")]
ALL = earth.Forces(
    degree=2,
    radiation="cannonball",
    drag="harris-priester",
    empirical=("once-per-rev",),
    tides=("solid", "k1", "pole"),
    relativity=("schwarzschild", "lense-thirring", "de-sitter"),
    shadows=("earth", "moon"),
)


@pytest.fixture(autouse=True)
def _plain(monkeypatch):
    monkeypatch.setenv("PIAZZI_JIT", "0")  # the same source uncompiled


def problem(forces=ALL, x=X, epoch=EPOCH, **values):
    own = {name: 0.01 * (i + 1) for i, name in enumerate(forces.parameters) if name not in forces.values}
    return pz.Problem(
        forces.model(),
        pz.Gaussian(x, [1.0] * 6),
        parameters={**forces.values, **own, **values},
        functions=forces.functions(epoch),
        epoch=epoch,
        prior_time=0.0,
    )


def alone(switch, x=X, t=T, forces=ALL, epoch=EPOCH, **values):
    """What the force of a switch does; without the large ones, which would take its digits."""
    large = dict.fromkeys(("sun_on", "moon_on", "tides_on", "drag_on", "radiation_on", "empirical_on"), 0.0)
    p = problem(forces, x, epoch, **{**large, **values, switch: 1.0})
    off = replace(p, parameters={**p.parameters, switch: 0.0})
    assert p.spec("transition", "rates") is off.spec("transition", "rates")  # nothing is compiled for it
    return (p.dynamics(x, t) - off.dynamics(x, t))[3:]


def gradient_of_degree_2(coefficients):
    """Of the field of degree 2 that these coefficients alone are, less its central term: by the sum of harmonics."""
    c20, c21, s21, c22, s22 = coefficients
    c, s = np.array([[1.0, 0, 0], [0, 0, 0], [c20, c21, c22]]), np.array([[0.0, 0, 0], [0, 0, 0], [0, s21, s22]])
    field = replace(earth.gravity_field("EGM2008"), gm=GM_EARTH, radius=6378136.6, c=c * 1e9, s=s * 1e9)
    W = earth.rotation("GCRF", "ITRF", EPOCH + T)
    central = replace(field, c=np.diag([1e9, 0, 0]), s=0.0 * s)
    place = W @ X[:3]
    pulls = [np.array(earth.Gravity(f, 2).value(*place)) for f in (field, central)]
    return W.T @ (pulls[0] - pulls[1]) * 1e-9


@pytest.mark.parametrize("kind", ["k1", "pole"])
def test_tides_as_coefficients_are_a_field_of_degree_2(kind):
    coefficients = TidalHarmonics(kind, EPOCH).at([EPOCH + T])[0]
    np.testing.assert_allclose(TidalHarmonics(kind, EPOCH).value(T), coefficients, atol=1e-17)
    np.testing.assert_allclose(alone(f"{kind}_on"), gradient_of_degree_2(coefficients), atol=4e-15)


def test_the_tide_of_the_pole():
    """Eq. 6.22 of the IERS Conventions at the pole's place of that day, to digits of EOP C04."""
    m1, m2 = 0.0115 - (0.0550 + 0.001677 * 16.12), -(0.3812 - (0.3205 + 0.003460 * 16.12))
    eop = earth.EOP(ut1_utc=0.0, xp=0.0115, yp=0.3812)
    c21, s21 = TidalHarmonics("pole", EPOCH, eop).at([EPOCH])[0, 1:3]
    assert c21 == pytest.approx(-1.333e-9 * (m1 + 0.0115 * m2), abs=1e-14)
    assert s21 == pytest.approx(-1.333e-9 * (m2 - 0.0115 * m1), abs=1e-14)


def test_the_tide_of_k1_follows_sidereal_time():
    """Of all lines, K1 and its neighbour are the largest: their sum is fitted by least squares over nineteen years."""
    rng = np.random.default_rng(3)
    epochs = [EPOCH + float(t) for t in rng.uniform(0, 18.6 * 365.25 * 86400, 3000)]
    none = earth.EOP(ut1_utc=0.0)
    found = TidalHarmonics("k1", EPOCH, none).at(epochs)
    import erfa

    from piazzi.earth import scales
    from piazzi.earth.epoch import pairs

    tt = scales.days(*pairs(epochs))
    angle = erfa.gmst06(tt[0], tt[1] - 69.184 / 86400, *tt)  # UT1 to some seconds
    design = np.column_stack([np.sin(angle + np.pi), np.cos(angle + np.pi)])
    c21, s21 = (np.linalg.lstsq(design, column, rcond=None)[0] for column in found[:, 1:3].T)
    # besides the line's own, what k21 has beyond k20, with the height of K1 and the factor A1 of eq. 6.8e
    beyond = -3.1274e-8 * 0.36870 * np.array([0.29830 - 0.30190, -0.00144])
    np.testing.assert_allclose(c21, np.array([470.9e-12, -30.2e-12]) + beyond, atol=4e-12)
    np.testing.assert_allclose(s21, [-c21[1], c21[0]], atol=4e-12)  # K1 turns against the Earth, circularly


def test_lense_thirring():
    r, v = X[:3], X[3:]
    J = earth.rotation("GCRF", "ITRF", EPOCH + T).T @ [0, 0, 9.8e8]
    R = np.linalg.norm(r)
    expected = 2 * GM_EARTH / (C**2 * R**3) * (3 / R**2 * np.cross(r, v) * (r @ J) + np.cross(v, J))
    np.testing.assert_allclose(alone("lense_thirring_on"), expected, atol=4e-15)


def test_de_sitter_is_the_geodesic_precession():
    R, V = (-np.array(a) for a in earth.body("sun", EPOCH + T))
    expected = 3 * np.cross(np.cross(V, -GM_SUN * R / (C**2 * np.linalg.norm(R) ** 3)), X[3:])
    np.testing.assert_allclose(alone("de_sitter_on"), expected, atol=4e-15)
    rate = 180 / np.pi * 3.6e6 * 365.25 * 86400 * np.linalg.norm(ALL.functions(EPOCH)["geodesic"].value(T))
    near = np.linalg.norm(R) / 149597870700.0
    assert rate == pytest.approx(19.19 / near**2.5, rel=0.02)  # milliarcseconds in a year at the mean distance


def test_the_moons_shadow_takes_what_its_disc_covers():
    """In a line with Sun and Moon, annular or total, beside it partial: counted by pixels of the Sun's disc."""
    sun, moon = (earth.body(name, EPOCH + T)[0] for name in ("sun", "moon"))
    line = (moon - sun) / np.linalg.norm(moon - sun)
    side = np.cross(line, [0.0, 0.0, 1.0])
    side /= np.linalg.norm(side)
    for distance in (3.0e8, 4.2e8):  # total, annular
        for angle in (0.0, 1e-4, 3e-3, 6e-3, 9.2e-3, 0.02):
            place = moon + distance * (np.cos(angle) * line + np.sin(angle) * side)
            x = np.concatenate([place, X[3:]])
            d, m = sun - place, moon - place
            a, b = np.arcsin(6.957e8 / np.linalg.norm(d)), np.arcsin(1.7374e6 / np.linalg.norm(m))
            apart = np.arctan2(np.linalg.norm(np.cross(d, m)), d @ m)
            grid = np.linspace(-a, a, 2001)
            u, w = np.meshgrid(grid, grid)
            within = u**2 + w**2 < a**2
            seen = (within & ((u - apart) ** 2 + w**2 > b**2)).sum() / within.sum()
            full = alone("radiation_on", x, moon_shadow_on=0.0)
            got = alone("radiation_on", x, moon_shadow_on=1.0)
            assert got @ full / (full @ full) == pytest.approx(seen, abs=3e-4)


def test_waves_of_a_revolution():
    """By the argument of latitude of the elements."""
    r, v = X[:3], X[3:]
    h = np.cross(r, v)
    n = np.cross([0, 0, 1.0], h)
    u = np.arctan2(np.cross(n, r) @ h / np.linalg.norm(h), n @ r)
    R, N = r / np.linalg.norm(r), h / np.linalg.norm(h)
    axes = dict(zip(("radial", "along", "cross"), (R, np.cross(N, R), N), strict=True))
    for name in WAVES:
        axis, wave = name.split("_")
        got = alone("empirical_on", **{**dict.fromkeys(WAVES, 0.0), name: 1.0})
        np.testing.assert_allclose(got, {"sin": np.sin(u), "cos": np.cos(u)}[wave] * axes[axis], atol=1e-14)
    flat = np.array([7e6, 0.0, 0.0, 0.0, 7.5e3, 0.0])  # no node: no wave, and numbers
    np.testing.assert_array_equal(alone("empirical_on", flat), 0.0)
    assert earth.Forces(empirical=("along_cos", "constant")).empirical == ("radial", "along", "cross", "along_cos")


def test_harris_priester_goes_through_its_table_with_one_slope():
    air = HarrisPriester()
    heights = TABLE[:, 0] * 1e3
    for h, *density in TABLE:
        np.testing.assert_allclose(np.exp(air.value(h * 1e3)), np.array(density) * 1e-12, rtol=1e-12)
    for h in heights[1:-1]:
        np.testing.assert_allclose(air.derivatives(h - 1e-6), air.derivatives(h + 1e-6), rtol=1e-6)
    every = np.array([air.value(h) for h in np.linspace(100e3, 1000e3, 2001)])
    assert (np.diff(every, axis=0) < 0.0).all()  # no waves between heights of the table
    for i, h in enumerate(heights[:-1]):  # near the exponential between heights that the model was published with
        middle = 0.5 * (h + heights[i + 1])
        np.testing.assert_allclose(
            np.exp(air.value(middle)), np.sqrt(TABLE[i, 1:] * TABLE[i + 1, 1:]) * 1e-12, rtol=0.45 if not i else 0.08
        )


@pytest.mark.parametrize(("height", "exponent"), [(420e3, 2.0), (700e3, 6.0), (1500e3, 2.0), (90e3, 2.0)])
def test_drag_by_harris_and_priester(height, exponent):
    sun = earth.body("sun", EPOCH + T)[0]
    W = earth.rotation("GCRF", "ITRF", EPOCH + T)
    r = np.array([0.3, -0.8, 0.52])
    r *= (6378137.0 + height) / np.linalg.norm(r)
    x = np.concatenate([r, X[3:]])
    for _ in range(3):
        r *= 1 + (height - earth.position_to_geodetic(W @ r)[2]) / np.linalg.norm(r)
        x[:3] = r
    lag = np.radians(30.0)
    turn = np.array([[np.cos(lag), -np.sin(lag), 0], [np.sin(lag), np.cos(lag), 0], [0, 0, 1]])
    cosine = r @ turn @ sun / (np.linalg.norm(r) * np.linalg.norm(sun))
    low, high = np.exp(HarrisPriester().value(min(max(height, 100e3), 1000e3)))
    if height > 1000e3:  # on with the last scale heights of the table, 40 km apart
        low, high = (d * (a / b) ** ((height - 1000e3) / 40e3) for d, a, b in ((low, 1.15, 1.56), (high, 1.81, 2.36)))
    if height < 100e3:
        low, high = (d * (497400 / 24900) ** 0.5 for d in (low, high))
    density = low + (high - low) * (0.5 + 0.5 * cosine) ** (exponent / 2)
    wind = x[3:] - np.cross(W.T @ [0, 0, 7.292115e-5], r)
    expected = -0.5 * 0.01 * density * np.linalg.norm(wind) * wind
    got = alone("drag_on", x, cd_a_m=0.01, air_exponent=exponent)
    np.testing.assert_allclose(got, expected, rtol=2e-6 if height > 100e3 else 2e-5, atol=4e-15)  # 0.1 m of the height


def test_partials_are_differences():
    p = problem(**dict.fromkeys(WAVES, 1e-7))

    def slope(i, step):
        e = step * np.eye(6)[i]
        d = [(p.dynamics(X + k * e, T) - p.dynamics(X - k * e, T)) / (2 * k * step) for k in (1, 2)]
        return (4 * d[0] - d[1]) / 3

    F = p.dynamics_jacobian(X, T)
    for i, step in enumerate([10.0] * 3 + [0.1] * 3):
        np.testing.assert_allclose(F[:, i], slope(i, step), atol=2e-15 if i < 3 else 5e-14)


def test_the_conventional_field():
    """C20 of table 6.2 in its own tide system, its rate, and C21, S21 of the secular pole."""
    field = earth.gravity_field("IERS2010")
    zero = field.in_tide_system("zero_tide")
    assert zero.c[2, 0] == pytest.approx(-0.48416948e-3, abs=1e-14)
    later = field.at(pz.Epoch("2010-01-01T12:00:00 TT"))
    years = 3653 / 365.25
    assert later.c[2, 0] - field.c[2, 0] == pytest.approx(11.6e-12 * years, rel=1e-4)
    assert later.c[3, 0] - field.c[3, 0] == pytest.approx(4.9e-12 * years, rel=1e-4)
    x, y = np.radians(np.array([0.0550 + 0.001677 * years, 0.3205 + 0.003460 * years]) / 3600)
    c20, c22, s22 = field.c[2, 0], field.c[2, 2], field.s[2, 2]
    assert later.c[2, 1] == pytest.approx(np.sqrt(3) * x * c20 - x * c22 + y * s22, abs=1e-14)
    assert later.s[2, 1] == pytest.approx(-np.sqrt(3) * y * c20 - y * c22 - x * s22, abs=1e-14)


LIT = np.array([1.6e7, 1.8e7, -1.0e7, -2600.0, 1700.0, -1200.0])  # the Sun stands to the side


def test_sunlight_departs_from_that_on_a_sphere_along_axes_of_sun_and_earth():
    shares = dict(zip(SUNLIGHT, (0.03, -0.02, 0.05, 0.01, -0.04, 0.02, 0.015, -0.025), strict=True))
    forces = replace(ALL, empirical=("once-per-rev", "sunlight"), shadows=("earth",))
    found = alone("radiation_on", LIT, forces=forces, cr_a_m=0.02, **shares)
    sphere = alone("radiation_on", LIT, forces=forces, cr_a_m=0.02, **dict.fromkeys(SUNLIGHT, 0.0))
    r, v = LIT[:3], LIT[3:]
    e = earth.body("sun", EPOCH + T)[0] - r
    e /= np.linalg.norm(e)
    up, ahead = r / np.linalg.norm(r), np.cross(np.cross(r, v), r)
    ahead /= np.linalg.norm(ahead)
    panel = np.cross(e, up)
    y = panel / np.hypot(np.linalg.norm(panel), 0.05)
    c, s = e @ up, e @ ahead
    toward = shares["light_d_cos"] * c + shares["light_d_sin"] * s
    toward += shares["light_d_cos2"] * (c**2 - s**2) + shares["light_d_sin2"] * 2 * c * s
    across = shares["light_b"] + shares["light_b_cos"] * c + shares["light_b_sin"] * s
    share = toward * e + shares["light_y"] * y + across * np.cross(e, y)
    size = np.linalg.norm(sphere)
    assert size > 8e-8
    np.testing.assert_allclose(sphere, -size * e, rtol=0, atol=1e-5 * size)
    np.testing.assert_allclose(found - sphere, size * share, rtol=0, atol=1e-6 * size)


def test_sunlight_in_shares_needs_sunlight_and_has_partials_that_are_differences():
    with pytest.raises(ValueError, match=r"light_y.*radiation 'cannonball'"):
        earth.Forces(empirical=("sunlight",))
    forces = earth.Forces(degree=2, tides=(), radiation="cannonball", empirical=("sunlight",))
    p = problem(forces, LIT, cr_a_m=0.02, **dict.fromkeys(SUNLIGHT, 0.1))
    F, step = p.dynamics_jacobian(LIT, T), np.array([1e4] * 3 + [10.0] * 3)
    for i, h in enumerate(step):
        d = h * np.eye(6)[i]
        difference = (p.dynamics(LIT + d, T) - p.dynamics(LIT - d, T)) / (2 * h)
        off = replace(p, parameters={**p.parameters, **dict.fromkeys(SUNLIGHT, 0.0)})
        others = (off.dynamics(LIT + d, T) - off.dynamics(LIT - d, T)) / (2 * h)
        own = F[3:, i] - off.dynamics_jacobian(LIT, T)[3:, i]
        np.testing.assert_allclose(own, (difference - others)[3:], rtol=1e-4, atol=1e-20)
