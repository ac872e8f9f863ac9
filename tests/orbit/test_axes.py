"""Axes of the orbit, and covariances that stay positive definite wherever they are carried."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from piazzi.orbit import (
    Equinoctial,
    Keplerian,
    ModifiedEquinoctial,
    covariance_root,
    orbit_axes,
    propagate_kepler,
    state_axes,
    transform_covariance,
    transform_root,
)

MU = 3.986004418e14
R, V = np.array([7e6, 1e6, -2e6]), np.array([1e3, 7e3, 2.5e3])


def test_axes_are_those_of_their_definition():
    A = orbit_axes(R, V, "RTN")
    assert_allclose(A @ A.T, np.eye(3), atol=1e-15)
    assert_allclose(A @ R, [np.linalg.norm(R), 0, 0], atol=1e-8)
    assert (A @ V)[1] > 0
    assert abs((A @ V)[2]) < 1e-12
    B = orbit_axes(R, V, "TNW")
    assert np.linalg.det(B) == pytest.approx(1)
    assert_allclose(B @ V, [np.linalg.norm(V), 0, 0], atol=1e-11)
    assert_allclose(B[2], A[2], atol=1e-15)
    assert (B @ R)[1] < 0  # N points away from the centre of curvature's side: N = W x T


def test_many_at_once_are_each_by_itself():
    r, v = np.random.default_rng(0).normal(size=(2, 4, 5, 3))
    all_at_once = state_axes(r, v, "TNW_rotating", mu=1.0)
    assert all_at_once.shape == (4, 5, 6, 6)
    assert_allclose(all_at_once[2, 3], state_axes(r[2, 3], v[2, 3], "TNW_rotating", mu=1.0), rtol=1e-14)


def test_block_by_block_leaves_the_turning_out():
    A, R3 = state_axes(R, V, "RTN"), orbit_axes(R, V)
    assert_allclose(A, np.kron(np.eye(2), R3))


@pytest.mark.parametrize("axes", ["RTN_rotating", "TNW_rotating"])
def test_rotating_axes_have_the_rate_of_a_neighbour(axes):
    """The velocity of a small deviation in turning axes is how fast its components there change, for any motion of it."""
    d, w, h = np.array([30.0, -20.0, 50.0]), np.array([0.1, 0.3, -0.2]), 1e-2
    r, v = propagate_kepler(R, V, MU, np.array([-h, h]))
    d_t = np.stack([d - w * h, d + w * h])
    components = np.einsum("kij,kj->ki", orbit_axes(r, v, axes), d_t)
    expected = (components[1] - components[0]) / (2 * h)
    assert_allclose((state_axes(R, V, axes, MU) @ [*d, *w])[3:], expected, rtol=0, atol=1e-9)


def test_roots_keep_covariances_positive_definite_through_every_set():
    """Metres, numbers and radians in one matrix, 14 digits apart: rounding alone would make it indefinite."""
    rng = np.random.default_rng(4)
    S = np.tril(rng.normal(size=(6, 6))) * np.array([1e-3, 1e-3, 1e-3, 1e-9, 1e-9, 1e-9])[:, None]
    for kind in (Keplerian("mean"), Equinoctial(), ModifiedEquinoctial()):
        elements = kind.from_state(R, V, MU)
        there = transform_root(S, kind.jacobian_from_state(R, V, MU))
        assert_allclose(there, np.tril(there))
        assert (np.diag(there) > 0).all()
        back = transform_root(there, kind.jacobian_to_state(elements, MU))
        assert_allclose(back @ back.T, S @ S.T, rtol=1e-7, atol=1e-9 * np.abs(S @ S.T).min())
        np.linalg.cholesky(there / np.linalg.norm(there, axis=1)[:, None] @ (there / np.linalg.norm(there, axis=1)[:, None]).T)


def test_covariances_of_many_states_and_singular_ones():
    P = np.diag([4.0, 9.0, 0.0])
    J = np.random.default_rng(1).normal(size=(7, 2, 3))
    assert_allclose(transform_covariance(P, J), J @ P @ np.swapaxes(J, 1, 2), atol=1e-12)
    assert_allclose(covariance_root(P), np.diag([2.0, 3.0, 0.0]), atol=1e-12)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: orbit_axes(R, V, "LVLH"), "axes 'LVLH' are not known; there are RTN, TNW"),
        (lambda: orbit_axes(R, R), "straight line"),
        (lambda: state_axes(R, V, "TNW_rotating"), "needs mu"),
        (lambda: covariance_root([[1, 0], [0, -1]]), "not positive semidefinite"),
        (lambda: covariance_root([[1, 0.5], [0, 1]]), "not symmetric"),
        (lambda: covariance_root([1, 2]), r"shape \(2,\)"),
    ],
)
def test_what_makes_no_sense_is_refused(call, message):
    with pytest.raises(ValueError, match=message):
        call()
