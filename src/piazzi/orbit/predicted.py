"""States and covariances over time as an ephemeris, in any frame."""

from __future__ import annotations

from typing import Any

import numpy as np

from piazzi.arrays import Array
from piazzi.earth import Epoch
from piazzi.earth.rotation import frame_named
from piazzi.formats.ephemeris import Arc, Ephemeris
from piazzi.orbit.axes import in_axes, state_axes


def ephemeris_of(
    name: str,
    epoch: Epoch,
    t: Array,
    state: Array,
    covariance: Array | None,
    frame: str = "GCRF",
    scale: str = "UTC",
    **told: Any,
) -> Ephemeris:
    """The ephemeris of states (K, 6) in m and m/s on the axes of the GCRF, `t` seconds past the epoch.

    Parameters
    ----------
    name, epoch, t, state : see above
    covariance : (K, 6, 6) in the GCRF, or None
    frame, scale : of the ephemeris
    told : further attributes of its `Arc`
    """
    frame = frame_named(frame)
    if frame != "GCRF":
        J = in_axes("GCRF", frame, [epoch + float(s) for s in t])
        state = (J @ state[..., None])[..., 0]
        covariance = None if covariance is None else J @ covariance @ np.swapaxes(J, 1, 2)
    blocks: dict[str, Any] = {}
    if covariance is not None:
        blocks = {"covariance_t": t, "covariance": covariance, "covariance_frames": (frame,) * len(t)}
    arc = Arc(
        epoch=epoch, t=t, position=state[:, :3], velocity=state[:, 3:], name=name, centre="EARTH", frame=frame, scale=scale,
        **blocks, **told,
    )  # fmt: skip
    return Ephemeris(arcs=(arc,), format="OEM")


def sigma_in_orbit(state: Array, covariance: Array) -> Array:
    """Standard deviations (K, 6) along R, T and N."""
    J = state_axes(state[:, :3], state[:, 3:], "RTN")
    P = J @ covariance @ np.swapaxes(J, 1, 2)
    return np.asarray(np.sqrt(np.maximum(np.diagonal(P, axis1=1, axis2=2), 0.0)))
