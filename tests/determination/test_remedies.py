"""What the verdict names to explain residuals: of errors that are put there, the option that stands for them."""

import re
from dataclasses import replace

import numpy as np
import pytest

import piazzi as pz
from piazzi.determination.analysis import analysed
from piazzi.determination.passes import pass_of_rows
from piazzi.determination.remedies import remedy
from piazzi.determination.setup import follow
from piazzi.evaluate.information import predicted
from piazzi.orbit import state_axes
from piazzi.problem.inputs import prepare
from tests.determination.lasers import SIGMA, twelve_passes

EVERY = 600.0  # s, between pushes of the truth


@pytest.fixture(scope="module")
def given():
    """Twelve passes over four stations without noise, those of `test_editing`."""
    return twelve_passes()


def named(given, states, off, seed):
    """The words for measurements of states (K, n), with normal noise and what else is off (J, 1)."""
    z = predicted(given.problem, prepare(given.problem, given.tracking), states)
    z = z + SIGMA * np.random.default_rng(seed).standard_normal(z.shape) + off
    tracking = given.tracking
    made = replace(given, tracking=pz.Tracking(tracking.row_times, z, tracking.row_stations, epoch=tracking.epoch))
    return remedy(made, given.states, analysed(made, given.states), np.ones(len(z), dtype=bool))


def pushed(given, pull):
    """States (K, n) of an orbit that is pushed along R, T and N by pull(k) times the interval, in its middle."""
    times, x = given.tracking.times, given.states[0].copy()
    out = [x]
    for k in range(int((times[-1] - times[0]) // EVERY) + 1):
        begin, end = times[0] + k * EVERY, min(times[0] + (k + 1) * EVERY, times[-1])
        middle = 0.5 * (begin + end)
        for a, b in ((begin, middle), (middle, end)):
            nodes = np.unique(np.concatenate([[a], times[(times > a) & (times <= b)], [b]]))
            states = follow(given.problem, nodes, x, given.chosen.max_step)[0]
            out += list(states[1:][np.isin(nodes[1:], times)])
            x = states[-1].copy()
            if b == middle:
                x[3:6] += state_axes(x[:3], x[3:6])[:3, :3].T @ pull(k) * (end - begin)
        if end == times[-1]:
            break
    return np.array(out)


def test_of_white_residuals_nothing_is_named(given):
    assert sum(named(given, given.states, 0.0, seed) != "" for seed in range(12)) <= 1


def test_a_steady_acceleration_is_named_and_no_process(given):
    states = pushed(given, lambda k: np.array([0.0, 1e-9, 1e-9]))
    for seed in range(3):
        assert named(given, states, 0.0, seed).startswith("--estimate 'radial along cross'")


def test_accelerations_that_wander_are_named_with_their_size(given):
    """A first-order process of 3e-8 m/s2 over half a turn, 1.8 h: the size that is named is right within a factor of two."""
    for seed in range(3):
        rng, size, left = np.random.default_rng(seed), 3e-8, np.exp(-EVERY / 6500.0)
        pulls = [size * rng.standard_normal(3)]
        for _ in range(200):
            pulls.append(left * pulls[-1] + size * np.sqrt(1.0 - left**2) * rng.standard_normal(3))
        words = named(given, pushed(given, lambda k, pulls=pulls: pulls[k]), 0.0, seed)
        found = re.search(r"radial~(\S+)=(\S+)m/s\^2 along~\1=\2m/s\^2 cross~\1=\2m/s\^2'$", words)
        assert found is not None, words
        assert 0.5 * size < float(found[2]) < 2.0 * size


def test_biases_of_passes_are_named_with_their_size(given):
    """Of four sigma from pass to pass."""
    passes = pass_of_rows(given.measured, given.tracking, given.rows)
    for seed in range(3):
        bias = 4.0 * SIGMA * np.random.default_rng(100 + seed).standard_normal(passes.max() + 1)
        found = re.fullmatch(r".*--estimate bias\.range/pass=(\S+)m", named(given, given.states, bias[passes][:, None], seed))
        assert found is not None and 0.5 * 4.0 * SIGMA < float(found[1]) < 2.0 * 4.0 * SIGMA


def test_more_noise_is_named_as_such(given):
    noise = 2.0 * SIGMA * np.random.default_rng(7).standard_normal((len(given.tracking.row_times), 1))
    words = named(given, given.states, noise, 8)
    found = re.fullmatch(r"--sigma (\S+) times as large", words)
    assert found is not None, words
    assert 1.9 < float(found[1]) < 2.6  # the root of 1 + 4
