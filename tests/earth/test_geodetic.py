"""Places on the ellipsoid: both ways, and a station with known coordinates in both forms."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from piazzi import earth


@given(st.floats(-np.pi / 2, np.pi / 2), st.floats(-np.pi + 1e-9, np.pi), st.floats(-1e4, 4e7))
def test_both_ways(latitude, longitude, height):
    position = earth.geodetic_to_position(latitude, longitude, height)
    back = earth.position_to_geodetic(position)
    assert_allclose(earth.geodetic_to_position(*back), position, rtol=1e-14, atol=1e-7)
    assert back[0] == pytest.approx(latitude, abs=1e-12)
    assert back[2] == pytest.approx(height, rel=1e-14, abs=1e-7)


def test_height_is_along_the_normal_of_the_ellipsoid():
    # the definition: x = (N + h) cos(lat) cos(lon), z = (N (1 - e2) + h) sin(lat)
    a, f = 6378137.0, 1 / 298.257222101
    latitude, longitude, height = np.radians(39.007), np.radians(-104.883), 2187.0
    e2 = f * (2 - f)
    N = a / np.sqrt(1 - e2 * np.sin(latitude) ** 2)
    expected = [
        (N + height) * np.cos(latitude) * np.cos(longitude),
        (N + height) * np.cos(latitude) * np.sin(longitude),
        (N * (1 - e2) + height) * np.sin(latitude),
    ]
    assert_allclose(earth.geodetic_to_position(latitude, longitude, height, "GRS80"), expected, rtol=0, atol=1e-8)
    assert_allclose(earth.geodetic_to_position(latitude, longitude, height, (a, f)), expected, rtol=0, atol=1e-8)


def test_what_is_no_place_is_refused():
    with pytest.raises(ValueError, match=r"latitude 104\.883 deg lies beyond a pole"):
        earth.geodetic_to_position(np.radians(104.883), 0.0, 0.0)
    with pytest.raises(ValueError, match="ellipsoid 'WGS72' is not known; there are WGS84, GRS80"):
        earth.geodetic_to_position(0.0, 0.0, 0.0, "WGS72")
    with pytest.raises(ValueError, match="radius -1"):
        earth.geodetic_to_position(0.0, 0.0, 0.0, (-1.0, 0.0))
