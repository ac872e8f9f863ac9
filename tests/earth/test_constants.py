"""Constants: the page has what the code has, the modules use what the table says, and values fit one another."""

import math
from pathlib import Path

import pytest

from piazzi.earth import bodies, constants, observatories, satellites
from piazzi.earth.constants import GM

PAGE = Path(__file__).resolve().parents[2] / "docs" / "constants.md"


def test_the_page_has_the_tables_of_the_code():
    assert constants.tables() in PAGE.read_text(encoding="utf-8")


def test_every_constant_has_a_source_and_is_there_once():
    table = constants.constants()
    assert len({c.name for c in table}) == len(table)
    assert all(c.source and math.isfinite(c.value) for c in table)
    assert {s.name for s in satellites.LASER_SPHERES} <= {
        row.split(" |")[0].strip("| ") for row in constants.tables().splitlines()
    }


def test_modules_use_the_values_of_the_table():
    from piazzi.formats import crd, mpc

    assert bodies.AU == mpc.AU == constants.ASTRONOMICAL_UNIT
    assert crd.C == constants.SPEED_OF_LIGHT
    assert observatories.RADIUS == 6378137.0


def test_values_fit_one_another():
    # the figure that the ratio of masses gives; the mean motion of the Earth about the Sun (Gauss) to its digits
    assert GM["moon"] / GM["earth"] == pytest.approx(1 / 81.30056822, rel=1e-8)
    assert GM["sun"] / GM["earth"] == pytest.approx(332946.0487, rel=1e-8)
    gauss = 0.01720209895**2 * constants.ASTRONOMICAL_UNIT**3 / 86400.0**2
    assert GM["sun"] == pytest.approx(gauss, rel=1e-9)
    assert pytest.approx(4.54e-6, rel=1e-3) == constants.SOLAR_PRESSURE
    assert 2 * math.pi / constants.EARTH_SPIN == pytest.approx(86164.0989, abs=0.01)
    assert GM["earth"] * (1 + 1.550519768e-8) == pytest.approx(3.986004415e14, rel=1e-9)  # seconds of TDB and of TT: L_B
    # masses of systems over that of the Sun, as published by the IAU
    inverse = {"mercury": 6023657.33, "venus": 408523.719, "mars": 3098703.59, "jupiter": 1047.348644, "saturn": 3497.9018,
               "uranus": 22902.98, "neptune": 19412.26}  # fmt: skip
    for name, ratio in inverse.items():
        assert GM["sun"] / GM[name] == pytest.approx(ratio, rel=3e-5)
