"""Integrators by name: each with the options of its class, in the units of the file."""

from dataclasses import fields

import pytest

import piazzi as pz
from piazzi import kernels
from piazzi.kernels.integrators import Integrator
from piazzi.scenarios.motion import INTEGRATORS, read_integrator, write_integrator
from piazzi.scenarios.table import Faults, Table
from piazzi.units import Units

OPTIONS = {"runge-kutta": {"a": [[], [0.5]], "b": [0.0, 1.0]}}


def read(table, units=None):
    faults = Faults()
    return read_integrator(Table(table, "integrator", faults), units or Units()), faults


def methods(kind=Integrator):
    """Every class that a problem can be given: all below Integrator that have a scheme."""
    for below in kind.__subclasses__():
        yield from methods(below)
        if below.__module__.startswith("piazzi.") and below is not kernels.ExplicitRungeKutta:
            yield below


def test_every_method_has_a_name():
    assert set(INTEGRATORS.values()) == set(methods())


def test_the_founding_texts_step_goes_by_what_it_does_and_by_its_old_name():
    assert pz.Taylor is pz.ConstantAcceleration
    assert read({"method": "taylor", "substeps": 3}) == read({"method": "constant-acceleration", "substeps": 3})
    assert write_integrator(pz.Taylor(3))["method"] == "constant-acceleration"


@pytest.mark.parametrize("name", INTEGRATORS)
def test_a_name_and_its_options_come_back(name):
    integrator, faults = read({"method": name, **OPTIONS.get(name, {}), "max_step": 2.5})
    assert not faults
    assert type(integrator) is INTEGRATORS[name]
    assert integrator.max_step == 2.5
    assert read(write_integrator(integrator)) == (integrator, [])


@pytest.mark.parametrize("name", INTEGRATORS)
@pytest.mark.parametrize("junk", ["x", [1], {}, True, -1, 0, 1e400, float("nan"), 10**400, [[]]])
def test_no_value_of_an_option_brings_the_reader_down(name, junk):
    for field in fields(INTEGRATORS[name]):
        integrator, faults = read({"method": name, **OPTIONS.get(name, {}), field.name: junk})
        assert integrator is not None or faults
        assert all(str(f).isprintable() for f in faults)


def test_the_longest_step_is_in_the_time_of_the_file():
    assert read({"method": "rk4", "max_step": 2}, Units.parse("min"))[0].max_step == 120


def test_a_gravitational_parameter_is_a_name_or_in_the_units_of_the_file():
    assert read({"method": "kepler", "mu": "GM"}, Units.parse("km"))[0].mu == "GM"
    assert read({"method": "kepler", "mu": 4e5}, Units.parse("km"))[0].mu == 4e14


@pytest.mark.parametrize(
    ("table", "says"),
    [
        ({"method": "rk5"}, "did you mean"),
        ({"method": 4}, "must be text"),
        ({"substeps": 4}, "needs a method"),
        ({"method": "rk4", "substeps": 2, "max_step": 1.0}, "not both"),
        ({"method": "rk4", "rtol": 1e-9}, "integrator.rtol: unknown key"),
        ({"method": "runge-kutta", "a": [[]], "b": [0.5]}, "weights b add up to 0.5"),
        ({"method": "adaptive", "rtol": 2.0}, "rtol is 2.0"),
    ],
)
def test_faults_are_told(table, says):
    assert says in str(read(table)[1][0])


def test_nothing_said_is_no_integrator():
    assert read({}) == (None, [])
