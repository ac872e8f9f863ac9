"""Elements of orbits: states come back, derivatives are those of differences, singular cases are said."""

import mpmath as mp
import numpy as np
import pytest
from numpy.testing import assert_allclose

from piazzi.orbit import Equinoctial, Keplerian, ModifiedEquinoctial, propagate_kepler
from piazzi.orbit.anomalies import from_true, mean_to_eccentric, to_true

MU = 3.986004418e14
KINDS = [
    *[Keplerian(anomaly, size) for anomaly in ("true", "eccentric", "mean") for size in ("a", "p", "q")],
    *[ModifiedEquinoctial(retrograde) for retrograde in (False, True)],
    *[Equinoctial(longitude, retrograde) for longitude in ("true", "eccentric", "mean") for retrograde in (False, True)],
]


def states(n=400, fastest=1.8, seed=1):
    """Random states; up to `fastest` times the speed of a parabola."""
    rng = np.random.default_rng(seed)
    r = rng.normal(size=(n, 3)) * 2e7
    v = rng.normal(size=(n, 3))
    speed = np.sqrt(2 * MU / np.linalg.norm(r, axis=1)) * rng.uniform(0.3, fastest, n)
    return r, v / np.linalg.norm(v, axis=1)[:, None] * speed[:, None]


def of_kind(kind, **options):
    return states(fastest=0.99 if isinstance(kind, Equinoctial) else 1.8, **options)


@pytest.mark.parametrize("kind", KINDS, ids=str)
def test_states_come_back(kind):
    r, v = of_kind(kind)
    back = kind.to_state(kind.from_state(r, v, MU), MU)
    size = np.linalg.norm(r, axis=1)[:, None], np.linalg.norm(v, axis=1)[:, None]
    e = np.linalg.norm(Keplerian(size="p").from_state(r, v, MU)[:, 1:2], axis=1)
    room = (1 + 1 / np.abs(1 - e))[:, None]  # digits that 1 - e loses
    assert np.max(np.abs(back[0] - r) / size[0] / room) < 2e-13
    assert np.max(np.abs(back[1] - v) / size[1] / room) < 2e-13


@pytest.mark.parametrize("kind", KINDS, ids=str)
def test_derivatives_by_the_state_are_those_of_differences(kind):
    r, v = of_kind(kind, n=200)
    x = Keplerian(size="p").from_state(
        r, v, MU
    )  # steps of differences stay within one kind of conic, and off the singular ones
    far = (np.abs(x[:, 1] - 1) > 0.05) & (x[:, 1] > 0.05) & (np.abs(np.cos(x[:, 2])) < 0.98) & (np.abs(x[:, 5]) < 2.4)
    r, v = r[far], v[far]
    scale = np.concatenate(
        [np.linalg.norm(r, axis=1)[:, None].repeat(3, 1), np.linalg.norm(v, axis=1)[:, None].repeat(3, 1)], 1
    )
    J = kind.jacobian_from_state(r, v, MU) * scale[:, None, :]
    x = np.concatenate([r, v], 1)

    def elements(x):
        return kind.from_state(x[:, :3], x[:, 3:], MU)

    D = differences(elements, x, scale, wrapped=True)
    size = np.abs(D).max(axis=2, keepdims=True)
    assert np.max(np.abs(J - D) / size) < 1e-7


@pytest.mark.parametrize("kind", KINDS, ids=str)
def test_the_two_derivatives_are_inverse_to_each_other(kind):
    r, v = of_kind(kind)
    elements = kind.from_state(r, v, MU)
    forward, back = kind.jacobian_from_state(r, v, MU), kind.jacobian_to_state(elements, MU)
    product = forward @ back
    size = np.abs(forward) @ np.abs(back)
    assert np.max(np.abs(product - np.eye(6)) / size) < 1e-11


def differences(f, x, scale, wrapped=False):
    """Central differences of order 4, (K, m, n), each column times its scale."""
    columns = []
    for j in range(x.shape[1]):
        step = np.zeros_like(x)
        step[:, j] = 1e-4 * scale[:, j]
        near, far = f(x + step) - f(x - step), f(x + 2 * step) - f(x - 2 * step)
        if wrapped:
            near, far = (np.hstack([d[:, :1], (d[:, 1:] + np.pi) % (2 * np.pi) - np.pi]) for d in (near, far))
        columns.append((8 * near - far) / (12 * 1e-4))
    return np.stack(columns, -1)


def test_kepler_equation_to_its_last_digits():
    rng = np.random.default_rng(2)
    e = np.concatenate([rng.uniform(0, 1, 60), 1 - 10.0 ** rng.uniform(-13, -1, 60), 1 + 10.0 ** rng.uniform(-13, 1, 80)])
    M = 10.0 ** rng.uniform(-8, np.log10(3), 200) * rng.choice([-1, 1], 200)
    E = mean_to_eccentric(M, e)
    with mp.workdps(50):
        for numbers in zip(M, e, E, strict=True):
            M_k, e_k, E_k = (mp.mpf(float(x)) for x in numbers)

            def left(E, M=M_k, e=e_k):
                return (E - e * mp.sin(E) if e < 1 else e * mp.sinh(E) - E) - M

            exact = mp.findroot(left, E_k)
            assert abs(E_k / exact - 1) < 2e-15


@pytest.mark.parametrize("kind", ["eccentric", "mean"])
def test_anomalies_go_there_and_back_over_many_turns(kind):
    true = np.linspace(-20, 20, 401)
    for e in (0.0, 0.3, 0.97):
        assert_allclose(to_true(from_true(true, e, kind), e, kind), true, rtol=0, atol=1e-13 / (1 - e))
    true = np.linspace(-1.9, 1.9, 101)
    for e in (1.0, 1.2, 2.9):
        assert_allclose(to_true(from_true(true, e, kind), e, kind), true, rtol=0, atol=1e-13)


@pytest.mark.parametrize("e", [0.0, 0.4, 1.0, 1.7])
def test_mean_anomaly_grows_with_time(e):
    q, dt = 7e6, 900.0
    kind = Keplerian("mean", "q")
    x = [q, e, 1.0, 0.3, 0.2, 0.1]
    a = q / abs(1 - e) if e != 1 else 2 ** (1 / 3) * q
    later = propagate_kepler(*kind.to_state(x, MU), MU, dt)
    x[5] += np.sqrt(MU / a**3) * dt
    assert_allclose(np.hstack(kind.to_state(x, MU)), np.hstack(later), rtol=1e-11)


def test_textbook_elements():
    """Circle of radius 1 about mu 1, inclined by 90 degrees, at its node: everything is known."""
    x = Keplerian().from_state([1.0, 0, 0], [0, 0, 1.0], 1.0)
    assert_allclose(x, [1, 0, np.pi / 2, 0, 0, 0], atol=1e-15)
    x = ModifiedEquinoctial().from_state([0, 1.0, 0], [-1.1, 0, 0], 1.0)
    assert_allclose(x, [1.21, 0, 0.21, 0, 0, np.pi / 2], atol=1e-15)


@pytest.mark.parametrize("i", [0.0, np.pi, 0.7])
@pytest.mark.parametrize("e", [0.0, 0.2])
def test_circular_and_equatorial_orbits_come_back(i, e):
    kind = Keplerian()
    r, v = kind.to_state([7e6, e, i, 0.0, 0.0, 0.4], MU)
    x = kind.from_state(r, v, MU)
    assert x[1] < 1e-15 or e
    assert_allclose(np.hstack(kind.to_state(x, MU)), np.hstack([r, v]), atol=1e-8)
    assert np.isfinite(kind.jacobian_to_state(x, MU)).all()


def test_what_has_no_derivative_says_so():
    with pytest.raises(ValueError, match=r"circular.*equinoctial"):
        Keplerian().jacobian_from_state([7e6, 0, 0], [0, np.sqrt(MU / 7e6) * 0.6, np.sqrt(MU / 7e6) * 0.8], MU)
    with pytest.raises(ValueError, match=r"equatorial.*equinoctial"):
        Keplerian().jacobian_from_state([7e6, 0, 0], [0, 8e3, 0], MU)
    with pytest.raises(ValueError, match="parabola"):
        Keplerian("mean", "q").jacobian_to_state([7e6, 1.0, 1.0, 0, 0, 0.3], MU)
    assert np.isfinite(Keplerian("true", "q").jacobian_to_state([7e6, 1.0, 1.0, 0, 0, 0.3], MU)).all()


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: Keplerian().to_state([7e6, 1.0, 0, 0, 0, 0], MU), "a parabola has no semi-major axis"),
        (lambda: Keplerian().to_state([7e6, 1.2, 0, 0, 0, 0], MU), r"semi-major axis is 7e\+06 at eccentricity 1\.2"),
        (lambda: Keplerian().to_state([7e6, -0.1, 0, 0, 0, 0], MU), r"eccentricity is -0\.1"),
        (lambda: Keplerian().to_state([-7e6, 1.2, 0, 0, 0, 3.0], MU), "asymptotes"),
        (lambda: Keplerian("half"), "anomaly 'half'"),
        (lambda: Keplerian(size="b"), "size 'b'"),
        (lambda: Keplerian().from_state([1, 2], [1, 2, 3], MU), r"position has shape \(2,\)"),
        (lambda: Keplerian().from_state([1, 2, 3], [1, 2, 3], -1.0), r"mu is -1\.0"),
        (lambda: Keplerian().from_state([0, 0, 0], [1, 2, 3], MU), "position is zero"),
        (lambda: Keplerian().from_state([1.0, 0, 0], [2.0, 0, 0], MU), "straight line"),
        (lambda: ModifiedEquinoctial().from_state([7e6, 0, 0], [0, -8e3, 0], MU), r"180 degrees.*retrograde=True"),
        (lambda: ModifiedEquinoctial(True).from_state([7e6, 0, 0], [0, 8e3, 0], MU), "inclination is 0 degrees"),
        (lambda: Equinoctial().from_state([7e6, 0, 0], [0, 12e3, 0], MU), "ellipses; take ModifiedEquinoctial"),
    ],
)
def test_what_is_no_orbit_is_refused(call, message):
    with pytest.raises(ValueError, match=message):
        call()
