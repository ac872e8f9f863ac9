"""Propagation without measurements: against two-body motion in closed form, and against the integral of noise."""

from dataclasses import replace

import numpy as np
import pytest

import piazzi as pz

MU = 3.986004418e14
R, V = np.array([7000e3, 0.0, 0.0]), np.array([0.0, 1.2e3, 7.5e3])
TIMES = np.array([0.0, 600.0, 600.0, 5000.0, 20000.0])


def two_body(integrator=None, **changes):
    r3 = "sqrt(x**2 + y**2 + z**2)**3"
    model = pz.Model(
        ["x", "y", "z", "vx", "vy", "vz"],
        {a: f"v{a}" for a in "xyz"} | {f"v{a}": f"-mu*{a}/{r3}" for a in "xyz"},
        parameters={"mu": changes.pop("role", "fixed")},
        groups={"position": ["x", "y", "z"], "velocity": ["vx", "vy", "vz"]},
    )
    given = {"parameters": {"mu": MU}, "integrator": integrator or pz.GaussJackson(tolerance=1e-12), "prior_time": 0.0}
    return pz.Problem(model, pz.Gaussian([*R, *V], [100.0, 200.0, 50.0, 0.1, 0.2, 0.3]), **given | changes)


@pytest.fixture(autouse=True)
def _plain(monkeypatch):
    monkeypatch.setenv("PIAZZI_JIT", "0")


@pytest.mark.parametrize("integrator", [pz.GaussJackson(tolerance=1e-12), pz.RungeKutta8(max_step=60.0)])
def test_two_bodies(integrator):
    found = pz.propagate(two_body(integrator), TIMES)
    r, v = pz.propagate_kepler(R, V, MU, TIMES)
    np.testing.assert_allclose(found.mean, np.hstack([r, v]), atol=2e-3)
    P = np.diag([100.0, 200.0, 50.0, 0.1, 0.2, 0.3])
    for k, t in enumerate(TIMES):
        Phi = pz.kepler_transition(R, V, MU, t)
        np.testing.assert_allclose(found.covariance[k], Phi @ P @ Phi.T, rtol=1e-6, atol=1e-6 * np.abs(Phi @ P @ Phi.T).max())
    assert found.success


def test_backwards_and_there_again():
    """The way back is the inverse of the way there."""
    there = pz.propagate(two_body(), [3000.0])
    prior = pz.Gaussian(there.mean[0], there.covariance[0])
    back = pz.propagate(replace(two_body(), prior=prior, prior_time=3000.0), [0.0, 3000.0])
    np.testing.assert_allclose(back.mean[0], [*R, *V], atol=1e-3)
    np.testing.assert_allclose(back.mean[1], there.mean[0], atol=1e-3)
    expected = np.diag([100.0, 200.0, 50.0, 0.1, 0.2, 0.3])
    scale = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
    np.testing.assert_allclose(back.covariance[0] / scale, expected / scale, atol=1e-5)


def cart(q):
    """White noise q on the velocity: P of it is q t, of the position q t^3 / 3."""
    model = pz.Model(["x", "v"], {"x": "v", "v": "0"})
    return pz.Problem(model, pz.Gaussian([1.0, 2.0], [0.5, 0.1]), [0.0, q], integrator=pz.RungeKutta4(4), prior_time=0.0)


def test_process_noise_is_integrated():
    t, q = np.array([0.0, 3.0, 10.0]), 0.3
    found = pz.propagate(cart(q), t)
    for k, s in enumerate(t):
        Phi = np.array([[1.0, s], [0.0, 1.0]])
        Q = q * np.array([[s**3 / 3, s**2 / 2], [s**2 / 2, s]])
        np.testing.assert_allclose(found.covariance[k], Phi @ np.diag([0.5, 0.1]) @ Phi.T + Q, rtol=1e-12)
    np.testing.assert_allclose(found.mean[:, 0], 1.0 + 2.0 * t)
    with pytest.raises(ValueError, match="before the last epoch"):
        pz.propagate(cart(q), [-1.0, 1.0])


def test_a_considered_parameter_inflates():
    """As an estimated one would by itself."""
    t = [0.0, 3000.0]
    sigma = MU * 1e-6
    plain = pz.propagate(two_body(), t)
    considered = pz.propagate(two_body(role="considered", parameters={"mu": pz.Gaussian(MU, sigma**2)}), t)
    estimated = pz.propagate(two_body(role="estimated", parameters={"mu": pz.Gaussian(MU, sigma**2)}), t)
    more = considered.covariance - plain.covariance
    assert more[1, 0, 0] > 1.0
    np.testing.assert_allclose(
        more, estimated.covariance[:, :6, :6] - plain.covariance, rtol=1e-4, atol=1e-5 * np.abs(more).max()
    )


def test_a_dataset_has_names_units_and_the_date():
    problem = two_body(epoch="2016-02-13T16:00:00 UTC")
    found = pz.propagate(problem, TIMES[:2]).to_dataset()
    assert found["state_mean"].dims == ("time", "state")
    assert found.attrs["epoch"] == "2016-02-13T16:00:00 UTC"
    assert found["covariance"].shape == (2, 6, 6)


@pytest.mark.parametrize("times", [[], [np.nan], [2.0, 1.0]])
def test_times_that_cannot_be_are_refused(times):
    with pytest.raises(ValueError, match="times to propagate to must be finite and not decrease"):
        pz.propagate(cart(0.0), times)
