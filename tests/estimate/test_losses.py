"""Losses: their weights are the derivatives of their costs, and their constants keep what they promise."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

import piazzi as pz
from piazzi.estimate.losses import LOSSES, loss_of

ALL = [pz.Huber(), pz.Cauchy(), pz.Tukey(), pz.Huber(0.7), pz.Cauchy(5.0), pz.Tukey(2.5)]


@pytest.mark.parametrize("loss", ALL, ids=str)
def test_the_weight_is_the_derivative_of_the_cost(loss):
    square = np.float64(loss.k**2)
    s = np.linspace(1e-3, 4 * loss.k**2, 997)
    s = s[np.abs(s - square) > 1e-2]  # Huber's second derivative jumps there
    h = 1e-5
    difference = (loss.cost(s + h, square) - loss.cost(s - h, square)) / (2 * h)
    assert_allclose(loss.weight(s, square), difference, atol=1e-8)


@pytest.mark.parametrize("loss", ALL, ids=str)
def test_small_residuals_count_in_full_and_none_counts_more(loss):
    square = np.float64(loss.k**2)
    s = np.geomspace(1e-12, 1e12, 400)
    weight, cost = loss.weight(s, square), loss.cost(s, square)
    assert loss.weight(np.zeros(1), square) == 1.0
    assert loss.cost(np.zeros(1), square) == 0.0
    assert (np.diff(weight) <= 0).all()
    assert (weight >= 0).all()
    assert (cost <= s * (1 + 1e-12)).all()


@pytest.mark.parametrize("name", LOSSES)
def test_the_default_constant_keeps_95_percent_efficiency(name):
    """(E psi')^2 / E psi^2 over unit Gaussian residuals r, with psi = w r: the asymptotic efficiency of the mean."""
    loss = LOSSES[name]()
    r, step = np.linspace(-12, 12, 480_001, retstep=True)
    density = np.exp(-0.5 * r**2) / np.sqrt(2 * np.pi)
    psi = loss.weight(r**2, np.float64(loss.k**2)) * r
    slope = np.gradient(psi, step)
    efficiency = (slope * density).sum() ** 2 * step / (psi**2 * density).sum()
    assert efficiency == pytest.approx(0.95, abs=5e-4)


def test_rows_of_several_components_get_the_constant_that_as_many_good_ones_exceed():
    """For two components chi-square is exponential, for three Maxwell's distribution: both in closed form."""
    k = 1.345
    from math import erf, exp, pi, sqrt

    passed = erf(k / sqrt(2))
    _, one, two, three = pz.Huber(k).squares(3)
    assert one == pytest.approx(k**2)
    assert 1 - exp(-two / 2) == pytest.approx(passed, rel=1e-12)
    assert erf(sqrt(three / 2)) - sqrt(2 * three / pi) * exp(-three / 2) == pytest.approx(passed, rel=1e-12)
    wide = pz.Huber(50.0).squares(4)
    assert np.isfinite(wide).all()
    assert (np.diff(wide[1:]) > 0).all()


@pytest.mark.parametrize(
    ("given", "meant"),
    [
        (None, None),
        ("huber", pz.Huber(1.345)),
        ("cauchy", pz.Cauchy(2.385)),
        ("tukey=6", pz.Tukey(6.0)),
        (pz.Huber(2), pz.Huber(2)),
    ],
)
def test_a_name_means_a_loss(given, meant):
    assert loss_of(given) == meant


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: loss_of("hubert"), "loss is 'hubert'; it must be one of huber, cauchy, tukey"),
        (lambda: loss_of(1.5), "loss is 1.5; it must be one of"),
        (lambda: loss_of("huber=wide"), "loss is 'huber=wide'; its constant must be a positive number"),
        (lambda: loss_of("huber=0"), "loss is 'huber=0'; its constant must be"),
        (lambda: pz.Tukey(-1.0), "k of Tukey is -1.0; it must be positive"),
        (lambda: pz.Cauchy(float("inf")), "k of Cauchy is inf"),
        (lambda: pz.FactorGraph(loss="l1"), "loss is 'l1'"),
        (lambda: pz.SlidingWindow(loss="l1"), "loss is 'l1'"),
    ],
)
def test_what_is_no_loss_is_refused(make, message):
    with pytest.raises(ValueError) as caught:
        make()
    assert message in str(caught.value)
