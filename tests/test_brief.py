"""Whatever a session in a terminal shows is short."""

import dataclasses
import inspect

import numpy as np
import pytest

import piazzi as pz
from piazzi import earth, formats, orbit
from piazzi.scenarios import load_scenario
from piazzi.text import brief, spelled

MOST = 500
SETTINGS = {
    "Bank", "Cauchy", "Coordinates", "EOP", "Eccentricity", "Equinoctial", "Estimated", "Forces", "Huber", "Keplerian",
    "LaserSphere", "ModifiedEquinoctial", "Parameter", "Region", "Transfer", "Tukey", "Weather",
}  # fmt: skip
PUBLIC = {
    thing.__qualname__: thing
    for module in (pz, earth, formats, orbit)
    for name in module.__all__
    if inspect.isclass(thing := getattr(module, name)) and dataclasses.is_dataclass(thing)
}
LONG = ("x" * 10_000, np.zeros((1000, 6)), tuple(range(5000)), {f"name {k}": np.ones(6) for k in range(500)})


def filled(cls, value):
    """An instance with this in every field, unchecked."""
    thing = object.__new__(cls)
    for field in dataclasses.fields(cls):
        object.__setattr__(thing, field.name, value)
    return thing


@pytest.mark.parametrize("name", sorted(name for name, cls in PUBLIC.items() if cls.__repr__ is brief))
def test_whatever_is_in_it_a_result_is_short(name):
    for value in LONG:
        assert len(repr(filled(PUBLIC[name], value))) <= MOST


def test_all_others_are_settings():
    """Words and numbers that somebody typed, shown whole, as they are typed."""
    whole = {name for name, cls in PUBLIC.items() if hasattr(cls.__repr__, "__wrapped__")}
    typed = {name for name in whole if issubclass(PUBLIC[name], pz.Integrator) or hasattr(PUBLIC[name], "estimate")}
    assert whole - typed == SETTINGS


def test_what_is_said_is_what_differs_from_the_defaults():
    assert repr(pz.Schedule(every=60.0)) == "Schedule(every=60.0)"
    assert repr(pz.Gaussian([1.0, 2.5], np.eye(2))) == "Gaussian(mean=(1.0, 2.5), covariance=<2 x 2 numbers>)"
    assert len(repr(earth.ilrs_stations())) <= MOST
    assert len(repr(earth.ilrs_stations()["7090"])) <= MOST
    assert len(repr(earth.gravity_field("EGM2008"))) <= MOST
    assert "x" * 61 not in repr(filled(pz.Schedule, "x" * 100))


def test_files_that_were_read_are_short(tmp_path):
    rows = pz.read_tracking(pz.determination.case_file.CASES / "ceres-1801.txt", sigma="5arcsec")
    assert repr(rows).startswith("<Observations: 40 rows, right_ascension, declination by Palermo")
    assert len(repr(rows.segments[0])) <= MOST and len(repr(rows)) <= MOST


def test_what_kernels_are_named_by_is_spelled_in_full():
    """A name that left anything out would give one model the code of another."""
    model = load_scenario("leo-radar").problem.model
    text = spelled(model)
    assert len(repr(model)) <= MOST and all(len(repr(sensor)) <= MOST for sensor in model.sensors)
    for words in (*model.dynamics, *(equation for sensor in model.sensors for equation in sensor.equations)):
        assert repr(words) in text
    changed = dataclasses.replace(model, dynamics=(*model.dynamics[:5], model.dynamics[5] + " + 1e-9"))
    assert repr(changed) == repr(model) and spelled(changed) != text


def test_spelled_is_what_generated_texts_are():
    @dataclasses.dataclass(frozen=True)
    class Pair:
        a: object
        b: object
        c: int = dataclasses.field(default=1, repr=False)

    for value in (Pair(1, "x"), Pair((Pair(1.5, None),), [Pair("y", (1,)), ()]), (1, Pair({"k": 2}, True))):
        assert spelled(value) == repr(value).replace(Pair.__qualname__, "Pair").replace("Pair", Pair.__qualname__)
