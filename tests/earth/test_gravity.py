"""A gravity field in kernels: against symbols, 50 digits, differences and Laplace's equation; lanes, one state, uncompiled."""

import math

import mpmath as mp
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from piazzi import earth
from piazzi.earth.fields import gravity_field
from piazzi.earth.gravity import SIGNATURE
from tests.kernels.outside import called

R = 6378136.3
PLACES = np.array(
    [
        [6.9e6, 1e5, -2e5],
        [-3e6, 4e6, 4.3e6],
        [1.0, -2.0, 6.4e6],  # a pole
        [0.0, 0.0, 6.6e6],
        [0.0, 0.0, -6356752.3],
        [1e-300, 0.0, 6.5e6],
        [R, 0.0, 0.0],
        [0.0, -2.6e7, 1e3],
    ]
)
DEGREES = [(0, 0), (1, 1), (2, 2), (7, 7), (8, 8), (20, 20), (70, 70), (20, 8), (20, 7), (17, 0), (70, 8)]


@pytest.fixture(scope="module")
def field():
    return gravity_field("EGM2008")


def direct(field, place, degree):
    """Acceleration and gradient by 50 digits: harmonics of the textbook, derived by x, y, z as polynomials of solid harmonics.

    V_nm = (R/r)^(n+1) P_nm(sin phi) e^(i m lambda) by Cunningham's recursion, whose derivatives are sums of V of higher degree
    (Montenbruck and Gill, Satellite Orbits, 3.2.4-3.2.5): another method than the kernel's, unnormalised.
    """
    with mp.workdps(50):
        x, y, z = (mp.mpf(float(v)) for v in place)
        r2, rad = x * x + y * y + z * z, mp.mpf(field.radius)
        top = degree + 2
        V = {(0, 0): mp.mpc(rad / mp.sqrt(r2))}
        for m in range(top + 1):
            if m:
                V[m, m] = (2 * m - 1) * (rad / r2) * mp.mpc(x, y) * V[m - 1, m - 1]
            for n in range(m + 1, top + 1):
                older = V.get((n - 2, m), mp.mpc(0))
                V[n, m] = ((2 * n - 1) * z * rad / r2 * V[n - 1, m] - (n + m - 1) * rad * rad / r2 * older) / (n - m)

        def by_plus(c):  # (d/dx + i d/dy), in a field sum Re(conj(C) V) with coefficients by (n, m), m of any sign
            out = {}
            for (n, m), a in c.items():
                add(out, (n + 1, m + 1), -a)
            return out

        def by_minus(c):
            out = {}
            for (n, m), a in c.items():
                add(out, (n + 1, m - 1), a * (n - m + 2) * (n - m + 1))
            return out

        def by_z(c):
            out = {}
            for (n, m), a in c.items():
                add(out, (n + 1, m), -a * (n - m + 1))
            return out

        def add(out, key, a):
            out[key] = out.get(key, 0) + a / rad

        def value(c):  # V_(n,-m) = (-1)^m (n-m)!/(n+m)! conj V_nm
            total = mp.mpc(0)
            for (n, m), a in c.items():
                if m >= 0:
                    total += a * V[n, m]
                elif -m <= n:
                    total += a * (-1) ** m * mp.factorial(n + m) / mp.factorial(n - m) * mp.conj(V[n, -m])
            return total

        # the potential is Re sum (C - i S) V; as an analytic sum it may be derived term by term
        coefficients = {}
        for n in range(degree + 1):
            for m in range(n + 1):
                norm = mp.sqrt(mp.factorial(n - m) / mp.factorial(n + m) * (2 * n + 1) * (1 if m == 0 else 2))
                coefficients[n, m] = norm * mp.mpc(field.c[n, m], -field.s[n, m]) * mp.mpf(field.gm) / rad
        plus, minus = by_plus(coefficients), by_minus(coefficients)
        dz = by_z(coefficients)

        def x_y(p, q):
            """d/dx and d/dy of the real part, from the sums of (d/dx + i d/dy) and (d/dx - i d/dy)."""
            P, Q = value(p), value(q)
            return ((P + Q) / 2).real, ((P - Q) / (2j)).real

        ax, ay = x_y(plus, minus)
        a = [ax, ay, value(dz).real]
        pp, pm, mm = value(by_plus(plus)), value(by_minus(plus)), value(by_minus(minus))
        zp, zm = value(by_plus(dz)), value(by_minus(dz))
        xx, yy = ((pp + 2 * pm + mm) / 4).real, (-(pp - 2 * pm + mm) / 4).real
        xy = ((pp - mm) / 4j).real
        xz, yz = ((zp + zm) / 2).real, ((zp - zm) / 2j).real
        zz = value(by_z(dz)).real
        return np.array([float(v) for v in a]), np.array(
            [[float(v) for v in row] for row in ((xx, xy, xz), (xy, yy, yz), (xz, yz, zz))]
        )


@pytest.mark.parametrize("degree", [8, 70])
@pytest.mark.parametrize("k", [1, 2, 4, 6])
def test_against_fifty_digits_near_the_poles_and_at_the_surface(field, degree, k):
    a, G = direct(field, PLACES[k], degree)
    gravity = earth.Gravity(field, degree=degree)
    size = np.linalg.norm(a)
    assert_allclose(gravity.value(*PLACES[k]), a, rtol=0, atol=4e-15 * math.sqrt(degree) * size)
    assert_allclose(gravity.derivatives(*PLACES[k]), G, rtol=0, atol=1e-13 * np.linalg.norm(G))


def test_degree_two_zonal_is_the_symbolic_oblateness(field):
    import sympy as sp

    x, y, z = sp.symbols("x y z", real=True)
    r = sp.sqrt(x**2 + y**2 + z**2)
    c = np.zeros((3, 3))
    c[0, 0], c[2, 0] = 1.0, field.c[2, 0]
    from dataclasses import replace

    gravity = earth.Gravity(replace(field, c=c, s=np.zeros((3, 3))), degree=2)
    J2 = -sp.Float(float(field.c[2, 0]), 30) * sp.sqrt(5)
    mu, rad = sp.Float(field.gm, 30), sp.Float(field.radius, 30)
    U = mu / r * (1 - J2 * (rad / r) ** 2 * (3 * z**2 / r**2 - 1) / 2)
    a = [sp.diff(U, q) for q in (x, y, z)]
    G = sp.Matrix(a).jacobian([x, y, z])
    for place in PLACES[:3]:
        at = dict(zip((x, y, z), (sp.Float(float(v), 40) for v in place), strict=True))
        wanted = np.array([float(e.subs(at).evalf(30)) for e in a])
        gradient = np.array(G.subs(at).evalf(30).tolist(), dtype=float)
        assert_allclose(gravity.value(*place), wanted, rtol=0, atol=1e-14 * np.linalg.norm(wanted))
        assert_allclose(gravity.derivatives(*place), gradient, rtol=0, atol=1e-14 * np.linalg.norm(gradient))


@pytest.mark.parametrize("degree", [2, 20, 70])
def test_gradient_is_that_of_differences_and_has_no_trace(degree):
    gravity, h = earth.Gravity(degree=degree), 20.0
    for place in PLACES[:3]:
        ahead, behind = (np.array([gravity.value(*(place + s * h * e)) for e in np.eye(3)]).T for s in (1, -1))
        G = gravity.derivatives(*place)
        assert_allclose(G, (ahead - behind) / (2 * h), rtol=0, atol=1e-8 * np.linalg.norm(G))
        assert abs(np.trace(G)) <= 1e-12 * np.linalg.norm(G)
        assert_array_equal(G, G.T)


def test_a_gradient_of_less_degree_is_that_of_the_smaller_field():
    whole, less, small = earth.Gravity(degree=20), earth.Gravity(degree=20, gradient_degree=8), earth.Gravity(degree=8)
    for place in PLACES:
        assert_allclose(less.value(*place), whole.value(*place), rtol=0, atol=1e-14 * 9.8)
        assert_allclose(less.derivatives(*place), small.derivatives(*place), rtol=0, atol=1e-14 * 3e-6)


def random_field(degree):
    """Coefficients by Kaula's rule: what a real field of that degree looks like."""
    rng = np.random.default_rng(degree)
    n = np.arange(degree + 1.0)[:, None]
    c, s = np.tril(rng.normal(size=(2, degree + 1, degree + 1))) * 1e-5 / np.maximum(n, 1) ** 2
    c[0, 0], c[1], s[1], s[:, 0] = 1.0, 0.0, 0.0, 0.0
    return earth.GravityField("random", 3.986004415e14, R, c, s, "unknown", "test")


@pytest.mark.parametrize("degree", [360, pytest.param(720, marks=pytest.mark.slow)])
def test_high_degrees_stay_finite_and_harmonic_everywhere(degree):
    """Latitudes to a millimetre from a pole, at the surface and high above it; neighbours agree with the gradient."""
    gravity = earth.Gravity(random_field(degree), degree=degree)
    for latitude in (0.0, 0.7, 1.4, 1.55, math.pi / 2 - 1e-4, math.pi / 2 - 1e-10, math.pi / 2, -math.pi / 2):
        for r in (R, 4e7):
            place = r * np.array([math.cos(latitude) * 0.6, math.cos(latitude) * 0.8, math.sin(latitude)])
            a, G, h = np.array(gravity.value(*place)), gravity.derivatives(*place), 1.0
            assert np.isfinite(a).all() and np.isfinite(G).all()
            assert abs(np.trace(G)) <= 1e-12 * np.linalg.norm(G)
            step = np.array([h, -h, 0.5 * h])
            change = np.array(gravity.value(*(place + step))) - np.array(gravity.value(*(place - step)))
            assert_allclose(change / 2, G @ step, rtol=0, atol=1e-6 * np.linalg.norm(G))


@pytest.mark.parametrize("lanes", [8, 4])
@pytest.mark.parametrize("partials", [False, True])
def test_one_state_lanes_and_uncompiled_code_agree(partials, lanes):
    """One compilation serves every degree; data may stand anywhere in the block."""
    with called(SIGNATURE, partials=partials, lanes=lanes) as f:
        for degree, gradient in DEGREES:
            gravity = earth.Gravity(degree=degree, gradient_degree=gradient)
            data = np.concatenate([np.full(24, np.nan), gravity.block()])
            one, several = f.one(PLACES, data, 24), f.lanes(PLACES, data, 24)
            plain = np.array([np.append(gravity.value(*p), gravity.derivatives(*p) if partials else []) for p in PLACES])
            size = np.linalg.norm(plain[:, :3], axis=1, keepdims=True)
            for other in (several, plain):
                assert (np.abs(one - other)[:, :3] <= 4e-15 * math.sqrt(max(degree, 1)) * size).all()
                if partials:
                    norm = np.linalg.norm(plain[:, 3:], axis=1, keepdims=True)
                    assert (np.abs(one - other)[:, 3:] <= 1e-13 * norm).all()
        off = earth.Gravity(on=False).block()
        assert not f.one(PLACES, off).any() and not f.lanes(PLACES, off).any()


def test_a_switch_turns_it_off():
    off = earth.Gravity(degree=20, on=False)
    assert off.value(7e6, 0.0, 0.0) == (0.0, 0.0, 0.0)
    assert not off.derivatives(7e6, 0.0, 0.0).any()
    assert off.signature == earth.Gravity(degree=2).signature
    assert off.checksum != earth.Gravity(degree=20).checksum


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"degree": 121}, "degree 121 is asked for of EGM2008 .*, which goes to 120"),
        ({"degree": -1}, "degree is -1; it must be a whole number"),
        ({"degree": 2.5}, "degree is 2.5; it must be a whole number"),
        ({"degree": True}, "degree is True"),
        ({"degree": 8, "gradient_degree": 20}, "gradient_degree 20 is asked for beyond the field's, 8"),
        ({"model": "EGM1066"}, "gravity model 'EGM1066' is neither in the package"),
    ],
)
def test_bad_fields_are_refused(given, message):
    with pytest.raises(ValueError, match=message):
        earth.Gravity(**given)


def test_the_number_of_coordinates_is_checked():
    with pytest.raises(ValueError, match="function gravity takes 3 arguments, not 2"):
        earth.Gravity(degree=2).value(7e6, 0.0)
