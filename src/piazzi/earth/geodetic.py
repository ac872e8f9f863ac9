"""Latitude, longitude and height on an ellipsoid, to and from Earth-fixed positions."""

from __future__ import annotations

import numpy as np

from piazzi.arrays import Array

# equatorial radius in metres and flattening: NIMA TR8350.2 (2000); Moritz 2000, J. Geodesy 74
ELLIPSOIDS = {"WGS84": (6378137.0, 1 / 298.257223563), "GRS80": (6378137.0, 1 / 298.257222101)}


def _axes(ellipsoid: str | tuple[float, float]) -> tuple[float, float]:
    if isinstance(ellipsoid, str):
        if ellipsoid not in ELLIPSOIDS:
            raise ValueError(
                f"ellipsoid {ellipsoid!r} is not known; there are {', '.join(ELLIPSOIDS)}, or (radius in m, flattening)"
            )
        return ELLIPSOIDS[ellipsoid]
    radius, flattening = ellipsoid
    if not (radius > 0.0 and 0.0 <= flattening < 1.0):
        raise ValueError(f"ellipsoid has radius {radius!r} m and flattening {flattening!r}; it must be positive and in [0, 1)")
    return float(radius), float(flattening)


def geodetic_to_position(
    latitude: Array | float, longitude: Array | float, height: Array | float, ellipsoid: str | tuple[float, float] = "WGS84"
) -> Array:
    """Earth-fixed position (..., 3) in metres of geodetic latitude (rad), longitude (rad, east positive) and height (m).

    `ellipsoid` is WGS84, GRS80 or (equatorial radius in metres, flattening).
    Raises ValueError where a latitude is beyond a pole.
    """
    import erfa

    latitude = np.asarray(latitude, dtype=float)
    if np.any(np.abs(latitude) > np.pi / 2):
        wrong = latitude[np.abs(latitude) > np.pi / 2].flat[0]
        raise ValueError(f"latitude {np.degrees(wrong):g} deg lies beyond a pole")
    return np.asarray(erfa.gd2gce(*_axes(ellipsoid), longitude, latitude, height))


def position_to_geodetic(position: Array, ellipsoid: str | tuple[float, float] = "WGS84") -> tuple[Array, Array, Array]:
    """Geodetic latitude (rad), longitude (rad, east positive) and height (m) of Earth-fixed positions (..., 3) in metres."""
    import erfa

    axes, position = _axes(ellipsoid), np.asarray(position, dtype=float)
    longitude, latitude, height = erfa.gc2gde(*axes, position)
    radius = np.linalg.norm(position, axis=-1)  # near enough that of the meridian for steps of micrometres
    for _ in range(2):  # ERFA's answer is micrometres off at the height of satellites
        missed = position - erfa.gd2gce(*axes, longitude, latitude, height)
        sine, cosine = np.sin(latitude), np.cos(latitude)
        outwards = missed[..., 0] * np.cos(longitude) + missed[..., 1] * np.sin(longitude)
        latitude = np.clip(latitude + (missed[..., 2] * cosine - outwards * sine) / radius, -np.pi / 2, np.pi / 2)
        height = height + missed[..., 2] * sine + outwards * cosine
    return latitude, longitude, height
