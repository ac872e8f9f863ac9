"""A few random problems, the same every time; `python tests/fuzz/problems.py --problems 100000` tries many."""

import numpy as np
import pytest

from tests.fuzz import problems


@pytest.mark.slow
def test_no_random_problem_ends_in_a_success_that_is_none():
    tally = problems.Tally()
    problems.search(1, 0, 300, tally)
    assert not tally.found, "\n".join(f"{what}\n{how}" for what, how in tally.first.items())
    assert sum(tally.successes.values()) > 150 and sum(tally.right.values()) > 50


def test_what_is_no_success_is_found():
    """The oracle itself: a negative variance, what is not finite, correlations above one."""
    mean, good = np.zeros((1, 2)), np.array([[[1.0, 0.5], [0.5, 1.0]]])
    assert problems.unsound(mean, good, True, "") == ""
    assert problems.unsound(mean, -good, True, "") == "success with a negative variance"
    assert problems.unsound(mean, good * np.nan, True, "") == "success with what is not finite"
    assert problems.unsound(mean, 1.1 - 0.1 * np.eye(2)[None], True, "") == "success with an eigenvalue below -1e-1"
    assert problems.unsound(mean, -good, False, "the covariance is not semidefinite") == ""
    assert problems.unsound(mean, -good, False, "") == "the message is no line"
