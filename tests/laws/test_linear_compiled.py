"""Linear problems with more epochs than the machine has lanes, compiled: a transition matrix that depends on no state."""

import pytest

import piazzi as pz
from tests.laws.graphs import LinearCase
from tests.laws.problems import assert_same_estimate
from tests.references import dense


@pytest.mark.parametrize("rank", [None, 1, 0])
def test_the_graph_over_many_epochs_is_dense_least_squares(rank):
    case = LinearCase(3, (2, 1), seed=5, rank=rank, epochs=40)
    estimate = pz.FactorGraph().estimate(case.problem, case.tracking)
    assert estimate.success, estimate.message
    assert_same_estimate(estimate, dense.smooth(*case.chain), 1e-9)
