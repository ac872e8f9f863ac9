"""Orbits from a few observations: against 50 digits, against printed answers, and what too little of them determines."""

import re
from functools import cache

import erfa
import mpmath as mp
import numpy as np
import pytest
from numpy.testing import assert_allclose

from piazzi import Epoch, earth
from piazzi import orbit as iod
from tests.references import exact_orbits as exact

MU = 398600.4418
SITE = np.array([[4055.0, 2748.0, 4074.0], [3956.0, 2888.0, 4074.0], [3905.0, 2957.0, 4074.0]])


def seen(r, v, times, observers):
    """Directions of a body whose state at the second time is known."""
    L = iod.propagate_kepler(r, v, MU, times - times[1])[0] - observers
    return L / np.linalg.norm(L, axis=1)[:, None]


def orbits(n, seed=0):
    """Bodies above the horizon of their observers, from low orbits to geostationary ones and hyperbolas."""
    rng = np.random.default_rng(seed)
    while n:
        r = rng.normal(size=3)
        r *= 6378 * rng.uniform(1.1, 6.5) / np.linalg.norm(r)
        v = np.cross(rng.normal(size=3), r)
        v *= np.sqrt(MU / np.linalg.norm(r)) * rng.uniform(0.85, 1.5) / np.linalg.norm(v)
        times = np.cumsum([0.0, *rng.uniform(0.4, 1.0, 2)]) * 0.12 * np.sqrt(np.linalg.norm(r) ** 3 / MU)
        if (r - SITE[1]) @ SITE[1] > 0.3 * np.linalg.norm(r - SITE[1]) * np.linalg.norm(SITE[1]):
            n -= 1
            yield r, v, times


def fifty_digits(times, L, guess):
    """The state at the second time whose motion meets all three directions."""
    with mp.workdps(exact.DIGITS):
        t, R = [mp.mpf(float(x)) for x in times], [exact.vector(x) for x in SITE]
        across = [[exact.vector(row) for row in np.linalg.svd(x[None])[2][1:]] for x in L]
        lines = [exact.vector(x) for x in L]
        for sides, line in zip(across, lines, strict=True):
            for j, side in enumerate(sides):  # exactly across the line
                sides[j] = side - line * (exact.dot(side, line) / exact.dot(line, line))

        def equations(x):
            r, v = mp.matrix(x[:3]), mp.matrix(x[3:])
            out = []
            for k in range(3):
                d = exact.propagate(r, v, mp.mpf(MU), t[k] - t[1])[0] - R[k]
                out += [exact.dot(d, side) for side in across[k]]
            return out

        return np.array([float(x) for x in exact.solve(equations, guess)])


@cache
def six():
    """Six orbits with their directions, and what fifty digits say of them."""
    found = [(r, v, times, seen(r, v, times, SITE)) for r, v, times in orbits(6)]
    return [(r, times, L, fifty_digits(times, L, np.hstack([r, v]))) for r, v, times, L in found]


@cache
def answers_of(method):
    """All answers of a method to each of them."""
    return [method(times, L, SITE, MU) for _, times, L, _ in six()]


@pytest.mark.parametrize("method", [iod.gauss, iod.double_r, iod.gooding])
def test_the_orbit_is_among_the_answers_and_that_of_fifty_digits(method):
    for (r, _, _, state), told in zip(six(), answers_of(method), strict=True):
        near = [o for o in told if np.linalg.norm(o.r - r) < 1e-3 * np.linalg.norm(r)]
        assert near, r
        assert_allclose(near[0].r, state[:3], rtol=1e-9, atol=1e-9 * np.linalg.norm(r))
        assert_allclose(near[0].v, state[3:], rtol=1e-9, atol=1e-9 * np.linalg.norm(state[3:]))
        assert near[0].residual < 1e-11


@pytest.mark.parametrize("method", [iod.double_r, iod.gooding])
def test_all_answers_meet_their_directions_and_are_different(method):
    for (r, *_), answers in zip(six(), answers_of(method), strict=True):
        assert any(np.linalg.norm(o.r - r) < 1e-4 * np.linalg.norm(r) for o in answers)
        for i, o in enumerate(answers):
            assert o.residual < 1e-9
            assert (o.ranges > 0).all()
            assert all(np.linalg.norm(o.r - other.r) > 1e-7 * np.linalg.norm(o.r) for other in answers[:i])


def mp_polynomial(d1, d2, C, R2):
    """Positive roots r of the equation of degree 8, by mpmath alone."""
    coefficients = [1, 0, -(d1**2 + 2 * C * d1 + R2), 0, 0, -2 * d2 * (C + d1), 0, 0, -(d2**2)]
    roots = mp.polyroots(coefficients, maxsteps=500, extraprec=400)
    return sorted(mp.re(x) for x in roots if abs(mp.im(x)) < mp.mpf(10) ** -30 * abs(x) and mp.re(x) > 0)


def test_roots_of_gauss_and_laplace_are_those_of_fifty_digits():
    """The equations of the series, written once more: ranges of the first for every root, state of the second."""
    for r, v, times in orbits(5, seed=2):
        L = seen(r, v, times, SITE)
        with mp.workdps(50):
            t1, t3 = (mp.mpf(float(times[k])) - mp.mpf(float(times[1])) for k in (0, 2))
            lines, R = ([exact.vector(row) for row in rows] for rows in (L, SITE))
            lines = [x / exact.norm(x) for x in lines]
            span = t3 - t1
            c = [(t3 / span, t3 * (span**2 - t3**2) / (6 * span)), (-t1 / span, -t1 * (span**2 - t1**2) / (6 * span))]
            M = mp.matrix(3, 3)
            for j in range(3):
                for i in range(3):
                    M[i, j] = lines[j][i]
            N = [mp.lu_solve(M, x) for x in R]
            d1 = c[0][0] * N[0][1] - N[1][1] + c[1][0] * N[2][1]
            d2 = mp.mpf(MU) * (c[0][1] * N[0][1] + c[1][1] * N[2][1])
            C, R2 = exact.dot(lines[1], R[1]), exact.dot(R[1], R[1])
            expected = [float(d1 + d2 / x**3) for x in mp_polynomial(d1, d2, C, R2)]
        found = iod.gauss(times, L, SITE, MU, improve=False)
        assert_allclose([o.ranges[1] for o in found], [x for x in expected if x > 0], rtol=1e-9)
        with mp.workdps(50):

            def parabola(x, t1=t1, t3=t3):
                a, b = (x[0] - x[1]) / t1, (x[2] - x[1]) / t3
                return (t3 * a - t1 * b) / (t3 - t1), 2 * (b - a) / (t3 - t1)

            (dl, ddl), (dR, ddR) = parabola(lines), parabola(R)
            across = exact.cross(lines[1], dl)
            D = exact.dot(ddl, across)
            d1, d2 = -exact.dot(ddR, across) / D, -mp.mpf(MU) * exact.dot(R[1], across) / D
            states = []
            for x in mp_polynomial(d1, d2, C, R2):
                rho, u = d1 + d2 / x**3, mp.mpf(MU) / x**3
                rate = exact.dot(ddR + u * R[1], exact.cross(lines[1], ddl)) / (2 * D)
                if rho > 0:
                    states.append([float(y) for y in [*(R[1] + rho * lines[1]), *(dR + rate * lines[1] + rho * dl)]])
        found = iod.laplace(times, L, SITE, MU)
        assert len(found) == len(states)
        for orbit, state in zip(found, states, strict=True):
            assert_allclose(np.hstack([orbit.r, orbit.v]), state, rtol=1e-9)


def test_laplace_nears_the_orbit_as_the_arc_gets_short():
    r, v, times = next(orbits(1, seed=8))
    spin = np.array([0, 0, 7.2921e-5])
    errors = []
    for part in (0.02, 0.01):
        t = times[1] + part * (times - times[1])
        R = (
            SITE[1]
            + np.outer(t - t[1], np.cross(spin, SITE[1]))
            + np.outer((t - t[1]) ** 2 / 2, np.cross(spin, np.cross(spin, SITE[1])))
        )
        given = np.cross(spin, SITE[1]), np.cross(spin, np.cross(spin, SITE[1]))
        answers = iod.laplace(t, seen(r, v, t, R), R, MU, *given)
        errors.append(min(np.linalg.norm(o.r - r) for o in answers))
    assert errors[1] < 0.7 * errors[0] < 0.05 * np.linalg.norm(r)


def test_gibbs_and_herrick_gibbs_against_fifty_digits():
    for r, v, times in orbits(5, seed=3):
        positions = iod.propagate_kepler(r, v, MU, times - times[1])[0]
        found = iod.gibbs(positions, MU), iod.herrick_gibbs(positions, times, MU)
        with mp.workdps(50):
            a, b, c = (exact.vector(x) for x in positions)
            la, lb, lc = (exact.norm(x) for x in (a, b, c))
            N = la * exact.cross(b, c) + lb * exact.cross(c, a) + lc * exact.cross(a, b)
            D = exact.cross(a, b) + exact.cross(b, c) + exact.cross(c, a)
            S = (lb - lc) * a + (lc - la) * b + (la - lb) * c
            first = mp.sqrt(mp.mpf(MU) / (exact.norm(N) * exact.norm(D))) * (exact.cross(D, b) / lb + S)
            t = [mp.mpf(float(x)) for x in times]
            x, y, z = t[2] - t[1], t[2] - t[0], t[1] - t[0]
            g = [mp.mpf(MU) / (12 * length**3) for length in (la, lb, lc)]
            second = -x * (1 / (z * y) + g[0]) * a + (x - z) * (1 / (z * x) + g[1]) * b + z * (1 / (x * y) + g[2]) * c
        for mine, reference in zip(found, (first, second), strict=True):
            assert_allclose(mine, [float(x) for x in reference], rtol=1e-9)
        assert_allclose(found[0], v, rtol=1e-9)


def test_range_with_all_rates_is_the_way_back_from_a_state():
    r, v, R, V = np.random.default_rng(1).normal(size=(4, 7, 3))
    d, w = r - R, v - V
    rho = np.linalg.norm(d, axis=1)
    lon, lat = np.arctan2(d[:, 1], d[:, 0]), np.arcsin(d[:, 2] / rho)
    rate = np.sum(d * w, axis=1) / rho
    flat = d[:, 0] ** 2 + d[:, 1] ** 2
    dlon = (d[:, 0] * w[:, 1] - d[:, 1] * w[:, 0]) / flat
    dlat = (w[:, 2] - rate * np.sin(lat)) / np.sqrt(flat)
    found = iod.range_to_state(rho, iod.direction(lon, lat), R, rate, iod.direction_rate(lon, lat, dlon, dlat), V)
    assert_allclose(found[0], r, atol=1e-13)
    assert_allclose(found[1], v, atol=1e-12)


def test_three_ranges_against_fifty_digits():
    stations = np.array([[6378.0, 0, 0], [6100.0, 1800.0, 300.0], [6000.0, 500.0, 2100.0]])
    V, r, v = np.cross([0, 0, 7.292e-5], stations), np.array([9000.0, 1500.0, 1800.0]), np.array([1.0, 5.0, -3.0])
    d = r - stations
    ranges = np.linalg.norm(d, axis=1)
    rates = np.sum(d * (v - V), axis=1) / ranges
    (up, up_v), (down, _) = iod.three_ranges(ranges, stations, rates, V)
    with mp.workdps(50):
        R, rho = [exact.vector(x) for x in stations], [mp.mpf(float(x)) for x in ranges]

        def equations(x):
            return [exact.dot(x - s, x - s) - p * p for s, p in zip(R, rho, strict=True)]

        for mine in (up, down):
            assert_allclose(mine, [float(x) for x in exact.solve(equations, mine)], rtol=1e-9)
    assert_allclose(up, r, rtol=1e-12)
    assert_allclose(up_v, v, rtol=1e-10)
    n = np.cross(stations[1] - stations[0], stations[2] - stations[0])
    assert (up - stations[0]) @ n == pytest.approx(-(down - stations[0]) @ n)
    assert iod.three_ranges(ranges, stations)[0][1] is None


@pytest.mark.parametrize("count", [2, 3, 6])
def test_the_best_orbit_through_radar_plots_is_that_of_the_body(count):
    """Turns and ways around that two positions leave are told apart by range rates, or by a plot between."""
    r, v = np.array([5900.0, 5800.0, 6700.0]), np.array([-4.4, 4.6, 1.5])
    period = 2 * np.pi * np.sqrt((1 / (2 / np.linalg.norm(r) - v @ v / MU)) ** 3 / MU)
    t = np.linspace(0, 2.3 * period, count)
    V = np.cross([0, 0, 7.2921e-5], SITE[1])
    position, velocity = iod.propagate_kepler(r, v, MU, t)
    d = position - SITE[1]
    rho = np.linalg.norm(d, axis=1)
    rates = np.sum(d * (velocity - V), axis=1) / rho
    found = iod.radar(t, rho, d, SITE[1], MU, rates, V)
    assert len(found) > 6
    assert found[0].residual < 1e-9
    assert found[1].residual > 1e-4
    assert_allclose(found[0].v, v, rtol=1e-9, atol=1e-9)
    if count > 2:
        assert_allclose(iod.radar(t, rho, d, SITE[1], MU)[0].v, v, rtol=1e-9, atol=1e-9)


def test_printed_answers_of_three_positions():
    r = [[0, 0, 6378.137], [0, -4464.696, -5102.509], [0, 5740.323, 3189.068]]
    assert_allclose(iod.gibbs(r, MU), [0, 5.531148, -5.191806], atol=1e-6)
    r = [[3419.85564, 6019.82602, 2784.60022], [2935.91195, 6326.18324, 2660.59584], [2434.95202, 6597.38674, 2521.52311]]
    answer = iod.herrick_gibbs(r, [0, 76.48, 153.04], MU)
    assert_allclose(answer, [-6.441557227511062, 3.777559606719521, -1.7205675602414345], atol=1e-7)


# ---- printed answers of three directions ----


def published(data_dir):
    """Number, printed answer and rows of the published cases; a row's numbers with half a unit of their last digits."""
    found = {}
    for line in (data_dir / "earth" / "iod" / "anglestest.dat").read_text().splitlines():
        if heading := re.match(r"#\s*(\d+)\s(.*)", line):
            rows = found[int(heading[1])] = (heading[2], [])
        elif not line.startswith("#") and len(words := re.findall(r"-?\d+\.?\d*", line)) >= 11:
            rows[1].append((np.array([float(w) for w in words[:11]]), [half_unit(w) for w in words[:11]], "x" in line))
    return found


def half_unit(word):
    return 0.5 * 10.0 ** -len(word.partition(".")[2]) if "." in word else 0.0


def mean_sidereal(rows, ellipsoid="WGS84", mu=MU):
    """Observers by the mean sidereal time of 1982 alone, as books did it: no precession, no pole, UT1 = UTC."""
    times, R = [], []
    for day, month, year, hour, minute, second, lat, lon, alt, *_ in rows:
        start, part = 2400000.5 + erfa.cal2jd(int(year), int(month), int(day))[1], hour * 3600 + minute * 60 + second
        angle = erfa.gmst82(start, part / 86400)
        x, y, z = earth.geodetic_to_position(np.radians(lat), np.radians(lon), alt * 1e3, ellipsoid) / 1e3
        R.append([np.cos(angle) * x - np.sin(angle) * y, np.sin(angle) * x + np.cos(angle) * y, z])
        times.append((start - 2450000) * 86400 + part)
    return np.array(times), np.array(R), mu


def escobal(rows):
    """The same with the constants of Escobal's book: k = 0.07436574 in Earth radii and minutes, a flattening of 1/298.3."""
    return mean_sidereal(rows, (6378137.0, 1 / 298.3), 0.07436574**2 * 6378.137**3 / 3600)


def with_orientation(rows):
    """Observers in EME2000 with the example's own orientation of the Earth."""
    eop = earth.EOP(ut1_utc=-0.609641, xp=0.137495, yp=0.342416, dx=0, dy=0)
    epochs = [
        Epoch(f"{int(r[2])}-{int(r[1]):02d}-{int(r[0]):02d}T00:00:00 UTC") + (r[3] * 3600 + r[4] * 60 + r[5]) for r in rows
    ]
    places = np.array([earth.geodetic_to_position(np.radians(r[6]), np.radians(r[7]), r[8] * 1e3) for r in rows])
    return np.array([e - epochs[1] for e in epochs]), earth.transform(places, None, "ITRF", "EME2000", epochs, eop)[0] / 1e3, MU


def answer(reduction, rows, like):
    """The orbit whose elements are next to a printed one: a, e, i and node, the latter in degrees."""
    times, R, mu = reduction(rows)
    L = iod.direction(np.radians(rows[:, 9]), np.radians(rows[:, 10]))
    found = [iod.Keplerian().from_state(o.r, o.v, mu)[:4] for o in iod.gooding(times, L, R, mu)]
    found = [np.array([*x[:2], *(np.degrees(x[2:]) % 360)]) for x in found]
    return min(found, key=lambda x: abs(x[0] - like[0]))


# Of 3, 5 and 6 no reduction at hand gives the printed answer; from 9 on the answer is of a fit to more than three directions
PRINTED = {  # number: reduction, which three rows, a, e, i and node with half a unit of their last digit
    0: (with_orientation, "x", (12246.023, 0.2, 40.0, 330.0), (5e-4, 5e-5, 5e-3, 5e-4)),
    1: (mean_sidereal, (5, 9, 14), (12756.274, 0.2, 62.3, 40.0), (5e-4, 5e-6, 5e-5, 5e-3)),
    2: (mean_sidereal, (0, 1, 2), (8306.247, 0.16419, 32.878, 136.53), (5e-4, 5e-6, 5e-4, 5e-3)),
    4: (escobal, (0, 1, 2), (63781.37, 0.3, 45.0, 45.0), (5e-3, 5e-6, 5e-5, 5e-3)),
    7: (mean_sidereal, (0, 5, 10), (26627.957, 0.6506, 64.28, 121.56), (5e-4, 5e-6, 5e-5, 5e-3)),
    8: (mean_sidereal, (0, 4, 8), (42163.95, 0.001, 3.3, 40.0), (5e-3, 5e-6, 5e-5, 5e-3)),
}


@pytest.mark.parametrize("number", PRINTED)
def test_the_printed_orbit_is_among_the_answers(data_dir, number):
    """Within what half a unit of the last digit of every input, and of what is printed, moves it."""
    reduction, which, printed, digits = PRINTED[number]
    rows = published(data_dir)[number][1]
    rows = [r for r in rows if r[2]] if which == "x" else [rows[i] for i in which]
    values, halves = np.array([r[0] for r in rows]), np.array([r[1] for r in rows])
    found = answer(reduction, values, printed)
    room = np.array(digits)
    for i, j in np.argwhere(halves > 0):
        moved = values.copy()
        moved[i, j] += halves[i, j]
        room += np.abs(answer(reduction, moved, printed) - found)
    assert (np.abs(found - printed) <= room).all(), (found, printed, room)


def test_published_gauss_without_improvement(data_dir):
    rows = np.array([r[0] for r in published(data_dir)[0][1] if r[2]])
    times, R, _ = with_orientation(rows)
    L = iod.direction(np.radians(rows[:, 9]), np.radians(rows[:, 10]))
    (found,) = iod.gauss(times, L, R, MU, improve=False)
    # half a unit of the directions, 9e-9 rad, moves the place by metres; the velocity by the series, and that of Gibbs
    assert_allclose(found.r, [6313.395577554, 5247.523665415, 6467.724780944], atol=0.02)
    assert_allclose(found.v, [-4.101302835, 4.699692868, 1.692547818], atol=2e-5)
    assert_allclose(iod.gibbs(found.positions, MU), [-4.1855, 4.7885, 1.7217], atol=1e-4)


def test_real_geostationary_satellite_of_2023():
    epochs = [Epoch(f"2023-06-09T{t} UTC") for t in ("17:04:59.10", "17:10:50.66", "17:16:21.09")]
    right = np.radians(15 * np.array([16 + 5 / 60 + 51.20 / 3600, 16 + 11 / 60 + 43.73 / 3600, 16 + 17 / 60 + 15.10 / 3600]))
    declination = -np.radians(6 + np.array([31, 31, 32]) / 60 + np.array([44.22, 52.36, 0.03]) / 3600)
    place = earth.geodetic_to_position(np.radians(43.05722), np.radians(76.971667), 2735.0)
    R = earth.transform(np.tile(place, (3, 1)), None, "ITRF", "EME2000", epochs)[0] / 1e3
    times = np.array([e - epochs[1] for e in epochs])
    given = times, iod.direction(right, declination), R, MU
    # half a unit of the last digits of the directions moves a by 53 km, e by 1e-3 and i by 7e-3 deg
    for answers, printed in (
        (iod.gooding(*given), (42400.56, 0.004505, 0.09138)),
        (iod.gauss(*given, improve=False), (42389.74, 0.004325, 0.09158)),
        (iod.laplace(*given), (42394.50, 0.004441, 0.09000)),
    ):
        (x,) = [iod.Keplerian().from_state(o.r, o.v, MU) for o in answers]
        assert x[0] == pytest.approx(printed[0], abs=0.5)
        assert x[1] == pytest.approx(printed[1], abs=3e-6)
        assert np.degrees(x[2]) == pytest.approx(printed[2], abs=2e-4)


# ---- too little, or nothing ----

TIMES = np.array([0.0, 300.0, 600.0])
LINES = iod.direction([0.1, 0.5, 0.8], [0.1, 0.2, -0.3])


@pytest.mark.parametrize("method", [iod.gauss, iod.laplace, iod.double_r, iod.gooding])
@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"times": TIMES[:2], "directions": LINES[:2]}, r"two directions are four numbers of the six.*pair of ranges.*three"),
        ({"times": TIMES[:1], "directions": LINES[:1]}, "one direction gives two numbers"),
        ({"times": np.zeros(3)}, "all three directions are at one time, 0"),
        ({"times": TIMES[::-1]}, "times are 600, 300, 0; they must increase"),
        ({"times": np.arange(4.0), "directions": np.ones((4, 3))}, "there are 4 directions; this method takes three"),
        ({"directions": LINES * np.nan}, "not finite"),
        ({"directions": np.zeros((3, 3))}, "a direction is zero"),
        ({"directions": LINES[[0, 0, 1]], "observers": SITE[0]}, "two of the directions are equal"),
        ({"observers": SITE[:2]}, r"observers have shape \(2, 3\)"),
        ({"mu": 0.0}, "mu is 0"),
    ],
)
def test_too_few_or_bad_directions_are_refused(method, change, message):
    with pytest.raises(ValueError, match=message) as error:
        method(**({"times": TIMES, "directions": LINES, "observers": SITE, "mu": MU} | change))
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("method", [iod.gauss, iod.laplace])
def test_directions_in_one_plane_are_refused(method):
    flat = iod.direction([0.1, 0.5, 0.8], [0.0, 0.0, 0.0])
    with pytest.raises(ValueError, match=r"one plane, in which .* cannot tell the ranges; take double_r or gooding"):
        method(TIMES, flat, SITE, MU)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: iod.gibbs(np.eye(3)[:2], MU), "two positions determine an orbit with the time between them: see lambert"),
        (lambda: iod.gibbs([[7000, 0, 0], [8000, 0, 0], [0, 7000, 0]], MU), "on one line through the centre"),
        (lambda: iod.gibbs(7000 * np.eye(3), MU), "90 deg out of the plane"),
        (lambda: iod.herrick_gibbs(7000 * np.eye(3), [1, 1, 1], MU), "all three positions are at one time"),
        (lambda: iod.herrick_gibbs(7000 * np.eye(3), [1, 3, 2], MU), "must increase"),
        (lambda: iod.radar([0], [1], [[1, 0, 0]], SITE[0], MU), "one plot of range, range-rate and direction is four numbers"),
        (lambda: iod.radar([0, 0], [1, 1], np.eye(3)[:2], SITE[0], MU), "times are 0, 0; they must increase"),
        (lambda: iod.radar([0, 1], [1, -1], np.eye(3)[:2], SITE[0], MU), "range is -1"),
        (lambda: iod.radar([0, 1], [1, 1], np.eye(3)[:2], SITE[0], MU, [1]), r"range rates have shape \(1,\)"),
        (lambda: iod.three_ranges([1, 2], np.eye(3)), "two ranges leave a circle"),
        (lambda: iod.three_ranges([1, 2, 3], [[1, 0, 0], [2, 0, 0], [3, 0, 0]]), "on one line"),
        (lambda: iod.three_ranges([0.1, 0.1, 9], np.eye(3)), "do not meet"),
        (lambda: iod.range_to_state(-1.0, [1, 0, 0], SITE[0], 0, [0, 1, 0], SITE[0]), "range is -1"),
        (lambda: iod.range_to_state(1.0, [2, 0, 0], SITE[0], 0, [0, 1, 0], SITE[0]), "has the length 2"),
        (lambda: iod.range_to_state(1.0, [1, 0, 0], SITE[0], 0, [1, 1, 0], SITE[0]), "a direction keeps its length"),
        (lambda: iod.gooding(TIMES, LINES, SITE, MU, ranges=(5, 1)), "ranges are 5 to 1"),
        (lambda: iod.gooding(TIMES, LINES, SITE, MU, turns=-1), "turns are -1"),
    ],
)
def test_bad_positions_and_ranges_are_refused(call, message):
    with pytest.raises(ValueError, match=message):
        call()
