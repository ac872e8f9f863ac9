"""Frequencies and three-way signals as tracking: what is computed is what a signal on a dense path does."""

import numpy as np
import pytest

import piazzi as pz
from piazzi import earth
from piazzi.determination import Guess
from piazzi.determination.determining import prepared
from piazzi.evaluate.information import predicted
from piazzi.formats import Observations, Segment
from piazzi.problem.inputs import prepare

C = 299792458.0
EPOCH = pz.Epoch("2024-05-05T12:00:00 UTC")
R, V = np.array([7000e3, 500e3, 300e3]), np.array([-300.0, 5.2e3, 5.3e3])
T = np.array([0.0, 60.0, 120.0, 600.0])
GM = earth.gravity_field("EGM2008").gm


@pytest.fixture(autouse=True)
def _plain(monkeypatch):
    monkeypatch.setenv("PIAZZI_JIT", "0")


SITES = [earth.Station.geodetic(n, np.radians(a), np.radians(b), 100.0) for n, a, b in (("A", 10.0, 60.0), ("B", -5.0, 75.0))]


def rows(kind, values, sigma, receiver="A", **segment):
    people = ("A", "B", "SAT")
    return Observations(
        epoch=EPOCH, t=T, value=values, kinds=(kind,), kind=np.zeros(len(T), dtype=int), participants=people,
        station=people.index(receiver), object=2, segments=(Segment("UTC", participants=people, **segment),),
        sigma=sigma, tag=3,
    )  # fmt: skip


def path(t):
    return pz.propagate_kepler(R, V, GM, t)


def ground(site, t):
    dates = [EPOCH + float(x) for x in np.atleast_1d(t)]
    itrf = np.array(site.coordinates[0].position)
    r, v = earth.transform(np.tile(itrf, (len(dates), 1)), np.zeros((len(dates), 3)), "ITRF", "GCRF", dates)
    return r, v


def left_over(observations):
    """Measured less computed, of the guess itself."""
    made = prepared(observations, guess=Guess(EPOCH, R, V, "test"), stations=SITES, forces="none", corrections="applied")
    z = predicted(made.problem, prepare(made.problem, made.tracking), made.states)
    return made, made.tracking.values[:, 0] - np.asarray(z)[:, 0]


def emission(t, site):
    """When a signal left the satellite that the station has at t, by iteration."""
    here, tau = ground(site, t)[0], np.full(len(t), 0.01)
    for _ in range(20):
        tau = np.linalg.norm(path(t - tau)[0] - here, axis=1) / C
    return t - tau


def test_three_way_ranges():
    """The length of both legs, the transmitter's place when it sent."""
    sent = emission(T, SITES[0])
    up = np.full(len(T), 0.01)
    for _ in range(20):
        up = np.linalg.norm(path(sent)[0] - ground(SITES[1], sent - up)[0], axis=1) / C
    both = C * (T - sent + up)
    given = rows("range", both, 10.0, way="three-way", range_is="sum", path=("B", "SAT", "A"))
    made, off = left_over(given)
    assert np.abs(off).max() < 1.0  # the tide of stations, and Shapiro
    assert made.tracking.values[0, 0] == 0.5 * both[0]


def test_received_frequencies():
    """The rate of the phase: frequency sent times how much of the satellite's time goes by in a second of the station's."""
    carrier, h = 437.5e6, 0.05
    ratio = (emission(T + h, SITES[0]) - emission(T - h, SITES[0])) / (2 * h)
    slow = 1.0 - 0.5 * (np.sum(V**2) / C**2) - GM / (np.linalg.norm(R) * C**2)
    known = rows(
        "receive_frequency", carrier * ratio, 1.0, way="one-way", path=("SAT", "A"), frequencies=(("carrier", carrier),)
    )
    made, off = left_over(known)
    assert np.abs(off / carrier).max() < 2e-9  # where clocks go by speed and height is 1e-9 of it
    assert slow < 1.0 and not made.problem.model.constants
    unknown = rows("receive_frequency", carrier * ratio, 1.0, way="one-way", path=("SAT", "A"))
    made, off = left_over(unknown)
    assert {*made.problem.model.constants} == {"carrier", "drift"}
    assert np.ptp(off) < 5.0 and any("the carrier is estimated" in text for text in made.assumed)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        (rows("range", np.full(4, 1e6), 10.0, way="three-way", range_is="sum"), "which station sent"),
        (rows("receive_frequency", np.full(4, 1e9), 1.0, way="two-way"), r"which frequency was sent \(TRANSMIT_FREQ\)"),
        (rows("pseudorange", np.full(4, 2e7), 1.0), r"where was A\? Give orbits and clocks with --participant"),
    ],
)  # fmt: skip
def test_what_is_not_taken_is_refused_by_name(given, words):
    with pytest.raises(ValueError, match=words):
        prepared(given, guess=Guess(EPOCH, R, V, "test"), stations=SITES, forces="none")
