"""Every kind of row that files hold, against what a signal on a dense path does: what is computed, and what is refused."""

from dataclasses import replace

import numpy as np
import pytest

import piazzi as pz
from piazzi import earth
from piazzi.determination import Guess
from piazzi.determination.determining import prepared
from piazzi.determination.residuals import units_of
from piazzi.evaluate.information import predicted
from piazzi.formats import Arc, Ephemeris, Observations, Segment
from piazzi.problem.inputs import prepare

C = 299792458.0
EPOCH = pz.Epoch("2024-05-05T12:00:00 UTC")
R, V = np.array([7000e3, 500e3, 300e3]), np.array([-300.0, 5.2e3, 5.3e3])
OTHER = np.array([7060e3, 300e3, 150e3]), np.array([-100.0, 5.4e3, 5.0e3])  # another satellite, some 260 km away
FAR = np.array([2.2e7, 1.2e7, 8.0e6]), np.array([-2.0e3, 2.2e3, 2.2e3])  # one that navigates
T = np.array([0.0, 60.0, 120.0, 600.0])
GM = earth.gravity_field("EGM2008").gm


SLOW = pytest.mark.slow  # uncompiled


def some(cases, quick):
    """Cases of which all but the quick ones are left to the long run of tests."""
    return [pytest.param(*case, marks=[] if case in quick else [SLOW]) for case in cases]


@pytest.fixture(autouse=True)
def _plain(monkeypatch):
    monkeypatch.setenv("PIAZZI_JIT", "0")


SITES = [earth.Station.geodetic(n, np.radians(a), np.radians(b), 100.0) for n, a, b in (("A", 10.0, 60.0), ("B", -5.0, 75.0))]
ALIKE = ("station", "object", "segment", "tag", "file", "line", "used", "place")
PEOPLE = ("A", "B", "SAT", "TWIN", "G05")


def rows(kind, values, sigma, receiver="A", seen="SAT", **segment):
    kinds, values = ((kind,), values) if isinstance(kind, str) else (kind, np.concatenate(values))
    what = np.repeat(np.arange(len(kinds)), len(T))
    return Observations(
        epoch=EPOCH, t=np.tile(T, len(kinds)), value=values, kinds=kinds, kind=what, participants=PEOPLE,
        station=PEOPLE.index(receiver), object=PEOPLE.index(seen) if seen else -1, sigma=sigma, tag=3,
        segments=(Segment("UTC", participants=PEOPLE, **segment),),
    )  # fmt: skip


def sent_by(observations, who, t, frequency, rate=None):
    """The same with rows of what a participant transmitted."""
    parts = [("transmit_frequency", frequency), *([("transmit_frequency_rate", rate)] if rate is not None else [])]
    kinds = (*observations.kinds, *(kind for kind, _ in parts))
    more = len(parts) * len(t)
    values = np.concatenate([observations.value, *(np.broadcast_to(v, len(t)) for _, v in parts)])
    kind = np.concatenate([observations.kind, np.repeat(np.arange(len(parts)) + len(observations.kinds), len(t))])
    who = np.concatenate([np.full(len(observations), -1), np.full(more, PEOPLE.index(who))])
    return replace(
        observations, kinds=kinds, kind=kind, value=values, t=np.concatenate([observations.t, np.tile(t, len(parts))]),
        participant=who, sigma=np.append(observations.sigma, np.full(more, np.nan)),
        **{name: np.full(len(values), getattr(observations, name)[0]) for name in ALIKE},
        **{name: np.full(len(values), np.nan) for name in ("correlation", "time_sigma", "pressure", "temperature", "humidity")},
    )  # fmt: skip


def orbit(start, t):
    return np.hstack(pz.propagate_kepler(*start, GM, np.asarray(t, dtype=float)))


def sat(t):
    return orbit((R, V), t)


def ground(site):
    itrf = np.array(site.coordinates[0].position)

    def at(t):
        dates = [EPOCH + float(x) for x in np.atleast_1d(t)]
        r, v = earth.transform(np.tile(itrf, (len(dates), 1)), np.zeros((len(dates), 3)), "ITRF", "GCRF", dates)
        return np.hstack([r, v])

    return at


def back(sender, receiver, t):
    """Light time (K,) of what a receiver has at t."""
    here, tau = receiver(t)[:, :3], np.full(len(t), 0.01)
    for _ in range(20):
        tau = np.linalg.norm(sender(t - tau)[:, :3] - here, axis=1) / C
    return tau


def there_and_back(t, up=SITES[0], down=SITES[0], bounce=sat):
    """Whole light time of what goes from a station over the satellite to a station that has it at t."""
    first = back(bounce, ground(down), t)
    return first + back(ground(up), bounce, t - first)


def ephemeris(start, name, clock=np.nan, begin=-600.0):
    t = np.arange(begin, 1300.0, 60.0)
    x = orbit(start, t)
    return Ephemeris(arcs=(
        Arc(
            epoch=EPOCH, t=t, position=x[:, :3], velocity=x[:, 3:], name=name, centre="EARTH", frame="GCRF", scale="UTC",
            clock=np.full(len(t), clock),
        ),
    ))  # fmt: skip


def left_over(observations, participant=None):
    """Measured less computed, of the guess itself."""
    made = prepared(
        observations, guess=Guess(EPOCH, R, V, "test"), stations=SITES, forces="none", corrections="applied",
        participant=participant,
    )  # fmt: skip
    z = predicted(made.problem, prepare(made.problem, made.tracking), made.states)
    return made, made.tracking.values - np.asarray(z)[:, : made.tracking.values.shape[1]]


def slope(f, t, h=0.05):
    return (f(t + h) - f(t - h)) / (2 * h)


def ramp(t):
    """A frequency that goes up, as a phase."""
    return 2.1e9 * t + 0.5 * 150.0 * t**2


@pytest.mark.parametrize(
    ("count", "ramped"), some([(c, r) for c in (None, "start", "middle", "end") for r in (False, True)], [("end", True)])
)
def test_frequencies_that_return(count, ramped):
    """The rate of the phase that was sent, when it was sent, times the ratio of the transponder."""
    phase = ramp if ramped else lambda t: 2.1e9 * t

    def sent(t):
        return t - there_and_back(t)

    ratio, length = 240.0 / 221.0, 10.0
    begin = {None: 0.0, "start": 0.0, "middle": -length / 2, "end": -length}[count]
    mean = (
        slope(lambda t: phase(sent(t)), T)
        if count is None
        else (phase(sent(T + begin + length)) - phase(sent(T + begin))) / length
    )
    own = {} if count is None else {"interval": length, "interval_reference": count}
    given = rows(
        "receive_frequency", ratio * mean, 0.1, way="two-way", path=("A", "SAT", "A"), turnaround=ratio, range_is="half", **own
    )
    told = sent_by(given, "A", np.array([-100.0]), 2.1e9 - (15e3 if ramped else 0.0), 150.0 if ramped else None)
    made, off = left_over(told)
    assert np.abs(off).max() < (0.02 if count is None else 2e-3)  # Hz: 3 mm/s of differences of phases, and 0.3 mm/s
    assert not made.problem.model.constants


def test_a_ramp_that_changes_while_a_signal_is_on_its_way_leaves_its_rows_out():
    given = rows(
        "receive_frequency", np.full(4, 2.2e9), 0.1, way="two-way", path=("A", "SAT", "A"), turnaround=1.0, range_is="sum"
    )
    told = sent_by(given, "A", np.array([-100.0, 58.0]), np.array([2.1e9, 2.2e9]), np.array([0.0, 10.0]))
    made, _ = left_over(told)
    assert len(made.tracking.row_times) == 3
    assert made.measured.left_out["rows while the frequency that was sent changed its ramp, or before it is known"] == 1
    sent = {s.name: s.numbers["transmit_rate"] for s in made.problem.stations}
    assert sorted(sent.values()) == [0.0, 10.0]


@pytest.mark.parametrize("count", ["start", pytest.param("middle", marks=SLOW), pytest.param("end", marks=SLOW)])
def test_frequencies_of_the_satellites_own_over_a_count(count):
    carrier, length = 437.5e6, 20.0
    begin = {"start": 0.0, "middle": -length / 2, "end": -length}[count]

    def sent(t):
        return t - back(sat, ground(SITES[0]), t)

    mean = carrier * (sent(T + begin + length) - sent(T + begin)) / length
    own = {"interval": length, "interval_reference": count, "frequencies": (("carrier", carrier),)}
    _, off = left_over(rows("receive_frequency", mean, 1.0, way="one-way", path=("SAT", "A"), **own))
    assert np.abs(off / carrier).max() < 2e-9  # clocks go by speed and height


@pytest.mark.parametrize(
    ("kind", "way"),
    some([(k, w) for k in ("doppler_count", "receive_phase") for w in ("one-way", "two-way")], [("doppler_count", "two-way")]),
)
def test_phases_and_counts_of_cycles(kind, way):
    """All but one unknown number of the cycles that were sent since the begin are there."""
    ratio, bias, carrier = (1.0, 0.0, 2.1e9) if way == "one-way" else (240.0 / 221.0, 1e5, 2.1e9)
    tau = back(sat, ground(SITES[0]), T) if way == "one-way" else there_and_back(T)
    cycles = ratio * carrier * (T - tau) if kind == "receive_phase" else bias * T - ratio * carrier * tau
    path = ("SAT", "A") if way == "one-way" else ("A", "SAT", "A")
    own = {"turnaround": ratio, "frequencies": (("count bias", bias), ("transmit", carrier)), "range_is": "half"}
    made, off = left_over(rows(kind, cycles + 12345.0, 0.1, way=way, path=path, **own))
    assert np.ptp(off) < 1.0  # of 0.14 m: what tides and the Earth's gravity change in ten minutes
    assert made.problem.model.constants == ("phase_1",)


@pytest.mark.parametrize("kind", ["time_of_flight", "doppler"])
def test_echoes_of_radar(kind):
    frequency = 2.38e9
    value = there_and_back(T) if kind == "time_of_flight" else -frequency * slope(there_and_back, T)
    given = rows(
        kind, value, 1e-7, way="two-way", path=("A", "SAT", "A"), range_is="sum", frequencies=(("transmit", frequency),)
    )
    made, off = left_over(given)
    assert np.abs(off).max() < (1.0 if kind == "time_of_flight" else 1e-4)  # m, m/s
    assert made.problem.model.sensors[0].components == (("range",) if kind == "time_of_flight" else ("range_rate",))


@pytest.mark.parametrize("kind, unit", [("time_of_flight", "m"), ("doppler", "m/s"), ("range", "m"), ("range_rate", "m/s")])
def test_residuals_have_the_unit_of_what_is_compared(kind, unit):
    given = rows(kind, np.full(len(T), 0.01), 1e-7, way="two-way", path=("A", "SAT", "A"), range_is="half",
                 frequencies=(("transmit", 2.38e9),))  # fmt: skip
    made = prepared(given, guess=Guess(EPOCH, R, V, "test"), stations=SITES, forces="none", corrections="applied")
    which = made.tracking.stations_of(made.problem)
    assert {*units_of(made.problem, which, np.zeros(len(which), dtype=int), [kind] * len(which))} == {unit}


@pytest.mark.parametrize("sender", ["A", pytest.param("B", marks=pytest.mark.slow)])
@pytest.mark.parametrize("kind", ["time_of_flight", "doppler"])
def test_echoes_of_asteroids(kind, sender):
    """Where the asteroid, the Earth and the station are about the Sun, and by how much the Sun delays the light."""
    mu = earth.constants.GM["sun"]
    r, v = earth.body("earth", [EPOCH], "sun")
    start = r[0] + np.array([2e10, 1e10, 5e9]), v[0] + np.array([3e3, -2e3, 1e3])

    def asteroid(t):
        return np.hstack(pz.propagate_kepler(*start, mu, np.asarray(t)))

    def at(station):
        return lambda t: ground(station)(t) + np.hstack(earth.body("earth", [EPOCH + float(x) for x in t], "sun"))

    site, other = at(SITES[0]), at(SITES["AB".index(sender)])

    def shapiro(one, other):
        a, b, d = (np.linalg.norm(x[:, :3], axis=1) for x in (one, other, one - other))
        return 2.0 * mu / C**3 * np.log((a + b + d) / (a + b - d))

    def both(t):
        down = back(asteroid, site, t)
        up = back(other, asteroid, t - down)
        sun = shapiro(asteroid(t - down), site(t)) + shapiro(asteroid(t - down), other(t - down - up))
        return down + up + (sun if kind == "time_of_flight" else 0.0)

    value = both(T) if kind == "time_of_flight" else -2.38e9 * slope(both, T, 5.0)
    given = rows(
        kind,
        value,
        1e-7,
        way="two-way" if sender == "A" else "three-way",
        path=(sender, "SAT", "A"),
        range_is="sum",
        frequencies=(("transmit", 2.38e9),),
    )
    made = prepared(given, guess=Guess(EPOCH, *start, "test", about="sun"), stations=SITES, forces="none", about="sun")
    z = predicted(made.problem, prepare(made.problem, made.tracking), made.states)
    off = made.tracking.values - np.asarray(z)
    assert np.abs(off).max() < (5.0 if kind == "time_of_flight" else 1e-3)  # m, m/s


@pytest.mark.parametrize("kind", [("x_east", "y_north"), ("x_south", "y_east")])
def test_mounts_without_an_axis_to_the_zenith(kind):
    """Angles of the apparent line from the zenith, about axes to the north and to the east."""
    here, tau = ground(SITES[0])(T), back(sat, ground(SITES[0]), T)
    line = sat(T - tau)[:, :3] - here[:, :3]
    line += np.linalg.norm(line, axis=1)[:, None] * here[:, 3:] / C
    fixed = np.array([earth.rotation("GCRF", "ITRF", EPOCH + float(t)) @ u for t, u in zip(T, line, strict=True)])
    latitude, longitude = np.radians(10.0), np.radians(60.0)
    s, c = np.sin(latitude), np.cos(latitude)
    meridian = np.array([np.cos(longitude), np.sin(longitude), 0.0])
    up, north = (fixed @ (a * meridian + np.array([0.0, 0.0, b])) for a, b in ((c, s), (-s, c)))
    east = fixed @ np.array([-np.sin(longitude), np.cos(longitude), 0.0])
    first, second = (east, north) if kind == ("x_east", "y_north") else (-north, east)
    angles = np.arctan2(first, up), np.arctan2(second, np.hypot(first, up))
    _, off = left_over(rows(kind, angles, 1e-5, path=("SAT", "A"), way="one-way"))
    assert np.abs(off).max() < 2e-6  # the tide of 0.3 m


@pytest.mark.parametrize("kind", ["vlbi_delay", "delta_range_delay"])
def test_delays_between_two_stations(kind):
    """When it arrives by the second path less when by the first, whose time it is."""
    sent = T - back(sat, ground(SITES[0]), T)
    tau, here = np.full(4, 0.01), sat(sent)[:, :3]
    for _ in range(20):
        tau = np.linalg.norm(ground(SITES[1])(sent + tau)[:, :3] - here, axis=1) / C
    given = rows(kind, sent + tau - T, 1e-9, mode="single_diff", path=("SAT", "A"), second_path=("SAT", "B"))
    _, off = left_over(given)
    assert np.abs(off).max() * C < 1.0  # m
    with pytest.raises(ValueError, match="two paths"):
        left_over(rows(kind, T, 1e-9, path=("SAT", "A"), way="one-way"))


@pytest.mark.parametrize(
    ("kind", "receiver", "way"),
    some(
        [
            (k, r, w)
            for k in ("range", "range_rate", "range_rate_averaged")
            for r in ("SAT", "TWIN")
            for w in ("one-way", "two-way")
        ],
        [("range", "TWIN", "one-way"), ("range_rate", "SAT", "two-way")],
    ),
)
def test_ranges_between_satellites(way, receiver, kind):
    """Each at its own event, whoever of both receives."""

    def twin(t):
        return orbit(OTHER, t)

    mine, other = (sat, twin) if receiver == "SAT" else (twin, sat)

    def length(t):
        first = back(other, mine, t)
        return C * first if way == "one-way" else 0.5 * C * (first + back(mine, other, t - first))

    values = {"range": length(T), "range_rate": slope(length, T), "range_rate_averaged": (length(T + 10.0) - length(T)) / 10.0}[
        kind
    ]
    seen = "TWIN" if receiver == "SAT" else "SAT"
    path = (seen, receiver) if way == "one-way" else (receiver, seen, receiver)
    own = {"interval": 10.0, "interval_reference": "start"} if kind == "range_rate_averaged" else {}
    given = rows(kind, values, 0.1, receiver, seen, way=way, path=path, range_is="half" if way == "two-way" else "sum", **own)
    made, off = left_over(given, {"TWIN": ephemeris(OTHER, "twin")})
    assert np.abs(off).max() < (1e-3 if kind == "range" else 1e-5)  # m of the Earth's gravity; m/s
    assert made.measured.object == "SAT" and set(made.measured.labels.values()) == {"TWIN"}


def test_pseudoranges_are_from_where_the_signal_was_sent_with_both_clocks():
    """The clock of who sends is ahead by what its ephemeris says, and by what its orbit does to it."""
    clock, own = 1e-5, 2e-4

    def sender(t):
        return orbit(FAR, t)

    tau = back(sender, sat, T)
    x = sender(T - tau)
    ahead = clock - 2.0 * np.sum(x[:, :3] * x[:, 3:], axis=1) / C**2
    given = rows("pseudorange", C * (tau + own - ahead), 1.0, receiver="G05")
    made, off = left_over(given, {"G05": ephemeris(FAR, "G05", clock)})
    assert off[:, 0] == pytest.approx(np.full(4, C * own), abs=0.05)  # the Earth's gravity; the clock is to be estimated
    assert {*made.problem.model.constants} == {"clock", "clock_rate"}
    with pytest.raises(ValueError, match=r"where was G05.*--participant"):
        left_over(given)


@pytest.mark.parametrize("about", ["earth", "sun"])
@pytest.mark.parametrize("axes", ["GCRF", "ITRF"])
def test_directions_from_observers_that_move(about, axes):
    """The line from where the observer was to where the body was when the light left it, on the axes of the catalogue."""
    mu = earth.constants.GM["sun"] if about == "sun" else GM
    centre, speed = (a[0] for a in earth.body("earth", [EPOCH], "sun")) if about == "sun" else (np.zeros(3), np.zeros(3))
    start = (centre + np.array([2e11, 1e11, 5e10]), speed + np.array([3e3, -2e3, 1e3])) if about == "sun" else (R, V)
    there = np.array([[-3e6, 5e6, 2.5e6], [-2e6, 5.5e6, 2.6e6], [-1e6, 6e6, 2.4e6], [1e6, 6.1e6, 2.2e6]])
    dates = [EPOCH + float(t) for t in T]
    here = there if axes == "GCRF" else earth.transform(there, None, "ITRF", "GCRF", dates, earth.SubdailyEOP())[0]
    if about == "sun":
        here = here + earth.body("earth", dates, "sun")[0]
    tau = np.zeros(4)
    for _ in range(20):
        line = pz.propagate_kepler(*start, mu, T - tau)[0] - here
        tau = np.linalg.norm(line, axis=1) / C
    angles = np.arctan2(line[:, 1], line[:, 0]) % (2 * np.pi), np.arctan2(line[:, 2], np.hypot(line[:, 0], line[:, 1]))
    kind = "astrometric" if about == "sun" else "geocentric"
    given = rows(("right_ascension", "declination"), angles, 1e-6, receiver="G05", angles=kind, frame="GCRF", way="one-way")
    given = replace(given, place=np.tile(np.arange(4), 2), places=there, extra={"place_axes": np.full(8, axes)})
    words = {"guess": Guess(EPOCH, *start, "test", about=about), "forces": "none", "about": about}
    made = prepared(given, **words)
    z = np.asarray(predicted(made.problem, prepare(made.problem, made.tracking), made.states))
    assert np.abs((made.tracking.values - z + np.pi) % (2 * np.pi) - np.pi).max() < 1e-10
    if axes == "GCRF":
        seen = replace(given, segments=(replace(given.segments[0], angles="apparent"),))
        with pytest.raises(ValueError, match="from space depend on a velocity"):
            prepared(seen, **words)


def test_rows_beyond_the_orbit_of_a_participant_are_counted():
    values = np.linalg.norm(orbit(OTHER, T)[:, :3] - sat(T)[:, :3], axis=1)
    given = rows("range", values, 0.1, "TWIN", "SAT", way="one-way", path=("SAT", "TWIN"), range_is="sum")
    made, _ = left_over(given, {"TWIN": ephemeris(OTHER, "twin", begin=100.0)})
    assert made.measured.left_out["rows when no orbit of TWIN is given"] == 2
