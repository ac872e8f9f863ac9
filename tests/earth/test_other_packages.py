"""A day of a low orbit beside two other programs, force by force: what they gave is in tests/references/other_packages.json.

Their constants are taken: the pressure of sunlight of each, GM of EGM2008.  There Sun and Moon are those of DE440, here series.
"""

import json
from functools import cache
from math import cos, radians, sin
from pathlib import Path

import numpy as np
import pytest

import piazzi as pz
from piazzi import earth
from piazzi.earth.atmosphere import TABLE, HarrisPriester
from piazzi.outside.pieces import Pieces

pytestmark = pytest.mark.slow  # one kernel with all forces
OTHERS = json.loads((Path(__file__).resolve().parents[1] / "references" / "other_packages.json").read_text())
EPOCH = pz.Epoch("2015-05-05T00:00:00 UTC")
STATE = np.array([5.2e6, -4.1e6, 1.9e6, 3.0e3, 5.4e3, 4.405e3])
PRESSURE = {"satkit": 4.559821181358738e-6, "brahe": 4.56e-6}
OWN_PRESSURE = 1361.0 / 299792458.0
ALL = ("sun_on", "moon_on", "tides_on", "k1_on", "pole_on", "relativity_on", "radiation_on")
RELATIVITY = ("relativity_on", "lense_thirring_on", "de_sitter_on")


def forces(degree):
    return earth.Forces(
        degree=degree,
        radiation="cannonball",
        drag="harris-priester",
        shadow_edges=True,
        tides=("solid", "k1", "pole"),
        relativity=("schwarzschild", "lense-thirring", "de-sitter"),
    )


COS, SIN = cos(radians(30.0)), sin(radians(30.0))  # the bulge lags
AS_THERE = {  # with as_there = 1: heights over an ellipsoid about the axis of the GCRF, and the Sun by a short formula
    "their_x, their_y, their_z": "their_sun(t)",
    "latitude_sin2": "(as_there*z**2 + (1 - as_there)*bz**2)/r**2",
    **{f"away_{a}": f"as_there*their_{a} + (1 - as_there)*sun_{a}" for a in "xyz"},
    "bulge_x": f"{COS!r}*away_x - {SIN!r}*away_y",
    "bulge_y": f"{SIN!r}*away_x + {COS!r}*away_y",
    "away": "sqrt(away_x**2 + away_y**2 + away_z**2)",
    "bulge": "(0.5 + 0.5*(x*bulge_x + y*bulge_y + z*away_z)/(r*away))**(air_exponent/2)",
}


def short_sun(t):
    """Montenbruck and Gill, Satellite Orbits (2000), eq. 3.43: the Sun to 0.05 degrees, over seconds past the epoch."""
    century = (EPOCH.jd("TT")[0] - 2451545.0 + EPOCH.jd("TT")[1] + t / 86400.0) / 36525.0
    anomaly = 2 * np.pi * (0.9931267 + 99.9973583 * century)
    along = 2 * np.pi * 0.7859444 + anomaly + np.radians(6892.0 * np.sin(anomaly) + 72.0 * np.sin(2 * anomaly)) / 3600.0
    distance = (149.619 - 2.499 * np.cos(anomaly) - 0.021 * np.cos(2 * anomaly)) * 1e9
    tilt = np.radians(23.43929111)
    return distance[:, None] * np.stack([np.cos(along), np.sin(along) * np.cos(tilt), np.sin(along) * np.sin(tilt)], axis=1)


class Exponentials(HarrisPriester):
    """The same table, heights joined by exponentials, in pieces of 10 km."""

    checksum = "harris-priester by exponentials"

    def block(self, first=0.0, last=0.0):
        starts = np.arange(100e3, 1000e3, 10e3)
        columns = [(TABLE[:, 0] * 1e3, np.log(c * 1e-12)) for c in TABLE[:, 1:].T]
        low, high = (np.stack([np.interp(h, *c) for c in columns], axis=1) for h in (starts, starts + 10e3))
        terms = np.stack([0 * low, 0 * low, (high - low) / 2, (high + low) / 2], axis=1)
        return Pieces(100e3, 10e3, terms, np.zeros(2), np.zeros(2)).block


@cache
def after_a_day(on=(), degree=20, pressure=OWN_PRESSURE, as_there=False):
    f = forces(degree)
    switches = {name: float(name in on) for name in f.values if name.endswith("_on")}
    hours = np.arange(-30.0, 55.0) * 3600.0
    functions = {**f.functions(EPOCH), "their_sun": pz.Table(hours, short_sun(hours))}
    if as_there:
        functions["air"] = Exponentials()
    problem = pz.Problem(
        forces(20).model((), ["as_there"], None, AS_THERE, {"their_sun": functions["their_sun"].signature}),
        pz.Gaussian(STATE, [1.0] * 6),
        parameters={
            **switches,
            "cr_a_m": 0.02 * pressure / OWN_PRESSURE,
            "cd_a_m": 0.02,
            "air_exponent": 6.0,
            "as_there": float(as_there),
        },
        integrator=pz.RungeKutta8(2880),
        functions=functions,
        epoch=EPOCH,
        prior_time=0.0,
    )
    return problem.step(STATE, 86400.0, 0.0)[0][:3]


@pytest.mark.parametrize(
    ("program", "case", "on", "metres"),
    [
        ("satkit", "two bodies", (), 1e-3),
        ("brahe", "two bodies", (), 1e-3),
        ("satkit", "degree 20", (), 2e-3),
        ("brahe", "degree 20", (), 2e-3),
        ("satkit", "sun", ("sun_on",), 2e-3),
        ("satkit", "moon", ("moon_on",), 2e-3),
        ("satkit", "relativity", RELATIVITY, 0.01),
        ("brahe", "sun", ("sun_on",), 2e-3),
        ("brahe", "moon", ("moon_on",), 2e-3),
        ("brahe", "relativity", ("relativity_on",), 2e-3),
        ("satkit", "radiation", ("radiation_on",), 0.01),
        ("brahe", "radiation", ("radiation_on",), 0.05),  # its Sun is 0.05 degrees off
        ("brahe", "tides k1", ("tides_on", "k1_on"), 0.03),
        ("brahe", "tides k1 pole", ("tides_on", "k1_on", "pole_on"), 0.03),
        ("brahe", "harris-priester", ("drag_on",), 0.1),  # of 94 km
        ("brahe", "all but air", ALL, 0.05),
        ("brahe", "all", (*ALL, "drag_on"), 0.1),
        ("satkit", "all but tides", ("sun_on", "moon_on", *RELATIVITY, "radiation_on"), 0.01),
    ],
)
def test_as_other_programs_have_it(program, case, on, metres):
    degree = 0 if case == "two bodies" else 20
    there = after_a_day(on, degree, PRESSURE[program] if "radiation_on" in on else OWN_PRESSURE, as_there="drag_on" in on)
    missed = np.linalg.norm(there - OTHERS[program][case])
    print(f"{program} {case}: {missed:.4f} m")
    assert missed < metres


def test_the_tide_of_the_pole_alone():
    own = after_a_day(("tides_on", "k1_on", "pole_on")) - after_a_day(("tides_on", "k1_on"))
    other = np.subtract(OTHERS["brahe"]["tides k1 pole"], OTHERS["brahe"]["tides k1"])
    assert np.linalg.norm(own) > 0.1
    np.testing.assert_allclose(own, other, atol=1e-3)


def test_harris_and_priester_smooth_and_in_pieces():
    """The other program joins heights of the same table by exponentials, with corners; its pole and its Sun are others, too."""
    bare = after_a_day()
    own, other = after_a_day(("drag_on",)) - bare, np.array(OTHERS["brahe"]["harris-priester"]) - bare
    print(f"harris-priester: {np.linalg.norm(own - other):.0f} m of {np.linalg.norm(other):.0f} m")
    assert np.linalg.norm(own - other) < 2e-3 * np.linalg.norm(other)


def test_heights_are_those_over_the_ellipsoid():
    """Beside the closed way, from latitude and height to a place: the first order of the flattening is 26 m off."""
    text = compile(earth.Forces(drag="harris-priester").definitions["altitude"], "altitude", "eval")
    rng = np.random.default_rng(5)
    latitude, height = np.arcsin(rng.uniform(-1.0, 1.0, 200)), rng.uniform(100e3, 1500e3, 200)
    x, y, z = earth.geodetic_to_position(latitude, rng.uniform(0.0, 6.0, 200), height).T
    r = np.sqrt(x**2 + y**2 + z**2)
    found = eval(text, {"r": r, "latitude_sin2": z**2 / r**2})
    np.testing.assert_allclose(found, height, atol=0.1)


def test_a_case_of_a_third_program_has_no_moon():
    """Published as EGM2008 10x10, Sun and Moon: the end state is that without the Moon, to 0.7 m; with it 45 m off."""
    epoch = pz.Epoch("2025-08-25T11:55:44 UTC")
    start = np.array([5442162.5926801835, -4068949.8468206248, -13456.851447751518])
    start = np.append(start, [2858.1975428173836, 3809.7859312745794, 6002.126693122689])
    end = np.array([-5276159.136, 4263301.774, -404522.560])
    state = np.concatenate(earth.transform(start[:3], start[3:], "EME2000", "GCRF", epoch))
    f = forces(10)
    missed = {}
    for moon in (0.0, 1.0):
        switches = {name: 0.0 for name in f.values if name.endswith("_on")} | {"sun_on": 1.0, "moon_on": moon}
        problem = pz.Problem(
            forces(20).model(),
            pz.Gaussian(state, [1.0] * 6),
            parameters={**switches, "cr_a_m": 0.0, "cd_a_m": 0.0, "air_exponent": 6.0},
            integrator=pz.RungeKutta8(2880),
            functions=f.functions(epoch),
            epoch=epoch,
            prior_time=0.0,
        )
        there = problem.step(state, 86400.0, 0.0)[0][:3]
        missed[moon] = np.linalg.norm(earth.transform(there, None, "GCRF", "EME2000", epoch + 86400.0)[0] - end)
    assert missed[0.0] < 1.0
    assert missed[1.0] > 40.0
