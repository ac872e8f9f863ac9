"""A million lines: how long they take, and how much memory at their peak."""

import tracemalloc

import numpy as np
import pytest

import piazzi as pz
from tests.formats.test_tdm import message
from tests.waiting import little

LINES = 1_000_000


@pytest.fixture(scope="module")
def million(tmp_path_factory):
    rng = np.random.default_rng(1)
    keywords = ["RANGE", "DOPPLER_INSTANTANEOUS", "ANGLE_1", "ANGLE_2"]
    when = (np.datetime64("2020-01-01T00:00:00.000") + np.arange(LINES // 4) * np.timedelta64(500, "ms")).astype(str).tolist()
    values = rng.uniform(-90, 90, LINES).tolist()
    data = [f"{keywords[i % 4]} = {when[i // 4]} {value:.9f}" for i, value in enumerate(values)]
    path = tmp_path_factory.mktemp("large") / "a.tdm"
    path.write_text(message(data, ANGLE_TYPE="AZEL"))
    return path, values


@pytest.mark.slow
def test_a_million_lines_are_read_in_three_seconds(million):
    path, values = million
    pz.read_tracking(path)  # imports and tables
    rows = little(lambda: pz.read_tracking(path), 3.0)
    assert len(rows) == LINES
    factor = np.tile([1e3, 1e3, np.pi / 180, np.pi / 180], LINES // 4)
    np.testing.assert_allclose(rows.value, np.array([float(f"{value:.9f}") for value in values]) * factor, rtol=1e-15)


@pytest.mark.slow
def test_a_row_takes_two_hundred_bytes_at_most(million):
    path, _ = million
    tracemalloc.start()
    try:
        rows = pz.read_tracking(path)
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert peak / len(rows) < 200


@pytest.mark.slow
def test_a_million_laser_ranges(tmp_path, data_dir):
    """The header of a real pass, and its first range a million times, a millisecond apart."""
    lines = (data_dir / "earth/lageos2/lageos2_20160214.npt").read_text().splitlines()
    at = next(i for i, line in enumerate(lines) if line.startswith("11 "))
    first = lines[at].split()
    start = float(first[1])
    rows = [" ".join(["11", f"{start + 1e-3 * i:.12f}", *first[2:]]) for i in range(LINES)]
    path, short = tmp_path / "a.npt", tmp_path / "b.npt"
    path.write_text("\n".join([*lines[:at], *rows, "H8", "H9"]) + "\n")
    short.write_text("\n".join([*lines[:at], *rows[: LINES // 5], "H8", "H9"]) + "\n")
    del rows
    pz.read_tracking(data_dir / "earth/lageos2/lageos2_20160214.npt")
    found = little(lambda: pz.read_tracking(path), 3.0)
    assert len(found) == LINES and found.t[-1] - found.t[0] == pytest.approx(1e-3 * (LINES - 1), abs=1e-9)
    del found
    tracemalloc.start()
    try:
        pz.read_tracking(short)  # to be counted takes ten times as long
        assert tracemalloc.get_traced_memory()[1] < 200 * LINES // 5
    finally:
        tracemalloc.stop()
