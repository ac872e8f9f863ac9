"""A simulated pass of every sensor, determined by the graph: truths are off as covariances say."""

import pytest

from piazzi.earth import sensors
from tests.references.sensor_consistency import NAMES, bounds, consistency

RUNS = 100


def test_every_sensor_is_among_them():
    known = {name for name in sensors.__all__ if name not in ("Instrument", "two_satellites")}
    assert known == {name.split(",", maxsplit=1)[0] for name in NAMES}


@pytest.mark.slow  # kernels of each sensor
@pytest.mark.parametrize("name", NAMES)
def test_passes_determined_by_the_graph_are_consistent(name):
    squares, values = consistency(name, RUNS)
    low, high = bounds(RUNS, values)
    assert low < squares.sum() < high, squares.mean() / values
