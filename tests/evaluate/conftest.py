"""Estimates made by hand: metrics are tested against what was put in, not against an estimator."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from piazzi.estimate import Estimate
from piazzi.model import Model, Sensor
from piazzi.problem import Gaussian, Problem, Station, Tracking

MakeEstimate = Callable[..., Estimate]


def made(
    mean: Any, covariance: Any, truth: Any = None, nu: Any = None, S: Any = None, *, groups: Any = None, **more: Any
) -> Estimate:
    """An estimate of n states a, b, c ... that is exactly this; innovations default to noise of unit variance."""
    mean = np.array(mean, dtype=float)
    K, n = mean.shape
    states = list("abcdefghi"[:n])
    model = Model(states, ["0"] * n, [Sensor("s", ["a"])], groups=groups or {}, units=dict.fromkeys(states, "m"))
    problem = Problem(model, Gaussian(np.zeros(n), np.eye(n)), stations=[Station("station", "s", 1.0)])
    nu = np.random.default_rng(1).standard_normal((K, 1)) if nu is None else np.array(nu, dtype=float)
    S = np.ones((K, 1, 1)) if S is None else np.array(S, dtype=float)
    values = np.where(np.isnan(nu).all(axis=1, keepdims=True), np.nan, 1.0)
    tracking = Tracking(np.arange(K, dtype=float), values, truth=truth)
    covariance = np.broadcast_to(np.array(covariance, dtype=float), (K, n, n)).copy()
    return Estimate(problem, tracking, mean, covariance, nu, S, K, 0.25, **more)


@pytest.fixture
def uncompiled(monkeypatch: pytest.MonkeyPatch) -> None:
    """The same source without compiling it, for models that only one test has."""
    monkeypatch.setenv("PIAZZI_JIT", "0")


@pytest.fixture
def make_estimate() -> MakeEstimate:
    return made
