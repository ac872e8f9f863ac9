"""What must not change an estimate: turns of a bearing, the order of an epoch, the split of an update, where the cut lies."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

import piazzi as pz
from tests.laws.problems import assert_same_estimate, network, satellite, sigma

SEEDS = st.integers(0, 2**32 - 1)
UPDATES = st.sampled_from(["joint", "components"])
TURN = 2 * np.pi
ROOT = Path(__file__).resolve().parents[2]


def observed(seed, epochs=6, stations=None):
    """A network and a tracking of it in which a third of the values is missing."""
    rng = np.random.default_rng(seed)
    problem = network(rng)
    tracking = pz.simulate(problem, np.cumsum(rng.uniform(0.05, 0.6, epochs)), rng, stations)
    values = np.where(rng.random(tracking.values.shape) < 0.3, np.nan, tracking.values)
    values[0, 0] = tracking.values[0, 0]
    return problem, pz.Tracking(tracking.row_times, values, tracking.row_stations)


@pytest.mark.usefixtures("uncompiled")
class TestNetwork:
    """Stations with one, two and three components, angles among them, full R."""

    @given(SEEDS, UPDATES, st.integers(-3, 3))
    @settings(max_examples=15)
    def test_whole_turns_of_an_angle_change_nothing(self, seed, update, turns):
        problem, tracking = observed(seed)
        angles = {"radar": 1, "doppler": 0}
        values = tracking.values.copy()
        for row, name in zip(values, tracking.row_stations, strict=True):
            sensor = problem.stations[problem.station_index(str(name))].sensor
            if sensor in angles:
                row[angles[sensor]] += turns * TURN
        turned = pz.Tracking(tracking.row_times, values, tracking.row_stations)
        ekf = pz.ExtendedKalmanFilter(update)
        assert_same_estimate(ekf.estimate(problem, turned), ekf.estimate(problem, tracking), 1e-9)

    @given(SEEDS)
    @settings(max_examples=15)
    def test_components_equal_joint(self, seed):
        problem, tracking = observed(seed)
        joint, components = (pz.ExtendedKalmanFilter(u).estimate(problem, tracking) for u in ("joint", "components"))
        assert_same_estimate(components, joint, 1e-9)
        assert_allclose(components.innovations, joint.innovations, rtol=1e-8, atol=1e-11)

    @given(SEEDS, UPDATES)
    @settings(max_examples=15)
    def test_stations_at_one_epoch_commute(self, seed, update):
        problem, tracking = observed(seed)
        rng = np.random.default_rng(seed)
        order = np.concatenate(
            [rng.permutation(np.arange(a, b)) for a, b in zip(tracking.first_row, tracking.first_row[1:], strict=False)]
        )
        permuted = pz.Tracking(tracking.row_times[order], tracking.values[order], tracking.row_stations[order])
        ekf = pz.ExtendedKalmanFilter(update)
        one, other = ekf.estimate(problem, tracking), ekf.estimate(problem, permuted)
        assert_same_estimate(other, one, 1e-9)
        assert_allclose(other.innovations, one.innovations[order], rtol=1e-8, atol=1e-11)
        assert_allclose(other.innovation_covariances, one.innovation_covariances[order], rtol=1e-8, atol=1e-13)

    @given(SEEDS)
    @settings(max_examples=10)
    def test_order_of_the_stations_in_the_problem_does_not_matter(self, seed):
        problem, tracking = observed(seed)
        turned = network(np.random.default_rng(0), stations=problem.stations[::-1])
        ekf = pz.ExtendedKalmanFilter()
        assert_same_estimate(ekf.estimate(turned, tracking), ekf.estimate(problem, tracking), 1e-9)

    @given(SEEDS)
    @settings(max_examples=10)
    def test_rows_that_say_nothing_change_nothing(self, seed):
        """A row of missing values at an existing epoch, and columns beyond the widest sensor."""
        problem, tracking = observed(seed)
        padded = np.column_stack([tracking.values, np.full((len(tracking.values), 2), np.nan)])
        nothing = np.full((1, padded.shape[1]), np.nan)
        at = int(tracking.first_row[2])
        more = pz.Tracking(
            np.insert(tracking.row_times, at, tracking.row_times[at]),
            np.concatenate([padded[:at], nothing, padded[at:]]),
            np.insert(tracking.row_stations, at, "south"),
        )
        ekf = pz.ExtendedKalmanFilter("joint")
        assert_same_estimate(ekf.estimate(problem, more), ekf.estimate(problem, tracking), 1e-12)

    def test_prior_before_the_first_epoch_is_carried_there(self):
        problem, tracking = observed(3)
        first = float(tracking.times[0])
        early = network(np.random.default_rng(3), prior_time=first - 0.5)
        prediction = pz.predict(early, early.prior, first - 0.5, 0.5)
        carried = network(np.random.default_rng(3), prior=prediction)
        assert_array_equal(carried.stations[0].noise, problem.stations[0].noise)
        ekf = pz.ExtendedKalmanFilter()
        assert_same_estimate(ekf.estimate(early, tracking), ekf.estimate(carried, tracking), 1e-12)


def rotation(angle):
    c, s = np.cos(angle), np.sin(angle)
    return np.kron(np.eye(2), [[c, -s], [s, c]])


@pytest.mark.parametrize("angle", [0.9, 2.0, np.pi / 2, np.pi, -1.3])
def test_rotating_the_world_rotates_the_estimate(angle):
    """Wherever the orbit lies, and so wherever it crosses the branch cut of the bearing."""
    problem = satellite()
    tracking = pz.simulate(problem, np.arange(1000) * 15.0, np.random.default_rng(2))
    G = rotation(angle)
    turned = satellite(prior=pz.Gaussian(G @ problem.mean, G @ problem.covariance @ G.T))
    z = np.angle(np.exp(1j * (tracking.values + angle)))
    ekf = pz.ExtendedKalmanFilter()
    a, b = ekf.estimate(problem, tracking), ekf.estimate(turned, pz.Tracking(tracking.times, z))
    jumps = np.abs(np.diff(z[:, 0])) > np.pi
    assert jumps.any() or np.abs(np.diff(tracking.values[:, 0])).max() > np.pi
    assert_allclose((b.mean - a.mean @ G.T) / sigma(b), 0, atol=1e-6)
    assert np.abs(a.innovations).max() < np.pi / 2
    assert_allclose(b.innovations, a.innovations, rtol=0, atol=1e-9)


def test_whole_turns_of_a_bearing_change_nothing():
    problem = satellite()
    tracking = pz.simulate(problem, np.arange(200) * 15.0, np.random.default_rng(1))
    turns = np.random.default_rng(0).integers(-2, 3, (200, 1))
    turned = pz.Tracking(tracking.times, tracking.values + TURN * turns)
    ekf = pz.ExtendedKalmanFilter()
    assert_same_estimate(ekf.estimate(problem, turned), ekf.estimate(problem, tracking), 1e-8)


SAME_BYTES = """
import hashlib, sys
import numpy as np, piazzi as pz
from tests.laws.problems import satellite
problem = satellite()
tracking = pz.simulate(problem, np.arange(50) * 15.0, np.random.default_rng(7))
estimate = pz.ExtendedKalmanFilter().estimate(problem, tracking)
digest = hashlib.sha256()
for a in (tracking.values, tracking.truth, estimate.mean, estimate.covariance, estimate.innovations):
    digest.update(a.tobytes())
print(digest.hexdigest())
"""


def test_same_seed_same_bytes():
    """In one process and in another; a different seed gives different ones."""
    printed = {
        subprocess.run([sys.executable, "-c", SAME_BYTES], check=True, capture_output=True, text=True, cwd=ROOT).stdout
        for _ in range(2)
    }
    assert len(printed) == 1
    problem = satellite()
    a, b, c = (pz.simulate(problem, np.arange(50) * 15.0, np.random.default_rng(seed)) for seed in (7, 7, 8))
    assert a.values.tobytes() == b.values.tobytes()
    assert a.truth.tobytes() == b.truth.tobytes()
    assert a.values.tobytes() != c.values.tobytes()
    ekf = pz.ExtendedKalmanFilter()
    one, other = ekf.estimate(problem, a), ekf.estimate(problem, b)
    for name in ("mean", "covariance", "innovations", "innovation_covariances"):
        assert getattr(one, name).tobytes() == getattr(other, name).tobytes()
