"""Harmonics that are added to a field: the acceleration is that of the field with the sum of both coefficients."""

from dataclasses import replace

import numpy as np
import pytest

import piazzi as pz
from piazzi import earth
from piazzi.earth.force_harmonics import HARMONICS

EPOCH = pz.Epoch("2015-05-05T00:00:00 UTC")
T = 1234.5
X = np.array([5.2e6, -4.1e6, 1.9e6, 3.0e3, 5.4e3, 4.405e3])
NAMES = ("C20", "C21", "S21", "C22", "S22", "C30", "C31", "S33", "C40", "S43", "C64", "S65")
SIZES = {f"delta_{name}": (-1.0) ** i * (i + 1) * 1e-7 for i, name in enumerate(NAMES)}


@pytest.fixture
def uncompiled(monkeypatch):
    """The same source without compiling it: each model is asked for two accelerations."""
    monkeypatch.setenv("PIAZZI_JIT", "0")


def problem(forces, **given):
    model = forces.model(parameters=[name for name in given if name not in forces.parameters])
    values = {**forces.values, **dict.fromkeys((n for n in forces.parameters if n not in forces.values), 0.0), **given}
    return pz.Problem(
        model,
        pz.Gaussian(X, [1.0] * 6),
        parameters=values,
        functions=forces.functions(EPOCH),
        epoch=EPOCH,
        prior_time=0.0,
    )


def bare(**more):
    return earth.Forces(degree=8, bodies=(), tides=(), relativity=False, **more)


def with_coefficients(field, sizes):
    """The field with each coefficient changed in its own table."""
    c, s = np.array(field.c), np.array(field.s)
    for name, size in sizes.items():
        (c if name[6] == "C" else s)[int(name[7]), int(name[8])] += size
    return replace(field, c=c, s=s)


@pytest.mark.usefixtures("uncompiled")
@pytest.mark.parametrize("gravity", ["EGM2008", pytest.param("IERS2010", marks=pytest.mark.slow)])
def test_what_is_added_is_what_another_field_has(gravity):
    forces = bare(gravity=gravity, harmonics=NAMES)
    found = problem(forces, **SIZES).dynamics(X, T) - problem(forces).dynamics(X, T)
    W = earth.rotation("GCRF", "ITRF", EPOCH + T)
    at = W @ X[:3]
    field = forces.field.at(EPOCH)
    other = np.array(earth.Gravity(with_coefficients(field, SIZES), 8).value(*at)) - earth.Gravity(field, 8).value(*at)
    np.testing.assert_allclose(found[3:], W.T @ other, atol=3e-15)
    assert np.linalg.norm(other) > 1e-7


@pytest.mark.slow  # models of their own
@pytest.mark.usefixtures("uncompiled")
@pytest.mark.parametrize("name", HARMONICS[::7])
def test_each_alone(name):
    forces = bare(harmonics=(name,))
    sizes = {f"delta_{name}": 1e-6}
    found = problem(forces, **sizes).dynamics(X, T) - problem(forces).dynamics(X, T)
    W = earth.rotation("GCRF", "ITRF", EPOCH + T)
    field = forces.field
    at = W @ X[:3]
    other = np.array(earth.Gravity(with_coefficients(field, sizes), 9).value(*at)) - earth.Gravity(field, 9).value(*at)
    np.testing.assert_allclose(found[3:], W.T @ other, atol=3e-15)


@pytest.mark.usefixtures("uncompiled")
def test_a_switch_and_what_there_is_not():
    forces = bare(harmonics=("C20",))
    one = problem(forces, delta_C20=1e-6, harmonics_on=0.0)
    np.testing.assert_array_equal(one.dynamics(X, T), problem(forces).dynamics(X, T))
    with pytest.raises(ValueError, match="harmonics has 'S20'; there are C20"):
        bare(harmonics=("S20",))
    with pytest.raises(ValueError, match="there are none about the Sun"):
        earth.Forces(about="sun", harmonics=("C20",))


@pytest.mark.slow  # its kernels
def test_a_coefficient_is_estimated():
    """Positions of half a day in a field with another J2: it is found within three of its sigmas, far below its prior's."""
    forces = bare(harmonics=("C20",))
    position = pz.Sensor("position", {"px": "x", "py": "y", "pz": "z"})
    found = pz.Problem(
        forces.model([position], {"delta_C20": "estimated"}),
        pz.Gaussian(X, [100.0] * 3 + [0.1] * 3),
        stations=[pz.Station("own", "position", [1.0, 1.0, 1.0])],
        parameters={**forces.values, "delta_C20": pz.Gaussian(0.0, 1e-14)},
        functions=forces.functions(EPOCH),
        epoch=EPOCH,
        prior_time=0.0,
        truth=pz.Truth(parameters={"delta_C20": 1.5e-7}),
    )
    estimate = pz.BatchLeastSquares().estimate(
        found, pz.simulate(found, np.arange(0.0, 43200.0, 300.0), np.random.default_rng(1))
    )
    assert estimate.success
    sigma = np.sqrt(estimate.covariance[-1, 6, 6])
    assert sigma < 3e-9
    assert abs(estimate.mean[-1, 6] - 1.5e-7) < 3 * sigma
