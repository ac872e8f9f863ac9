"""Random numbers: the run's own, whatever else is drawn; truths that count; and the laws of what is drawn."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import piazzi as pz
from piazzi.simulation import Rule, true_problem
from piazzi.study.runs import MEASUREMENT, PRIOR, PROCESS, child, draw, first_states
from tests.laws.problems import b612, satellite
from tests.study.studies import drawn_truth


def test_children_are_numpys_own_and_all_different():
    for run in (0, 1, 10**6):
        for purpose in (PRIOR, PROCESS, MEASUREMENT):
            expected = np.random.default_rng(np.random.SeedSequence(5, spawn_key=(run, purpose))).standard_normal(3)
            assert_array_equal(child(5, run, purpose).standard_normal(3), expected)
    first = {child(seed, run, p).standard_normal() for seed in (0, 1) for run in range(50) for p in range(3)}
    assert len(first) == 300


def test_a_run_is_the_same_in_any_company():
    problem = drawn_truth()
    actual = true_problem(problem)
    whole = draw(problem, actual, range(40), 3, 7)
    for part in (range(1), range(17, 18), range(13, 40)):
        found = draw(problem, actual, part, 3, 7)
        for name in ("first", "w", "v", "refused"):
            assert_array_equal(getattr(found, name), getattr(whole, name)[part.start : part.stop], err_msg=name)


def test_more_epochs_leave_the_first_draws_alone():
    problem = b612(truth=None)
    short, long = (draw(problem, problem, range(5), 0, epochs) for epochs in (4, 9))
    assert_array_equal(short.first, long.first)
    assert_array_equal(short.w, long.w[:, :4])
    assert_array_equal(short.v, long.v[:, :4])


def test_first_states_have_the_priors_mean_and_covariance():
    """Within five standard errors of 20 000 draws, with correlations."""
    P = np.array([[4.0, 1, 0, 0], [1, 2, 0, 0.5], [0, 0, 1, 0], [0, 0.5, 0, 3]])
    problem = b612(truth=None, prior=pz.Gaussian([12.0, 0, 0, 9], P))
    x, refused = first_states(problem, problem, range(20_000), 0)
    assert not refused.any()
    assert_allclose((x.mean(axis=0) - problem.mean) / np.sqrt(np.diag(P) / len(x)), 0.0, atol=5)
    error = np.cov(x.T) - P
    assert_allclose(error / np.sqrt((np.outer(np.diag(P), np.diag(P)) + P**2) / len(x)), 0.0, atol=5)


def test_only_truths_that_count_are_kept_and_they_are_the_first_accepted():
    problem = drawn_truth()
    x, refused = first_states(problem, problem, range(300), 0)
    free, _ = first_states(b612(truth=None), problem, range(300), 0)
    good = (np.hypot(x[:, 0], x[:, 1]) > 11.5) & (x[:, 3] > 0)
    assert good.all()
    assert not refused.any()
    kept = (np.hypot(free[:, 0], free[:, 1]) > 11.5) & (free[:, 3] > 0)
    assert 0 < kept.sum() < 300
    assert_array_equal(x[kept], free[kept])


def test_a_rule_that_accepts_nothing_refuses_the_run():
    problem = b612(truth=pz.Truth(accept=["-1 - x**2"]))
    _, refused = first_states(problem, problem, range(2), 0)
    assert refused.all()
    with pytest.raises(ValueError, match=r"none of 1000 truths drawn for a run is accepted: -1 - x\*\*2 > 0"):
        pz.simulate(problem, [0.0, 0.1], np.random.default_rng(0))


def test_simulate_obeys_the_rule_and_draws_as_before_without_one():
    times = np.arange(3) * 0.1
    for seed in range(20):
        found = pz.simulate(drawn_truth(), times, np.random.default_rng(seed)).truth[0]
        assert np.hypot(found[0], found[1]) > 11.5
        free = pz.simulate(b612(truth=None), times, np.random.default_rng(seed)).truth[0]
        if np.hypot(free[0], free[1]) > 11.5 and free[3] > 0:
            assert_array_equal(found, free)


def test_rule_knows_every_function_of_the_language():
    values = {"x": 1.3, "y": -0.4, "vx": 2.0, "vy": 0.3}
    problem = satellite()
    for text, expected in {
        "atan2(y, x) + min(x, y, vx) + max(vy, y)": np.arctan2(-0.4, 1.3) - 0.4 + 0.3,
        "sqrt(vx)*exp(-x)/log(vx) - abs(y)**3": np.sqrt(2) * np.exp(-1.3) / np.log(2) - 0.4**3,
        "sin(x) + cos(y) - tan(vy) + hypot(x, y) - pi": np.sin(1.3) + np.cos(0.4) - np.tan(0.3) + np.hypot(1.3, 0.4) - np.pi,
        "sign(y) + asin(vy) + acos(vy) + atan(x) + sinh(y) + cosh(y) + tanh(y)": -1
        + np.pi / 2 + np.arctan(1.3) - np.sinh(0.4) + np.cosh(0.4) - np.tanh(0.4),
        "mu - 3.986e14 + 0.25": 0.25,
    }.items():  # fmt: skip
        x = np.array([list(values.values())])
        assert Rule([f"({text}) - ({float(expected) - 1e-9!r})"], problem).accepts(x).all(), text
        assert not Rule([f"({text}) - ({float(expected) + 1e-9!r})"], problem).accepts(x).any(), text
    assert not Rule(["sqrt(y)"], problem).accepts(x).any()


def test_perigee_rule_of_the_founding_study_is_kepler():
    """The rule's perigee against that of the orbit's elements, from vis-viva and the eccentricity vector."""
    from piazzi.study import Study

    study = Study.of("founding-study")
    mu = 3.986e14
    free = satellite()
    x, _ = first_states(free, free, range(4000), 1)
    r, v = x[:, :2], x[:, 2:]
    radius, speed2 = np.hypot(*r.T), (v**2).sum(axis=1)
    a = 1 / (2 / radius - speed2 / mu)
    e = np.hypot(*(((speed2 - mu / radius)[:, None] * r - (r * v).sum(axis=1)[:, None] * v) / mu).T)
    expected = (e < 1) & (a * (1 - e) > 6.6e6)
    assert 0.5 < expected.mean() < 0.99
    assert_array_equal(Rule(study.problem.truth.accept, free).accepts(x), expected)
