"""What kernels are given is laid out once for a problem and its tracking."""

import copy
import pickle
from dataclasses import is_dataclass, replace

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
    inputs.bundles(problem)
    for thing in (tracking, inputs, problem):
        assert {"_prepared", "_bundles", "specs"}.isdisjoint(vars(pickle.loads(pickle.dumps(thing))))
    again = pickle.loads(pickle.dumps((problem, tracking)))
    estimator = pz.ExtendedKalmanFilter()
    assert_array_equal(estimator.estimate(*again).mean, estimator.estimate(problem, tracking).mean)


def pickled(thing):
    return pickle.loads(pickle.dumps(thing))


def arrays(value, name=""):
    """Every array in a value, by the way to it."""
    if isinstance(value, np.ndarray):
        return {name: value}
    parts = vars(value) if is_dataclass(value) else value if isinstance(value, dict) else {}
    parts = dict(enumerate(value)) if isinstance(value, (list, tuple)) else parts
    return {way: a for key, part in parts.items() for way, a in arrays(part, f"{name}.{key}").items()}


@pytest.mark.parametrize("copied", [copy.copy, copy.deepcopy, pickled, replace])
def test_nothing_can_be_written_into_a_copy_and_it_remembers_nothing(copied):
    """Else what was laid out for kernels would no longer be what the copy says."""
    problem, tracking = eventful()
    fresh = arrays(problem), arrays(tracking)
    prepare(problem, tracking)
    for thing, own in zip((problem, tracking), fresh, strict=True):
        again = copied(thing)
        assert "_prepared" not in vars(again)
        assert arrays(again).keys() == own.keys() > set()
        assert [way for way, a in arrays(again).items() if a.flags.writeable] == []
    assert prepare(copied(problem), copied(tracking)) is not prepare(problem, tracking)


def eventful():
    """A problem with arrays in every part, and its tracking."""
    prior = pz.Gaussian([11.0, 0.0, 0.0, 10.0], np.eye(4))
    burn = pz.Manoeuvre(1.5, [0.1, 0.0], [1e-4, 1e-4])
    base = b612()
    station = replace(base.stations[0], numbers={"mx": 10.0, "my": pz.Gaussian(0.0, 1e-4)})
    problem = replace(base, prior=prior, stations=[station], manoeuvres=[burn])
    names = np.full(4, station.name)
    return problem, pz.Tracking(np.arange(4.0), np.ones(4), names, np.ones((4, 4)))


def test_the_truth_of_a_copied_problem_stays_the_users_own():
    state = np.array([11.0, 0.0, 0.0, 10.0])
    problem = replace(b612(), truth=pz.Truth(state))
    copy.copy(problem)
    state[0] = 12.0
    assert problem.truth.state is state


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
