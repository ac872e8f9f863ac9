"""Range-rate, Doppler and frequency against differences of light times along a propagated orbit."""

import numpy as np
import pytest

import piazzi as pz
from piazzi.earth import sensors
from tests.references.signals import HERSTMONCEUX, YARRAGADEE, C, Site, T, Trajectory, legs, orbit, problem, slopes

BARS = {"LEO": 2e-6, "GEO": 1e-6, "Moon": 1e-6}  # m/s; of a satellite near the Earth, velocity by an acceleration that stays


@pytest.fixture(autouse=True)
def _plain(monkeypatch):
    monkeypatch.setenv("PIAZZI_JIT", "0")  # the same source uncompiled


def lengths(p, path, tag, x, t, far=YARRAGADEE):
    """The lengths of the legs for a tag at t of the orbit through x at T: down and up."""
    down, up, *_ = legs(path, tag, Trajectory(p, x), Site(), Site(far), t)
    return C * np.array([down] if path == "one-way" else [down, up])


def rates(p, path, tag, x, far=YARRAGADEE, h=0.5):
    """Their rates by the time of the tag, by differences of order 4."""
    at = {k: lengths(p, path, tag, x, T + k * h, far) for k in (-2, -1, 1, 2)}
    return (8 * (at[1] - at[-1]) - (at[2] - at[-2])) / (12 * h)


@pytest.mark.parametrize("tag", ["reception", "bounce", pytest.param("transmission", marks=pytest.mark.slow)])
def test_rate_at_an_instant_is_the_derivative_of_the_range(tag):
    given = [sensors.range_rate(path, name=path, tag=tag) for path in ("one-way", "two-way")]
    given.append(sensors.range_rate("three-way", name="three-way", tag=tag, transmitter=HERSTMONCEUX))
    p = problem(*given)
    for kind in BARS if tag == "reception" else ("GEO",):
        x = orbit(kind)
        for path in ("one-way", "two-way", "three-way"):
            far = HERSTMONCEUX if path == "three-way" else YARRAGADEE
            assert p.measure(path, x, T)[0] == pytest.approx(rates(p, path, tag, x, far).mean(), abs=BARS[kind])
        H = p.measurement_jacobian("two-way", x, T)
        np.testing.assert_allclose(H, slopes(lambda y: p.measure("two-way", y, T), x), atol=1e-7)


@pytest.mark.parametrize("count", ["start", "middle", "end"])
def test_rate_over_a_count_is_a_difference_of_ranges(count):
    p = problem(sensors.range_rate(count=count), numbers={"count": 60.0})
    first = {"start": 0.0, "middle": -30.0, "end": -60.0}[count]
    for kind in BARS if count == "middle" else ("LEO",):
        x = orbit(kind)
        before, after = (lengths(p, "two-way", "reception", x, T + first + d).mean() for d in (0.0, 60.0))
        assert p.measure("range_rate", x, T)[0] == pytest.approx((after - before) / 60.0, abs=1e-7)
        H = p.measurement_jacobian("range_rate", x, T)
        np.testing.assert_allclose(H, slopes(lambda y: p.measure("range_rate", y, T), x), atol=2e-8)


@pytest.mark.slow  # uncompiled
def test_air_in_a_count_is_the_difference_of_delays_and_the_ionosphere_advances():
    numbers = {"count": 60.0}
    layer = {"electrons": 3e17, "frequency": 2.2e9, "uplink_frequency": 2.0e9}
    x = orbit("LEO")
    plain = problem(sensors.range_rate(count="end"), numbers=numbers).measure("range_rate", x, T)[0]
    bare = problem(sensors.range())
    path = Trajectory(bare, x)
    for extra, more, sign in (
        ({"troposphere": "saastamoinen"}, {}, 1.0),
        ({"ionosphere": "single-layer"}, layer, -1.0),
        ({"relativity": True}, {}, 1.0),
    ):
        p = problem(sensors.range_rate(count="end", **extra), numbers=numbers | more)
        q = problem(sensors.range(**extra), numbers=more)
        late = [q.measure("range", path(t), t)[0] - bare.measure("range", path(t), t)[0] for t in (T - 60.0, T)]
        got = p.measure("range_rate", x, T)[0] - plain
        assert got == pytest.approx(sign * (late[1] - late[0]) / 60.0, abs=1e-7)
        assert abs(got) > 1e-6


def test_radar_delay_and_doppler_are_those_of_the_whole_way():
    p = problem(sensors.radar_delay(), sensors.radar_doppler(), numbers=None)
    x = orbit("GEO")
    assert p.measure("radar_delay", x, T)[0] == pytest.approx(lengths(p, "two-way", "reception", x, T).sum() / C, abs=1e-14)
    shift = -2.38e9 * rates(p, "two-way", "reception", x).sum() / C
    assert p.measure("radar_doppler", x, T)[0] == pytest.approx(shift, abs=1e-5)


def test_frequency_is_the_carrier_by_the_rate_of_light_time_and_of_clocks():
    sensor = sensors.frequency(437e6, passes=["Yarragadee"])
    assert sensor.parameters == dict.fromkeys(("carrier", "drift", "carrier_Yarragadee", "drift_Yarragadee"), "estimated")
    assert dict(sensor.priors)["carrier"] == (0.0, pytest.approx(4370.0))
    values = {n: pz.Gaussian(m, s**2) for n, (m, s) in dict(sensor.priors).items()}
    p, x = problem(sensor, parameters=values, name="Yarragadee", numbers={"since": 700.0}), orbit("LEO")
    y = np.r_[x, 100.0, 0.5, 20.0, -0.1]
    order = ["carrier", "drift", "carrier_Yarragadee", "drift_Yarragadee"]
    assert list(p.model.names[6:]) == order or set(p.model.names[6:]) == set(order)
    y = np.r_[x, [dict(zip(order, y[6:], strict=True))[name] for name in p.model.names[6:]]]
    own = problem(sensors.range())
    _, _, rec, sat, _ = legs("one-way", "reception", Trajectory(own, x), Site(), Site())

    def slow(state):
        return 1 - (3.98600435507e14 / np.linalg.norm(state[:3]) + state[3:] @ state[3:] / 2) / C**2

    (rate,) = rates(own, "one-way", "reception", x)
    sent = 437e6 + 120.0 + 0.4 * (T - 700.0)
    expected = sent * (1 - rate / C) * slow(sat) / slow(rec)
    assert p.measure("Yarragadee", y, T)[0] == pytest.approx(expected, abs=2e-5)
    H = p.measurement_jacobian("Yarragadee", y, T)[0]
    assert H[p.model.names.index("carrier")] == pytest.approx(1.0, abs=1e-4)
    assert H[p.model.names.index("drift_Yarragadee")] == pytest.approx(T - 700.0, rel=1e-4)


def test_what_does_not_go_together_is_refused():
    with pytest.raises(ValueError, match="troposphere changes slowly"):
        sensors.range_rate(troposphere="saastamoinen")
    with pytest.raises(ValueError, match="count is 'centre'; there are start, middle, end"):
        sensors.range_rate(count="centre")
    with pytest.raises(ValueError, match=r"nominal is 0\.0"):
        sensors.frequency(0.0)
