"""What kernels are given is laid out once for a problem and its tracking."""

import pickle
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_array_equal

import piazzi as pz
from piazzi.problem.inputs import prepare, with_prior_node
from tests.laws.problems import b612, satellite


def test_estimators_of_one_problem_share_what_was_laid_out():
    problem, tracking = pz.load("b612-range")
    assert prepare(problem, tracking) is prepare(problem, tracking)
    other = replace(problem, prior_time=-1.0)
    inputs = prepare(other, tracking)
    assert (inputs.t_prior, prepare(problem, tracking).t_prior) == (-1.0, 0.0)
    assert len(with_prior_node(inputs).t) == 101
    assert with_prior_node(prepare(problem, tracking)) is prepare(problem, tracking)


def test_a_tracking_of_two_problems_is_laid_out_for_each():
    """Estimates do not depend on which problem came before."""
    problem, tracking = pz.load("b612-range")
    heavier = replace(problem, parameters={**problem.parameters, "mu": 1100.0})
    alone = pz.ExtendedKalmanFilter().estimate(heavier, replace(tracking)).mean
    pz.ExtendedKalmanFilter().estimate(problem, tracking)
    assert_array_equal(pz.ExtendedKalmanFilter().estimate(heavier, tracking).mean, alone)


def test_addresses_stay_in_their_process():
    problem, tracking = pz.load("b612-range")
    inputs = prepare(problem, tracking)
    inputs.run_of(problem)
    for thing in (tracking, inputs, problem):
        assert {"_prepared", "_run", "specs"}.isdisjoint(vars(pickle.loads(pickle.dumps(thing))))
    again = pickle.loads(pickle.dumps((problem, tracking)))
    estimator = pz.ExtendedKalmanFilter()
    assert_array_equal(estimator.estimate(*again).mean, estimator.estimate(problem, tracking).mean)


def test_a_problem_that_does_not_fit_leaves_what_was_laid_out():
    problem, tracking = pz.load("b612-range")
    inputs = prepare(problem, tracking)
    with pytest.raises(ValueError, match="the prior is at 5 s, after the first measurement at 0 s"):
        prepare(replace(problem, prior_time=5.0), tracking)
    assert prepare(problem, tracking) is inputs


def test_rows_of_an_epoch():
    problem = satellite(pz.Taylor(max_step=1.0))
    tracking = pz.Tracking(np.array([0.0, 15.0, 15.0, 15.0, 30.0]), np.zeros((5, 1)))
    assert prepare(problem, tracking).most_rows == 3
    assert prepare(b612(), pz.simulate(b612(), np.arange(3.0), np.random.default_rng(0))).most_rows == 1
