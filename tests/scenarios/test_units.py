"""Units: what a file says in km and degrees is the same problem as what it says in metres and radians."""

import math
import tomllib

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from piazzi.scenarios import show
from piazzi.scenarios.loader import read_scenario
from piazzi.scenarios.table import Faults
from piazzi.units import DIMENSIONS, TABLE, Units

MIXED = """
units = "{units}"
[states]
x = "length"
v = "length/time"
[dynamics]
x = "v"
v = "-g + k*v"
[parameters]
g = {{ value = {g}, unit = "length/time**2" }}
k = {{ value = {k}, sigma = {k_sigma}, unit = "1/time", role = "estimated" }}
[sensors.s]
numbers = {{ h = "length" }}
components.elevation = {{ equation = "atan2(x, h)", unit = "angle" }}
components.height = {{ equation = "x", unit = "length" }}
[[stations]]
name = "a"
noise = {{ covariance = [[{r_ee}, {r_eh}], [{r_eh}, {r_hh}]] }}
numbers = {{ h = {h} }}
[prior]
mean = {{ x = {x}, v = {v} }}
variance = [{p_xx}, {p_vv}]
time = {start}
[process_noise]
sigma = {{ v = {q_v} }}
[integrator]
method = "rk4"
max_step = {max_step}
[times]
start = {start}
step = {step}
count = 5
[truth]
state = [{x}, {v}]
parameters = {{ g = {g} }}
"""
L, A, T = 1000.0, math.pi / 180, 60.0
SI = {
    "units": "m, rad, s",
    "g": 9.81,
    "k": 0.01,
    "k_sigma": 0.002,
    "r_ee": 1e-4,
    "r_eh": 1e-3,
    "r_hh": 25.0,
    "h": 1500.0,
    "x": 2e4,
    "v": 300.0,
    "p_xx": 1e6,
    "p_vv": 100.0,
    "start": 120.0,
    "step": 30.0,
    "q_v": 0.5,
    "max_step": 6.0,
}
POWERS = {  # of length, angle and time in each number
    "g": (1, 0, -2),
    "k": (0, 0, -1),
    "k_sigma": (0, 0, -1),
    "r_ee": (0, 2, 0),
    "r_eh": (1, 1, 0),
    "r_hh": (2, 0, 0),
    "h": (1, 0, 0),
    "x": (1, 0, 0),
    "v": (1, 0, -1),
    "p_xx": (2, 0, 0),
    "p_vv": (2, 0, -2),
    "start": (0, 0, 1),
    "step": (0, 0, 1),
    "q_v": (1, 0, -1),
    "max_step": (0, 0, 1),
}


def read(numbers):
    faults = Faults()
    scenario = read_scenario(tomllib.loads(MIXED.format(**numbers)), "mixed", faults)
    assert scenario is not None, faults
    return scenario


def test_every_number_is_converted_means_variances_and_times_alike():
    other = {k: SI[k] / (L**a * A**b * T**c) for k, (a, b, c) in POWERS.items()}
    si, converted = read(SI), read({**other, "units": "km, deg, min"})
    p, q = si.problem, converted.problem
    for value, same in (
        (q.mean, p.mean),
        (q.covariance, p.covariance),
        (q.given, p.given),
        (q.station_noise, p.station_noise),
        (q.station_numbers, p.station_numbers),
        (q.process_noise.covariance, p.process_noise.covariance),
        (q.prior_time, p.prior_time),
        (q.integrator.max_step, p.integrator.max_step),
        (converted.times, si.times),
        (q.truth.state, p.truth.state),
        (q.truth.parameters["g"], p.truth.parameters["g"]),
    ):
        assert_allclose(value, same, rtol=1e-14, atol=0)
    assert q.model == p.model


def test_founding_problem_in_kilometres_and_degrees():
    text = show("satellite-bearing").replace('"m, deg"', '"km, deg"')
    for metres, kilometres in {
        "3.986e14": "3.986e5",
        "[0.0, 2e7, 4500.0, 0.0]": "[0.0, 2e4, 4.5, 0.0]",
        "[1e6, 3e6, 800.0, 800.0]": "[1e3, 3e3, 0.8, 0.8]",
        "[0.01, 0.01, 0.0025, 0.0025]": "[1e-8, 1e-8, 2.5e-9, 2.5e-9]",
        "6.371e6": "6371.0",
    }.items():
        assert metres in text
        text = text.replace(metres, kilometres)
    faults = Faults()
    found = read_scenario(tomllib.loads(text), "km", faults)
    given = read_scenario(tomllib.loads(show("satellite-bearing")), "m", faults)
    assert not faults
    assert_allclose(found.problem.covariance, given.problem.covariance, rtol=1e-15)
    assert_allclose(found.problem.given, given.problem.given, rtol=1e-15)
    assert_allclose(found.problem.process_noise.covariance, given.problem.process_noise.covariance, rtol=1e-14)
    assert found.picture == given.picture


@given(st.sampled_from(sorted(TABLE)), st.integers(-3, 3).filter(bool), st.sampled_from(sorted(TABLE)), st.integers(1, 3))
def test_units_multiply_and_divide(a, i, b, j):
    product, quotient = Units().unit(f"{a}**{i} * {b}^{j}"), Units().unit(f"{a}**{i}/{b}**{j}")
    one, other = Units().unit(f"{a}^{i}"), Units().unit(f"{b}**{j}")
    assert_allclose([product.factor, quotient.factor], [one.factor * other.factor, one.factor / other.factor], rtol=1e-14)
    assert product.powers == tuple(p + q for p, q in zip(one.powers, other.powers, strict=True))
    assert quotient.powers == tuple(p - q for p, q in zip(one.powers, other.powers, strict=True))


@given(st.sampled_from(sorted(TABLE)), st.sampled_from(sorted(TABLE)))
def test_the_name_of_the_si_unit_is_a_unit_of_factor_one(a, b):
    unit = Units().unit(f"{a}**2/{b}")
    simple = unit.label.replace(" ", "*")
    if "(" not in simple and simple:
        again = Units().unit(simple)
        assert again.factor == 1.0
        assert again.powers == unit.powers


def test_dimension_words_mean_the_units_of_the_header():
    units = Units.parse("km, deg, h, t")
    for word, name in zip(DIMENSIONS, ("km", "deg", "h", "t"), strict=True):
        assert units.unit(word) == Units().unit(name)
    assert units.unit("length/time**2").factor == pytest.approx(1000 / 3600**2, rel=1e-15)
    assert units.unit("km/s") == Units().unit("km/s")


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("lenght", "did you mean 'length'"),
        ("", "is no unit"),
        ("m//s", "is no unit"),
        ("m s", "is no unit"),
        ("m**", "is no unit"),
        ("2*m", "is no unit"),
        ("m**999", "is no unit"),
        ("au**99", "out of range"),
        ("__import__", "is no unit"),
        ("m" * 10**6, "is no unit"),
    ],
)
def test_what_is_no_unit_is_refused(text, says):
    with pytest.raises(ValueError, match=r"unit") as error:
        Units().unit(text)
    assert says in str(error.value)
    assert len(str(error.value)) < 300


@pytest.mark.parametrize("header", ["km, m", "parsec", "", "m/s", "km,", "N"])
def test_a_header_names_one_unit_of_each_dimension(header):
    with pytest.raises(ValueError, match=r"unit"):
        Units.parse(header)


@given(st.text(max_size=100))
def test_any_text_is_a_unit_or_a_value_error(text):
    try:
        unit = Units().unit(text)
    except ValueError as error:
        assert len(str(error).splitlines()) == 1
    else:
        assert 0 < unit.factor < np.inf


def test_a_digit_behind_a_name_is_its_power():
    """As people write m/s2 and m2/kg."""
    units = Units()
    assert units.unit("m/s2") == units.unit("m/s**2") and units.unit("m2/kg") == units.unit("m**2/kg")
    for text in ("m1", "m22", "2m", "m 2", "m2**2"):
        with pytest.raises(ValueError, match="is no unit"):
            units.unit(text)
