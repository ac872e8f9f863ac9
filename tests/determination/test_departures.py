"""A prior that the measurements contradict is found, and one that holds is not, over many draws of a linear problem."""

from types import SimpleNamespace

import numpy as np
import pytest

from piazzi.determination.departures import SURE, departures
from piazzi.determination.honesty import believable
from piazzi.determination.sentence import Sentence
from piazzi.determination.unknowns import Label

BIASES, ROWS, SPREAD, NOISE = 9, 60, 0.022, 0.03
NAMES = ("x", "y", "z", "vx", "vy", "vz", *(f"range_bias_{k}" for k in range(1, BIASES + 1)))
LABELS = {f"range_bias_{k}": Label(f"bias.range.S{k}", f"bias of range of S{k}") for k in range(1, BIASES + 1)}
GOOD = Sentence(True, 1.0, "residuals", "Honest: residuals are as large as their sigmas say.")


@pytest.fixture(scope="module")
def problem():
    """Six wide values and the biases of nine passes, the last of which nothing was measured of: prior, rows, posterior."""
    rng = np.random.default_rng(1)
    H = np.hstack([rng.standard_normal((ROWS, 6)), np.eye(BIASES)[np.arange(ROWS) % (BIASES - 1)]])
    P0 = np.diag([1e6] * 6 + [SPREAD**2] * BIASES)
    S = H @ P0 @ H.T + NOISE**2 * np.eye(ROWS)
    K = np.linalg.solve(S, H @ P0).T
    P = P0 - K @ S @ K.T
    return H, P0, K, 0.5 * (P + P.T)


def given(P0, considered=()):
    model = SimpleNamespace(names=NAMES)
    own = SimpleNamespace(model=model, covariance=P0, mean=np.zeros(len(NAMES)), considered=considered)
    return SimpleNamespace(problem=own, solution=0, labels=LABELS, chosen=SimpleNamespace(extra=SimpleNamespace(processes=())))


def answer(problem, rng, times=1.0, extra=None):
    """The estimate of a truth whose biases are `times` as large as the prior says."""
    H, _, K, P = problem
    truth = np.concatenate([rng.standard_normal(6), times * SPREAD * rng.standard_normal(BIASES)])
    if extra is not None:
        truth[6:] += extra
    mean = K @ (H @ truth + NOISE * rng.standard_normal(ROWS))
    return SimpleNamespace(success=True, view="delayed", mean=mean[None], covariance=P[None])


def test_false_alarms_are_as_rare_as_said(problem):
    """Of 3000 draws from the prior, three are expected beyond; with each value's square near one."""
    rng, runs = np.random.default_rng(2), 3000
    told = [departures(given(problem[1]), answer(problem, rng)) for _ in range(runs)]
    assert sum(one.contradict for one in told) <= 3 * runs * (1.0 - SURE)
    sigmas = np.array([one.sigmas for one in told])
    assert np.isnan(sigmas[:, -1]).all()  # nothing was measured in its pass
    assert np.mean(sigmas[:, :-1] ** 2) == pytest.approx(1.0, abs=0.05)
    assert {one.freedom for one in told} == {BIASES - 1}
    assert np.mean([one.squares for one in told]) == pytest.approx(BIASES - 1, rel=0.05)


def test_one_wrong_bias_is_named_and_many_larger_ones_are_told_together(problem):
    rng = np.random.default_rng(3)
    wrong = np.zeros(BIASES)
    wrong[4] = 8.0 * SPREAD
    said = believable(given(problem[1]), answer(problem, rng, extra=wrong), GOOD)
    assert said.ok is False and said.figure > 1.0 and said.sentence.startswith("Not honest: values contradict")
    assert "bias of range of S5 by " in said.sentence and "S4" not in said.sentence
    larger = [departures(given(problem[1]), answer(problem, rng, times=3.0)) for _ in range(100)]
    assert np.mean([one.contradict for one in larger]) > 0.9
    assert np.sqrt(np.mean([one.size**2 for one in larger])) == pytest.approx(np.sqrt(1.0 + 8.0 * spread_of(problem)), rel=0.15)


def spread_of(problem):
    """Mean share of P0 - P that biases beyond their prior come through, of what is measured."""
    H, P0, K, P = problem
    own = slice(6, 6 + BIASES - 1)
    A = (K @ H)[own, own] * SPREAD
    return np.trace(np.linalg.solve((P0 - P)[own, own], A @ A.T)) / (BIASES - 1)


def test_what_is_considered_makes_the_test_cautious_and_what_is_wrong_already_stays_wrong(problem):
    rng, runs = np.random.default_rng(4), 300
    squares = [departures(given(problem[1], ("cr",)), answer(problem, rng)).squares for _ in range(runs)]
    assert np.mean(squares) < BIASES
    bad = Sentence(False, 3.0, "residuals", "Not honest: residuals.")
    kept = believable(given(problem[1]), answer(problem, rng), bad)
    assert (kept.ok, kept.figure, kept.sentence) == (False, 3.0, bad.sentence) and "before" in kept.test
    failed = SimpleNamespace(**{**vars(answer(problem, rng)), "success": False})
    assert believable(given(problem[1]), failed, GOOD) is GOOD


def test_products_of_a_contradicted_prior_are_never_taken_as_honest(problem):
    """One value far off among many honest ones is a factor above one, too."""
    extra = np.zeros(BIASES)
    extra[2] = 6.0 * SPREAD
    found = departures(given(problem[1]), answer(problem, np.random.default_rng(4), extra=extra))
    assert found.contradict and found.excess > 1.0
