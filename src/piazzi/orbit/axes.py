"""Axes of the orbit at an instant, and covariances in other axes and other variables.

RTN: R along the position, N along the angular momentum, T = N x R.  TNW: T along the velocity, W along the angular momentum,
N = W x T (CCSDS 502.0-B-3, annex B).  Covariances are turned block by block, without the turning of the axes
themselves, as the
CCSDS and conjunction practice have it; ``RTN_rotating`` and ``TNW_rotating`` have velocities relative to axes that
turn as those of
two-body motion.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from piazzi.arrays import Array
from piazzi.earth.rotation import rotation_rate
from piazzi.earth.scales import Orientation
from piazzi.earth.subdaily import WITHIN_THE_DAY
from piazzi.orbit.differential import check_mu, motion, states

AXES = ("RTN", "TNW", "RTN_rotating", "TNW_rotating")


def orbit_axes(r: Any, v: Any, axes: str = "RTN") -> Array:
    """Matrix (..., 3, 3) that turns vectors into axes of the orbit: its rows are the unit vectors.

    Raises
    ------
    ValueError
        For axes that are not known, what is no state, or motion along a straight line, which has no plane.
    """
    m = motion(*states(r, v, 1.0), 1.0)
    if _checked(axes).startswith("RTN"):
        return np.stack([m.u, m.t, m.n], -2)
    along = np.broadcast_to(np.asarray(v, dtype=float), m.u.shape)
    along = along / np.linalg.norm(along, axis=-1)[..., None]
    return np.stack([along, np.cross(m.n, along), m.n], -2)


def state_axes(r: Any, v: Any, axes: str = "RTN", mu: float | None = None) -> Array:
    """Matrix (..., 6, 6) that turns deviations of position and velocity into axes of the orbit.

    Parameters
    ----------
    r, v : (..., 3)
    axes : RTN or TNW, block by block; RTN_rotating or TNW_rotating, with velocities relative to the turning axes
    mu : gravitational parameter, for TNW_rotating, whose axes turn with the curvature of the path

    Raises
    ------
    ValueError
        As `orbit_axes`, and where `mu` is needed and not given.
    """
    R = orbit_axes(r, v, axes)
    out = np.zeros((*R.shape[:-2], 6, 6))
    out[..., :3, :3] = out[..., 3:, 3:] = R
    if axes.endswith("_rotating"):
        rate = _rate(np.asarray(r, dtype=float), np.asarray(v, dtype=float), axes, mu)
        about = np.zeros(R.shape)  # dR/dt = -[w]x R, with w along the normal, the third axis
        about[..., 0, 1], about[..., 1, 0] = rate, -rate
        out[..., 3:, :3] = about @ R
    return out


def transform_root(root: Any, jacobian: Any) -> Array:
    """Lower triangular root (..., m, m) of J S S^T J^T, from a root S (..., n, k) and a Jacobian J (..., m, n).

    A covariance made of it, root @ root.T, is positive semidefinite by construction, whatever the units.
    """
    moved = np.asarray(jacobian, dtype=float) @ np.asarray(root, dtype=float)
    triangle: Array = np.linalg.qr(np.swapaxes(moved, -1, -2), mode="r")  # type: ignore[assignment]
    upper = triangle * np.where(np.diagonal(triangle, axis1=-2, axis2=-1) < 0.0, -1.0, 1.0)[..., None]
    return np.asarray(np.swapaxes(upper, -1, -2))


def covariance_root(covariance: Any) -> Array:
    """Lower triangular root (..., n, n) of a covariance; what is singular has a root too.

    Raises
    ------
    ValueError
        Where it is not symmetric or not positive semidefinite.
    """
    P = np.asarray(covariance, dtype=float)
    if P.ndim < 2 or P.shape[-1] != P.shape[-2]:
        raise ValueError(f"covariance has shape {P.shape}; it must be (..., n, n)")
    sigma = np.sqrt(np.abs(np.diagonal(P, axis1=-2, axis2=-1)))
    scale = np.where(sigma > 0.0, sigma, 1.0)
    correlation = P / scale[..., :, None] / scale[..., None, :]
    if not np.isfinite(P).all() or np.abs(correlation - np.swapaxes(correlation, -1, -2)).max() > 1e-9:
        raise ValueError("covariance is not symmetric, or not finite")
    try:
        root = np.linalg.cholesky(correlation)
    except np.linalg.LinAlgError:
        values, vectors = np.linalg.eigh(correlation)
        if values.min() < -1e-12 * P.shape[-1]:
            raise ValueError(
                f"covariance is not positive semidefinite: a correlation has eigenvalue {values.min():.3g}"
            ) from None
        root = vectors * np.sqrt(np.maximum(values, 0.0))[..., None, :]
    return transform_root(scale[..., :, None] * root, np.eye(P.shape[-1]))


def transform_covariance(covariance: Any, jacobian: Any) -> Array:
    """J P J^T by way of a root, symmetric and positive semidefinite; ValueError where P is not so itself."""
    root = transform_root(covariance_root(covariance), jacobian)
    return np.asarray(root @ np.swapaxes(root, -1, -2))


def _rate(r: Array, v: Array, axes: str, mu: float | None) -> Array:
    """Turn of the axes about the normal, rad/s, in two-body motion."""
    h = np.linalg.norm(np.cross(r, v), axis=-1)
    distance = np.linalg.norm(r, axis=-1)
    if axes == "RTN_rotating":
        return np.asarray(h / distance**2)
    if mu is None:
        raise ValueError("TNW_rotating needs mu: the velocity turns with the acceleration")
    check_mu(mu)
    return np.asarray(mu * h / (distance**3 * np.sum(v * v, axis=-1)))


def _checked(axes: str) -> str:
    if axes not in AXES:
        raise ValueError(f"axes {axes!r} are not known; there are {', '.join(AXES)}")
    return axes


def in_axes(origin: str, target: str, epochs: Any, eop: Orientation | None = WITHIN_THE_DAY) -> Array:
    """Derivatives (..., 6, 6) of position and velocity in one frame by those in another; velocities are relative to the axes.

    At an epoch, or at K of them; `eop` is the orientation of the Earth, None for the tables.
    """
    R, rate = rotation_rate(origin, target, epochs, eop)
    out = np.zeros((*R.shape[:-2], 6, 6))
    out[..., :3, :3] = out[..., 3:, 3:] = R
    out[..., 3:, :3] = rate
    return out
