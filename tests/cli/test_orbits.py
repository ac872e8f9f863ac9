"""`piazzi orbits`: what it says where measurements are too few, exit statuses, and bad input in one line."""

import json

import numpy as np
import pytest

TWO = """00001         A1801 01 01.82630 03 38 23.07 +16 17 25.5                 MC004500
00001         A1801 01 22.76871 03 38 07.15 +17 43 05.0                 MC004500
"""


@pytest.fixture
def two(tmp_path):
    path = tmp_path / "two.txt"
    path.write_text(TWO)
    return path


pytestmark = pytest.mark.filterwarnings("ignore::piazzi.earth.EOPWarning")


@pytest.mark.slow
def test_two_directions_are_a_ridge_and_exit_3(call, two, tmp_path):
    """Four numbers of six: both commands say which, and how far away it may be; nothing is called an orbit."""
    found = call("orbits", two, "--about", "sun", "--sigma", "5arcsec", "-o", tmp_path / "o.json", "--json")
    assert found.status == 3
    facts = found.document
    assert facts["schema"] == "piazzi.orbits/1" and facts["about"] == "sun" and facts["modes"] == []
    low, middle, high = facts["ridge"]["distance"]
    assert 1e8 < low < middle < high < 1e13
    right, declination, *_ = facts["ridge"]["attributable"]["mean"]
    assert 54 < np.degrees(right) < 55 and 16.2 < np.degrees(declination) < 17.8
    assert json.loads((tmp_path / "o.json").read_text()) == facts
    found = call("determine", two, "--about", "sun", "--sigma", "5arcsec")
    assert found.status == 3
    assert "of six numbers" in found.out and "km away" in found.out


def test_one_direction_is_less(call, tmp_path):
    path = tmp_path / "one.txt"
    path.write_text(TWO[:81])
    found = call("orbits", path, "--about", "sun", "--sigma", "5arcsec")
    assert found.status == 3 and "of six numbers" in found.out and "km away" not in found.out


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["nothing.txt"], "No such file"),
        (["two.txt", "--about", "mars"], "'mars'"),
        (["two.txt", "--about", "sun", "--sigma", "x"], "sigma"),
        (["two.txt", "-o", "x.oem"], ".json"),
        ([], "TRACKING"),
    ],
)
def test_bad_input_is_refused(call, two, monkeypatch, arguments, says):
    monkeypatch.chdir(two.parent)
    assert says in call("orbits", *arguments).refused()
