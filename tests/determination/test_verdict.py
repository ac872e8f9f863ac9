"""What the verdict compares."""

from types import SimpleNamespace

import numpy as np
import pytest

from piazzi.determination.verdict import apart_by


def estimate(view, means, sigmas):
    """Means (K,) of six states alike, with a sigma (K,) each."""
    mean = np.outer(means, np.ones(6))
    covariance = np.array([sigma**2 * np.eye(6) for sigma in sigmas])
    return SimpleNamespace(view=view, mean=mean, covariance=covariance, times=np.arange(float(len(means))))


def test_estimators_of_all_measurements_are_compared_where_the_answer_stands_and_those_in_real_time_at_the_end():
    """At the middle a filter has seen half of the measurements: that it says something else there is no disagreement."""
    answer = estimate("delayed", [1.0, 1.0, 1.0], [0.1, 0.1, 0.1])
    assert apart_by(answer, estimate("delayed", [9.0, 1.2, 9.0], [1.0, 1.0, 1.0]), 1) == pytest.approx(2.0)
    assert apart_by(answer, estimate("filtered", [9.0, 9.0, 1.5], [0.1, 0.1, 0.25]), 1) == pytest.approx(2.0)
