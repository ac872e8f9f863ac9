"""Estimators by name: what the command line writes is what the class is given."""

import pytest

import piazzi as pz
from piazzi.estimate.estimator import views_of
from piazzi.estimate.registry import ESTIMATORS, parse


@pytest.mark.parametrize(
    ("text", "estimator"),
    [
        ("ekf", pz.ExtendedKalmanFilter()),
        ("ekf:joint", pz.ExtendedKalmanFilter("joint")),
        ("ekf:components", pz.ExtendedKalmanFilter("components")),
        ("ekf:gate", pz.ExtendedKalmanFilter(gate=0.999)),
        ("ekf:joint:gate=0.99", pz.ExtendedKalmanFilter("joint", gate=0.99)),
        ("iekf", pz.ExtendedKalmanFilter(iterations=5)),
        ("iekf:3", pz.ExtendedKalmanFilter(iterations=3)),
        ("iekf:3:components:gate=0.9", pz.ExtendedKalmanFilter("components", 3, 0.9)),
        ("graph", pz.FactorGraph()),
        ("graph:prior", pz.FactorGraph(start="prior")),
        ("smoother", pz.Smoother()),
        ("smoother:3", pz.Smoother(iterations=3)),
        ("ukf", pz.UnscentedKalmanFilter()),
        ("ukf:gate=0.99", pz.UnscentedKalmanFilter(gate=0.99)),
        ("srekf", pz.SquareRootKalmanFilter()),
        ("srekf:gate", pz.SquareRootKalmanFilter(gate=0.999)),
        ("graph:huber", pz.FactorGraph(loss=pz.Huber(1.345))),
        ("graph:ekf:cauchy", pz.FactorGraph(start="ekf", loss=pz.Cauchy(2.385))),
        ("graph:tukey=6:window", pz.FactorGraph(start="window", loss=pz.Tukey(6.0))),
        ("graph:bank", pz.FactorGraph(start="bank")),
        ("graph:orbits:huber", pz.FactorGraph(start="orbits", loss=pz.Huber(1.345))),
        ("graph:bank=64:huber", pz.FactorGraph(start=pz.Bank(64), loss=pz.Huber())),
        ("window:100:tukey", pz.SlidingWindow(loss=pz.Tukey(4.685))),
        ("window:20x2:huber=2", pz.SlidingWindow(20, 2, loss=pz.Huber(2.0))),
        ("window:cauchy", pz.SlidingWindow(loss=pz.Cauchy())),
        ("window", pz.SlidingWindow()),
        ("window:7", pz.SlidingWindow(lag=7)),
        (" window:100x3 ", pz.SlidingWindow(lag=100, iterations=3)),
        ("window:60s", pz.SlidingWindow(lag_seconds=60.0)),
        ("window:0.5sx2", pz.SlidingWindow(lag_seconds=0.5, iterations=2)),
    ],
)
def test_names_mean_estimators(text, estimator):
    found = parse(text)
    assert type(found) is type(estimator)
    assert vars(found) == vars(estimator)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("ekff", "unknown estimator 'ekff'; did you mean 'ekf'?"),
        ("windw:100", "did you mean 'window'?"),
        ("xyz", "known: ekf, "),
        ("", "unknown estimator ''"),
        ("ekf:both", "estimator 'ekf:both': update is 'both'; it must be one of"),
        ("ekf:gate=wide", "gate is 'wide'; it must be a probability"),
        ("ekf:gate=2", "gate is 2.0; it must be a probability"),
        ("iekf:0", "iterations is 0"),
        ("smoother:fast", "estimator 'smoother:fast': its only option is a number of passes, such as smoother:3"),
        ("smoother:0", "iterations is 0"),
        ("ukf:joint", "estimator 'ukf:joint': its only option is gate or gate=P"),
        ("graph:nowhere", "estimator 'graph:nowhere': start is 'nowhere'"),
        ("graph:huber:tukey", "'tukey' is one too many"),
        ("graph:ekf:prior", "'prior' is one too many"),
        ("graph:huber=-1", "its constant must be a positive number"),
        ("graph:bank=many", "bank is 'many'"),
        ("graph:bank=0", "members is 0"),
        ("window:100:hubert", "'hubert' is no loss"),
        ("window:100:huber=x", "its constant must be"),
        ("window:0", "estimator 'window:0': lag"),
        ("window:x3", "write window:LAG or window:LAGxITERATIONS"),
        ("window:-5", "write window:LAG"),
        ("window:1.5", "write window:LAG"),
        ("window:60m", "write a length of time such as"),
        ("window:1e3s", "write window:LAG"),
        ("window:60sx0", "iterations is 0"),
        ("window:9999999999999", "write window:LAG"),
        ("window:\u0663", "write window:LAG"),  # a digit, but not one of ours
    ],
)
def test_what_means_nothing_is_refused_with_a_hint(text, message):
    with pytest.raises(ValueError) as caught:
        parse(text)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


DELAYED = dict.fromkeys(("smoother", "batch", "graph"), "delayed")


def test_every_name_can_be_built_and_knows_its_views():
    for name in ESTIMATORS:
        estimator = parse(name)
        assert callable(estimator.estimate)
        assert views_of(estimator) == {"window": ("realtime", "delayed")}.get(name, (DELAYED.get(name, "realtime"),))


def test_an_estimator_of_somebody_else_is_taken_to_run_in_real_time_unless_it_says_otherwise():
    assert views_of(object()) == ("realtime",)

    class Delayed:
        views = ("delayed",)

    class Shorter(pz.SlidingWindow):
        pass

    assert views_of(Delayed()) == ("delayed",)
    assert views_of(Shorter()) == ("realtime", "delayed")
