"""Measurements between satellites and returned signals, simulated and determined end to end: errors are as covariances say."""

from dataclasses import replace

import numpy as np
import pytest

import piazzi as pz
from piazzi import earth
from piazzi.determination import Guess
from piazzi.determination.determining import prepared, ready, solved
from piazzi.determination.fit import estimators
from piazzi.determination.partners import partners_of, with_partners
from piazzi.determination.sensing import measured
from piazzi.determination.setup import follow
from piazzi.estimate.chi_square import quantile
from piazzi.evaluate.information import predicted
from piazzi.formats import Arc, Ephemeris, Observations, Segment
from piazzi.problem.inputs import prepare
from tests.references.determinations import MU, station

EPOCH = pz.Epoch("2024-03-10T00:00:00 UTC")
STATE = np.array([6978e3, 0.0, 0.0, 0.0, 3.9e3, 6.47e3])
TWIN = STATE + np.array([3e4, 1e5, -2e5, 15.0, -20.0, 10.0])
OFF = np.repeat([30.0, 0.03], 3)  # m, m/s of the truth
NAVIGATION = tuple(f"G{k:02d}" for k in range(1, 6))
PEOPLE = ("NORTH", "WEST", "SAT", "TWIN", *NAVIGATION)
WORDS = {"forces": "gravity=EGM2008 degree=4 radiation=no drag=no", "guess": Guess(EPOCH, STATE[:3], STATE[3:], "the orbit")}


def navigation(k):
    """A state of a navigation satellite, one of several."""
    a, i, r = 1.1 * k, np.radians(55.0 * (-1) ** k), 2.656e7
    turn = np.array([[1.0, 0.0, 0.0], [0.0, np.cos(i), -np.sin(i)], [0.0, np.sin(i), np.cos(i)]])
    v = np.sqrt(MU / r)
    return np.r_[turn @ [r * np.cos(a), r * np.sin(a), 0.0], turn @ [-v * np.sin(a), v * np.cos(a), 0.0]]


def arc(state, name):
    t = np.arange(-900.0, 9000.0, 60.0)
    r, v = pz.propagate_kepler(state[:3], state[3:], MU, t)
    return Arc(
        epoch=EPOCH,
        t=t,
        position=r,
        velocity=v,
        name=name,
        centre="EARTH",
        frame="GCRF",
        scale="UTC",
        clock=np.full(len(t), 1e-6),
    )


PARTICIPANTS = {name: Ephemeris(arcs=(arc(navigation(k), name),)) for k, name in enumerate(NAVIGATION)}
PARTICIPANTS["TWIN"] = Ephemeris(arcs=(arc(TWIN, "TWIN"),))


def table(kind, t, who, sigma, usual, seen="SAT", **segment):
    """Observations without values: rows of a kind at times, each by one of some participants."""
    return Observations(
        epoch=EPOCH, t=t, value=np.full(len(t), usual), kinds=(kind,), kind=np.zeros(len(t), dtype=int), participants=PEOPLE,
        station=[PEOPLE.index(name) for name in who], object=PEOPLE.index(seen), sigma=sigma, tag=3,
        segments=(Segment("UTC", participants=PEOPLE, **segment),),
    )  # fmt: skip


def passes(kind, sigma, usual, **segment):
    """Rows of two stations, in turn, of passes over either."""
    t = np.concatenate([1500.0 * k + np.arange(0.0, 500.0, 20.0) for k in range(4)])
    who = np.repeat(["NORTH", "WEST", "NORTH", "WEST"], 25)
    return table(kind, t, who, sigma, usual, **segment)


EVERY = np.arange(0.0, 7200.0, 60.0)
RETURNED = {"way": "two-way", "turnaround": 240 / 221, "frequencies": (("transmit", 2.1e9),), "range_is": "half"}
KINDS = {
    "pseudorange": lambda: table("pseudorange", np.repeat(EVERY, 5), NAVIGATION * len(EVERY), 1.0, 2.5e7),
    "range that it receives": lambda: table("range", EVERY, ["SAT"] * 120, 0.1, 1e5, "TWIN", way="two-way", range_is="half"),
    "range of another": lambda: table("range", EVERY, ["TWIN"] * 120, 0.1, 1e5, way="one-way"),
    "range rate that it receives": lambda: table("range_rate", EVERY, ["SAT"] * 120, 1e-4, 0.0, "TWIN", way="one-way"),
    "frequencies that return": lambda: passes(
        "receive_frequency", 0.1, 2.28e9, interval=10.0, interval_reference="end", **RETURNED
    ),
    "counts of cycles": lambda: passes("doppler_count", 1.0, 0.0, **RETURNED),
}
RUNS = 20


def given(name):
    sites = [station("NORTH"), station("WEST")]
    return prepared(KINDS[name](), stations=sites, participant=PARTICIPANTS, corrections="applied", **WORDS)


def test_it_is_said_that_orbits_of_others_are_not_estimated():
    for kind, names in (("range of another", "TWIN"), ("pseudorange", ", ".join(NAVIGATION))):
        partners = partners_of(PARTICIPANTS)
        seen = measured(with_partners(KINDS[kind](), partners), partners=partners)
        said = [text for text in seen.assumed if "not estimated" in text]
        assert said == [f"orbits taken as they are given, without errors, and not estimated: {names}"]


def squares(name, runs):
    """NEES (runs,) of the state, and of clocks, at the last row."""
    made, out = given(name), []
    constants = made.problem.model.names[6:]
    for seed in range(runs):
        rng = np.random.default_rng(seed)
        first = made.states[0].copy()
        first[:6] += OFF * rng.standard_normal(6)
        first[6:] += [{"clock": 1e4, "clock_rate": 1.0}.get(c, 1e3) * rng.standard_normal() for c in constants]
        states = follow(made.problem, made.tracking.times, first, made.chosen.max_step)[0]
        z = predicted(made.problem, prepare(made.problem, made.tracking), states)
        sigma = np.sqrt([np.diag(np.atleast_2d(s.noise))[0] for s in made.problem.stations])
        which = made.tracking.stations_of(made.problem)
        z = z + sigma[which][:, None] * rng.standard_normal(z.shape)
        one = replace(
            made, tracking=pz.Tracking(made.tracking.row_times, z, made.tracking.row_stations, epoch=made.tracking.epoch)
        )
        found = solved(ready(one), estimators(("graph",)))
        assert found.determined, (name, seed)
        k = found.setup.solution
        error, P = found.estimate.mean[k] - states[k], found.estimate.covariance[k]
        scale = np.sqrt(np.diag(P))
        out.append(error / scale @ np.linalg.solve(P / np.outer(scale, scale), error / scale))
    return np.array(out), len(made.problem.model.names)


@pytest.mark.slow
@pytest.mark.parametrize("name", KINDS)
def test_errors_are_as_covariances_say(name):
    found, values = squares(name, RUNS)
    low, high = (quantile(p, RUNS * values) for p in (0.0005, 0.9995))
    assert low < found.sum() < high, found.mean() / values


@pytest.mark.slow
def test_pseudoranges_of_four_satellites_need_no_guess():
    made = given("pseudorange")
    z = predicted(made.problem, prepare(made.problem, made.tracking), made.states)
    seen = replace(KINDS["pseudorange"](), value=np.asarray(z)[np.argsort(made.rows[:, 0], kind="stable"), 0])
    words = {name: word for name, word in WORDS.items() if name != "guess"}
    found = prepared(seen, participant=PARTICIPANTS, **words)
    assert found.guess.source == "the pseudoranges"
    assert np.linalg.norm(found.states[0, :3] - made.states[0, :3]) < 2e3  # clocks of who sent are not in these values


@pytest.mark.slow
def test_an_asteroid_that_a_satellite_sees_needs_no_guess():
    """Seven weeks of directions from an orbit about the Earth, two days apart."""
    rng, t = np.random.default_rng(2), np.arange(0.0, 4.1e6, 172800.0)
    dates = [EPOCH + float(x) for x in t]
    centre = earth.body("earth", dates, "sun")[0]
    turn = np.arange(len(t))
    places = np.stack([7e6 * np.cos(turn), 7e6 * np.sin(turn), np.full(len(t), 5e5)], -1)
    state = np.array([3.9e11, 0.8e11, 0.3e11]), np.array([-4e3, 1.75e4, 3e3])
    tau = np.zeros(len(t))
    for _ in range(10):
        line = pz.propagate_kepler(*state, earth.constants.GM["sun"], t - tau)[0] - centre - places
        tau = np.linalg.norm(line, axis=1) / 299792458.0
    sigma = np.radians(1.0 / 3600.0)
    second = np.arctan2(line[:, 2], np.hypot(line[:, 0], line[:, 1]))
    first = np.arctan2(line[:, 1], line[:, 0]) % (2 * np.pi) + sigma * rng.standard_normal(len(t)) / np.cos(second)
    second = second + sigma * rng.standard_normal(len(t))
    seen = Observations(
        epoch=EPOCH, t=np.tile(t, 2), value=np.r_[first, second], kinds=("right_ascension", "declination"),
        kind=np.repeat([0, 1], len(t)), participants=("C51", "AST"), station=0, object=1, sigma=sigma, tag=3, places=places,
        segments=(Segment("UTC", angles="astrometric", frame="GCRF"),), place=np.tile(turn, 2),
        extra={"place_axes": np.full(2 * len(t), "GCRF")},
    )  # fmt: skip
    found = pz.determine(seen, forces="none", epoch=EPOCH)
    assert found.determined and found.setup.measured.about == "sun"
    k = found.setup.solution
    error, P = found.estimate.mean[k] - np.concatenate(state), found.estimate.covariance[k]
    scale = np.sqrt(np.diag(P))
    assert error / scale @ np.linalg.solve(P / np.outer(scale, scale), error / scale) < quantile(0.9999, 6)
