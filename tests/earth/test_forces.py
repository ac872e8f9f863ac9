"""Forces about the Earth: each against its textbook formula, partials against differences, laws of conservation."""

from dataclasses import replace

import numpy as np
import pytest

import piazzi as pz
from piazzi import earth

EPOCH = pz.Epoch("2016-02-13T16:00:00 UTC")
X = np.array([6.6e6, 1.1e6, -1.5e6, 900.0, 5000.0, 5500.0])
T = 1234.5
COEFFICIENTS = {"cr_a_m": 0.02, "cd_a_m": 0.01, "radial": 1e-7, "along": 2e-7, "cross": 3e-7}
ALL = earth.Forces(degree=4, radiation="cannonball", drag="exponential", empirical=("constant",))
GM_SUN, GM_MOON, C = 1.32712440041279419e20, 4.902800118e12, 299792458.0


@pytest.fixture(autouse=True)
def _plain(monkeypatch):
    monkeypatch.setenv("PIAZZI_JIT", "0")  # the same source uncompiled


def problem(forces=ALL, x=X, **changes):
    values = forces.values | {name: value for name, value in COEFFICIENTS.items() if name in forces.parameters}
    given = {"parameters": values, "functions": forces.functions(EPOCH), "epoch": EPOCH, "prior_time": 0.0}
    return pz.Problem(forces.model(), pz.Gaussian(x, [1.0] * 6), **given | changes)


def alone(switch, x=X, t=T):
    """What the force of a switch does."""
    p = problem(x=x)
    off = replace(p, parameters={**p.parameters, switch: 0.0})
    assert p.spec("transition", "rates") is off.spec("transition", "rates")  # nothing is compiled for it
    return (p.dynamics(x, t) - off.dynamics(x, t))[3:]


def body(name, t=T):
    return earth.body(name, EPOCH + t)[0]


def test_gravity_is_the_field_turned_with_the_earth():
    forces = earth.Forces(degree=8, bodies=(), tides=(), relativity=False)
    W = earth.rotation("GCRF", "ITRF", EPOCH + T)
    expected = W.T @ earth.Gravity("EGM2008", 8).value(*(W @ X[:3]))
    np.testing.assert_allclose(problem(forces).dynamics(X, T)[3:], expected, rtol=1e-13)


def test_degree_0_is_two_bodies():
    forces = earth.Forces(degree=0, bodies=(), tides=(), relativity=False)
    a = problem(forces, integrator=pz.RungeKutta8(20)).step(X, 600.0)[0]
    expected = np.concatenate(pz.propagate_kepler(X[:3], X[3:], 3.986004415e14, 600.0))
    np.testing.assert_allclose(a, expected, rtol=1e-11)


def test_degree_2_is_j2_in_symbols():
    field = earth.gravity_field("EGM2008")
    c = np.zeros((3, 3))
    c[0, 0], c[2, 0] = 1.0, field.c[2, 0]
    only = replace(field, c=c, s=np.zeros((3, 3)))
    forces = earth.Forces(only, degree=2, bodies=(), tides=(), relativity=False)
    W = earth.rotation("GCRF", "ITRF", EPOCH + T)
    J2 = -field.c[2, 0] * np.sqrt(5.0)
    x, y, z = W @ X[:3]
    r = np.linalg.norm(X[:3])
    k = 1.5 * J2 * (field.radius / r) ** 2
    u = 5.0 * z**2 / r**2
    expected = -field.gm / r**3 * np.array([x * (1 + k * (1 - u)), y * (1 + k * (1 - u)), z * (1 + k * (3 - u))])
    np.testing.assert_allclose(problem(forces).dynamics(X, T)[3:], W.T @ expected, rtol=1e-14)


@pytest.mark.parametrize(("name", "gm"), [("sun", GM_SUN), ("moon", GM_MOON)])
def test_third_bodies(name, gm):
    s = body(name)
    d = s - X[:3]
    expected = gm * (d / np.linalg.norm(d) ** 3 - s / np.linalg.norm(s) ** 3)
    np.testing.assert_allclose(alone(f"{name}_on"), expected, atol=1e-14)


def test_the_tide_is_the_gradient_of_its_potential():
    def potential(r):
        total = 0.0
        for name, gm in (("sun", GM_SUN), ("moon", GM_MOON)):
            s = body(name)
            cosine = r @ s / (np.linalg.norm(r) * np.linalg.norm(s))
            scale = gm / np.linalg.norm(s) * (6378136.3 / np.linalg.norm(s)) ** 2 * (6378136.3 / np.linalg.norm(r)) ** 3
            total += 0.3019 * scale * (1.5 * cosine**2 - 0.5)
        return total

    h = 1e3
    expected = [(potential(X[:3] + h * e) - potential(X[:3] - h * e)) / (2 * h) for e in np.eye(3)]
    np.testing.assert_allclose(alone("tides_on"), expected, rtol=1e-5, atol=1e-14)


def test_the_permanent_tide_is_counted_once():
    free = earth.gravity_field("EGM2008")
    zero = free.in_tide_system("zero_tide")
    a, b = earth.Forces(free), earth.Forces(zero)
    assert a.field.c[2, 0] == pytest.approx(b.field.c[2, 0], abs=1e-20)
    assert earth.Forces(zero, tides=()).field.c[2, 0] == zero.c[2, 0]


def test_a_field_that_changes_is_that_of_the_epoch(data_dir):
    path = data_dir / "earth" / "gravity" / "eigen-6s-truncated"
    data = earth.Forces(path, degree=2).functions(EPOCH)["field"].field
    assert data.c[2, 0] == earth.read_gravity(path).at(EPOCH).c[2, 0] != earth.read_gravity(path).c[2, 0]


def test_another_field_is_the_same_model(data_dir):
    other = earth.Forces(data_dir / "earth" / "gravity" / "eigen-6s-truncated", 20, tides=("solid",))
    assert other.field.radius != earth.Forces().field.radius
    assert other.model() == earth.Forces(degree=2).model()


def test_relativity():
    r, v, gm = X[:3], X[3:], 3.986004415e14
    R = np.linalg.norm(r)
    expected = gm / (C**2 * R**3) * ((4 * gm / R - v @ v) * r + 4 * (r @ v) * v)
    np.testing.assert_allclose(alone("relativity_on"), expected, atol=2e-14)


def test_sunlight_and_shadow():
    """In the light the whole Sun, behind the Earth none, and between the part that the limb leaves of its disc."""
    s = body("sun")
    sun = s / np.linalg.norm(s)
    side = np.cross(sun, [0.0, 0.0, 1.0])
    side /= np.linalg.norm(side)
    a, R = 6.957e8, 26.5e6
    force = 1361.0 / C * 149597870700.0**2 * 0.02

    def lit(angle):
        place = R * (np.cos(angle) * -sun + np.sin(angle) * side)
        d = s - place
        got = alone("radiation_on", np.concatenate([place, X[3:]]))
        np.testing.assert_allclose(np.cross(got, d) / np.linalg.norm(d), 0.0, atol=1e-13)
        apart = np.arccos(np.clip(-place @ d / (R * np.linalg.norm(d)), -1, 1))
        part = -(got @ d) * np.linalg.norm(d) / force
        return part, apart, np.arcsin(a / np.linalg.norm(d))

    assert lit(1.0)[0] == pytest.approx(1.0, abs=1e-6)
    assert lit(0.1)[0] == pytest.approx(0.0, abs=1e-6)
    disc_of_earth = np.arcsin(6378137.0 / R)
    for angle in disc_of_earth + np.array([-3e-3, 0.0, 2e-3]):
        part, apart, disc = lit(angle)
        grid = np.linspace(-disc, disc, 3001)  # the Sun's disc in pieces, and those that the Earth's leaves
        u, w = np.meshgrid(grid, grid)
        within = u**2 + w**2 < disc**2
        seen = within & ((apart + u) ** 2 + w**2 > disc_of_earth**2)
        assert part == pytest.approx(seen.sum() / within.sum(), abs=2e-4)


def test_drag():
    W = earth.rotation("GCRF", "ITRF", EPOCH + T)
    h = earth.position_to_geodetic(W @ X[:3])[2]
    wind = X[3:] - np.cross(W.T @ [0, 0, 7.292115e-5], X[:3])
    expected = -0.5 * 0.01 * 3.725e-12 * np.exp((400e3 - h) / 58515.0) * np.linalg.norm(wind) * wind
    np.testing.assert_allclose(alone("drag_on"), expected, rtol=2e-6)  # 0.1 m of the height
    assert earth.Forces(drag="exponential", air_height=820e3).values["air_density"] == pytest.approx(
        1.170e-14 * np.exp(-20 / 124.64)
    )


def test_constants_along_the_axes_of_the_orbit():
    R = X[:3] / np.linalg.norm(X[:3])
    N = np.cross(X[:3], X[3:])
    N /= np.linalg.norm(N)
    expected = 1e-7 * R + 2e-7 * np.cross(N, R) + 3e-7 * N
    np.testing.assert_allclose(alone("empirical_on"), expected, atol=1e-14)


def test_partials_are_differences():
    p = problem()

    def slope(i, step):
        e = step * np.eye(6)[i]
        d = [(p.dynamics(X + k * e, T) - p.dynamics(X - k * e, T)) / (2 * k * step) for k in (1, 2)]
        return (4 * d[0] - d[1]) / 3

    F = p.dynamics_jacobian(X, T)
    for i, step in enumerate([10.0] * 3 + [0.1] * 3):
        np.testing.assert_allclose(F[:, i], slope(i, step), atol=2e-15 if i < 3 else 5e-14)


def test_energy_changes_by_what_the_turn_of_the_field_does():
    """dE = omega . dh, also where the axis goes with precession; E - omega . h is kept but for that."""
    forces = earth.Forces(degree=6, bodies=(), tides=(), relativity=False)
    eop = earth.EOP(ut1_utc=0.0)
    p = problem(forces, functions=forces.functions(EPOCH, eop), integrator=pz.RungeKutta8(30))
    field = earth.gravity_field("EGM2008")

    def quantities(x, t):
        W, rate = earth.rotation_rate("GCRF", "ITRF", EPOCH + t, eop)
        turn = W.T @ rate
        omega = np.array([turn[1, 2], turn[2, 0], turn[0, 1]])
        return x[3:] @ x[3:] / 2 - potential(field, W @ x[:3], 6), omega, np.cross(x[:3], x[3:])

    x, first = X, quantities(X, 0.0)
    work, before = 0.0, first
    for k in range(5):
        x = p.step(x, 1000.0, 1000.0 * k)[0]
        energy, omega, h = quantities(x, 1000.0 * (k + 1))
        work += (omega + before[1]) / 2 @ (h - before[2])
        before = energy, omega, h
        assert abs(energy - first[0] - work) < 1e-12 * abs(first[0])
        assert abs((energy - omega @ h) / (first[0] - first[1] @ first[2]) - 1) < 1e-9
    assert abs(energy / first[0] - 1) > 1e-8  # the field is not the same all around


def test_energy_and_spin_are_kept_in_a_field_that_is_the_same_all_around():
    """E - omega . h of a rotating axisymmetric field, and each of both, but for the tilt of the axis in an hour."""
    field = earth.gravity_field("EGM2008")
    zonal = replace(field, c=np.where(np.eye(121)[0] > 0, field.c, 0.0), s=0.0 * field.s)
    forces = earth.Forces(zonal, degree=6, bodies=(), tides=(), relativity=False)
    eop = earth.EOP(ut1_utc=0.0)
    p = problem(forces, functions=forces.functions(EPOCH, eop), integrator=pz.RungeKutta8(30))

    def quantities(x, t):
        W, rate = earth.rotation_rate("GCRF", "ITRF", EPOCH + t, eop)
        turn = W.T @ rate
        omega = np.array([turn[1, 2], turn[2, 0], turn[0, 1]])
        energy, h = x[3:] @ x[3:] / 2 - potential(zonal, W @ x[:3], 6), np.cross(x[:3], x[3:])
        return np.array([energy - omega @ h, energy, omega @ h])

    first, x = quantities(X, 0.0), X
    for k in range(4):
        x = p.step(x, 1000.0, 1000.0 * k)[0]
        np.testing.assert_allclose(quantities(x, 1000.0 * (k + 1)), first, rtol=1e-8)


def test_a_negative_coefficient_is_a_fault_of_the_model():
    lines = earth.coefficient_faults({"cd_a_m": -0.004, "cr_a_m": -0.001, "along": -1e-9}, {"cd_a_m": 0.001, "cr_a_m": 0.002})
    assert lines[0].startswith("cd_a_m is -0.004 +- 0.001 m^2/kg, negative: air cannot push a satellite on")
    assert lines[1].endswith("the measurements do not tell its sign")
    assert earth.coefficient_faults({"cd_a_m": 0.004}) == ()


def potential(field, place, degree):
    """The sum of a field's harmonics by SciPy-free Legendre functions of mpmath."""
    from math import factorial, sqrt

    import mpmath

    r = np.linalg.norm(place)
    longitude, sine = np.arctan2(place[1], place[0]), place[2] / r
    total = 0.0
    for n in range(degree + 1):
        for m in range(n + 1):
            size = sqrt((2 - (m == 0)) * (2 * n + 1) * factorial(n - m) / factorial(n + m))
            legendre = float(mpmath.legenp(n, m, sine).real) * (-1) ** m
            waves = field.c[n, m] * np.cos(m * longitude) + field.s[n, m] * np.sin(m * longitude)
            total += (field.radius / r) ** n * size * legendre * waves
    return field.gm / r * total


def test_forces_of_ones_own_are_added():
    forces = earth.Forces(degree=0, bodies=(), tides=(), relativity=False)
    model = forces.model(parameters={"thrust": "estimated"}, added={"vx": "push"}, definitions={"push": "thrust*r/r"})
    p = pz.Problem(
        model, pz.Gaussian(X, [1.0] * 6), parameters={"thrust": pz.Gaussian(0.5, 1.0)}, functions=forces.functions(EPOCH)
    )
    base = problem(forces).dynamics(X, 0.0)
    np.testing.assert_allclose(p.dynamics([*X, 0.5], 0.0)[3:6] - base[3:], [0.5, 0.0, 0.0], atol=1e-14)
    assert p.dynamics_jacobian([*X, 0.5], 0.0)[3, 6] == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"bodies": ("son",)}, "bodies has 'son'; there are sun, mercury, .*; did you mean 'sun'"),
        ({"bodies": "sun"}, r"bodies is 'sun'; it must be a list, such as \['sun'\]"),
        ({"tides": ("ocean",)}, "tides has 'ocean'; there are solid"),
        ({"radiation": True}, "radiation is True; it must be 'cannonball' or False"),
        ({"drag": "jacchia"}, "drag is 'jacchia'; it must be 'exponential' or 'harris-priester' or 'msis' or False"),
        ({"about": "moon"}, "about is 'moon'; it must be 'earth' or 'sun'"),
        ({"about": "sun", "drag": "exponential"}, "drag is 'exponential'; it must be False about the Sun"),
        ({"about": "sun", "tides": ("solid",)}, "tides has 'solid'; there are none about the Sun"),
        ({"nongravitational": ("A1",)}, "nongravitational has 'A1'; there are none about the Earth"),
        ({"relativity": ("lense",)}, "relativity has 'lense'; there are schwarzschild, lense-thirring"),
        ({"drag": "exponential", "air_height": 400.0}, "air_height is 400 m; densities are known from 100e3"),
        ({"degree": 200}, "degree 200 is asked for of EGM2008"),
        ({"empirical": ("upward",)}, "empirical has 'upward'"),
    ],
)
def test_forces_that_cannot_be_are_refused(given, message):
    with pytest.raises(ValueError, match=message):
        earth.Forces(**given)
    with pytest.raises(ValueError, match="added has 'v', which is not a state"):
        ALL.model(added={"v": "1"})


def test_a_sensor_sees_the_satellite_from_its_station():
    forces = earth.Forces(degree=2)
    station = earth.Station.geodetic("Piazzi", np.radians(38.11), np.radians(13.35), 72.0)
    ground = {"qx, qy, qz, ux, uy, uz": "station(t)"}
    seen = pz.Sensor(
        "range",
        {"rho": "d", "rate": "((x - qx)*(vx - ux) + (y - qy)*(vy - uy) + (z - qz)*(vz - uz))/d"},
        definitions=ground | {"d": "sqrt((x - qx)**2 + (y - qy)**2 + (z - qz)**2)"},
    )
    p = pz.Problem(
        forces.model(seen),
        pz.Gaussian(X, [1.0] * 6),
        stations=[pz.Station("Piazzi", "range", [1.0, 1e-6], place=earth.Place(station, EPOCH))],
        parameters=forces.values,
        functions=forces.functions(EPOCH),
        epoch=EPOCH,
        prior_time=0.0,
    )
    fixed = station.position(EPOCH + T)
    fixed = fixed + earth.station_displacement(fixed, EPOCH + T)
    place, velocity = earth.transform(fixed, np.zeros(3), "ITRF", "GCRF", EPOCH + T)
    line = X[:3] - place
    rho, rate = p.measure("Piazzi", X, T)
    assert rho == pytest.approx(np.linalg.norm(line), abs=1e-5)
    assert rate == pytest.approx(line @ (X[3:] - velocity) / np.linalg.norm(line), abs=1e-4)  # the tide moves too
