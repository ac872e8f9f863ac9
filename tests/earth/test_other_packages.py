"""A day of a low orbit beside two other programs, force by force: what they gave is in tests/references/other_packages.json.

Their constants are taken: the pressure of sunlight of each, GM of EGM2008.  There Sun and Moon are those of DE440, here series.
"""

import json
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import piazzi as pz
from piazzi import earth

pytestmark = pytest.mark.slow  # one kernel with all forces
OTHERS = json.loads((Path(__file__).resolve().parents[1] / "references" / "other_packages.json").read_text())
EPOCH = pz.Epoch("2015-05-05T00:00:00 UTC")
STATE = np.array([5.2e6, -4.1e6, 1.9e6, 3.0e3, 5.4e3, 4.405e3])
PRESSURE = {"satkit": 4.559821181358738e-6, "brahe": 4.56e-6}
OWN_PRESSURE = 1361.0 / 299792458.0
RELATIVITY = ("relativity_on", "lense_thirring_on", "de_sitter_on")


def forces(degree):
    return earth.Forces(
        degree=degree,
        radiation="cannonball",
        drag="harris-priester",
        tides=("solid", "k1", "pole"),
        relativity=("schwarzschild", "lense-thirring", "de-sitter"),
    )


@cache
def after_a_day(on=(), degree=20, pressure=OWN_PRESSURE):
    f = forces(degree)
    switches = {name: float(name in on) for name in f.values if name.endswith("_on")}
    problem = pz.Problem(
        forces(20).model(),
        pz.Gaussian(STATE, [1.0] * 6),
        parameters={**switches, "cr_a_m": 0.02 * pressure / OWN_PRESSURE, "cd_a_m": 0.02, "air_exponent": 6.0},
        integrator=pz.RungeKutta8(1440),
        functions=f.functions(EPOCH),
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
        ("satkit", "radiation", ("radiation_on",), 0.06),  # its shadow is another
        ("brahe", "radiation", ("radiation_on",), 0.01),
        ("brahe", "tides k1", ("tides_on", "k1_on"), 0.03),
        ("brahe", "tides k1 pole", ("tides_on", "k1_on", "pole_on"), 0.03),
        ("satkit", "all but tides", ("sun_on", "moon_on", *RELATIVITY, "radiation_on"), 0.1),
    ],
)
def test_as_other_programs_have_it(program, case, on, metres):
    degree = 0 if case == "two bodies" else 20
    there = after_a_day(on, degree, PRESSURE[program] if "radiation_on" in on else OWN_PRESSURE)
    missed = np.linalg.norm(there - OTHERS[program][case])
    print(f"{program} {case}: {missed:.4f} m")
    assert missed < metres


def test_the_tide_of_the_pole_alone():
    own = after_a_day(("tides_on", "k1_on", "pole_on")) - after_a_day(("tides_on", "k1_on"))
    other = np.subtract(OTHERS["brahe"]["tides k1 pole"], OTHERS["brahe"]["tides k1"])
    assert np.linalg.norm(own) > 0.1
    np.testing.assert_allclose(own, other, atol=1e-3)


def test_harris_and_priester_smooth_and_in_pieces():
    """The other program joins heights of the same table by exponentials, with corners."""
    bare = after_a_day()
    own, other = after_a_day(("drag_on",)) - bare, np.array(OTHERS["brahe"]["harris-priester"]) - bare
    print(f"harris-priester: {np.linalg.norm(own - other):.0f} m of {np.linalg.norm(other):.0f} m")
    assert np.linalg.norm(own - other) < 1e-3 * np.linalg.norm(other)


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
            integrator=pz.RungeKutta8(1440),
            functions=f.functions(epoch),
            epoch=epoch,
            prior_time=0.0,
        )
        there = problem.step(state, 86400.0, 0.0)[0][:3]
        missed[moon] = np.linalg.norm(earth.transform(there, None, "GCRF", "EME2000", epoch + 86400.0)[0] - end)
    assert missed[0.0] < 1.0
    assert missed[1.0] > 40.0
