"""Losses in graph and window: stationary where they say, equal where they must be, and not misled by outliers."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

import piazzi as pz
from tests.laws.graphs import LinearCase
from tests.laws.problems import assert_same_estimate, satellite
from tests.references import dense

LOSSES = [pz.Huber(), pz.Cauchy(), pz.Tukey()]
WIDTHS = (2, 1)


@pytest.fixture(scope="module")
def case():
    """A linear problem, several rows per epoch with full R, gaps, singular Q; a few rows far off."""
    made = LinearCase(3, WIDTHS, seed=5, rank=1, epochs=12)
    rng = np.random.default_rng(1)
    values = 0.3 * made.values
    wrong = rng.choice(np.arange(1, len(values)), 3, replace=False)
    values[wrong] += 25.0
    made.values, made.wrong = values, wrong
    made.tracking = pz.Tracking(made.row_epoch.astype(float), values, [f"station{s}" for s in made.row_station])
    return made


def row_squares(case, mean):
    """Squared whitened residual of every row at these states, and how many components it has; by NumPy alone."""
    s, present = np.zeros(len(case.values)), np.zeros(len(case.values), dtype=int)
    for j, (k, station) in enumerate(zip(case.row_epoch, case.row_station, strict=True)):
        z = case.values[j, : WIDTHS[station]]
        there = ~np.isnan(z)
        present[j] = there.sum()
        r = z[there] - case.H[station][there] @ mean[k]
        s[j] = r @ np.linalg.solve(case.R[station][np.ix_(there, there)], r) if there.any() else 0.0
    return s, present


def seen_with(case, weights):
    """What each epoch measured, stacked, the noise of each row divided by its weight; rows without weight are left out."""
    out = []
    for k in range(case.epochs):
        rows = [j for j in np.flatnonzero(case.row_epoch == k) if weights[j] > 0]
        blocks = [case.R[case.row_station[j]] / weights[j] for j in rows]
        R = np.zeros((0, 0))
        for b in blocks:
            R = np.block([[R, np.zeros((len(R), len(b)))], [np.zeros((len(b), len(R))), b]])
        z = np.concatenate([case.values[j, : WIDTHS[case.row_station[j]]] for j in rows]) if rows else np.zeros(0)
        out.append(dense.Seen(z, np.vstack([case.H[case.row_station[j]] for j in rows]), R) if rows else None)
    return out


@pytest.mark.usefixtures("uncompiled")
@pytest.mark.parametrize("loss", LOSSES, ids=str)
def test_the_graph_is_the_weighted_solution_with_the_weights_of_its_own_residuals(case, loss):
    """Both together say that the gradient of the robust cost is zero; and the covariance is the weighted one."""
    estimate = pz.FactorGraph(loss=loss).estimate(case.problem, case.tracking)
    assert estimate.success, estimate.message
    weights = estimate.details["weights"]
    s, present = row_squares(case, estimate.mean)
    assert_allclose(weights, loss.weight(s, loss.squares(2)[present]), atol=1e-6)
    m, P, transitions, noises, _ = case.chain
    oracle = dense.smooth(m, P, transitions, noises, seen_with(case, weights))
    sigma = np.sqrt(np.diagonal(oracle.covariance, axis1=1, axis2=2))
    assert (np.abs(estimate.mean - oracle.mean) / sigma).max() < 1e-5
    spread = np.abs(estimate.covariance - oracle.covariance) / (sigma[:, :, None] * sigma[:, None, :])
    assert spread.max() < 1e-6  # as far as the last step moved the weights
    good = np.setdiff1d(np.arange(len(weights)), case.wrong)
    assert weights[case.wrong].max() < np.median(weights[good])


@pytest.mark.usefixtures("uncompiled")
@pytest.mark.parametrize("loss", LOSSES, ids=str)
def test_a_loss_that_nothing_reaches_changes_nothing(case, loss):
    far = type(loss)(1e7)
    for plain, robust in (
        (pz.FactorGraph(), pz.FactorGraph(loss=far)),
        (pz.SlidingWindow(lag=5, iterations=2), pz.SlidingWindow(lag=5, iterations=2, loss=far)),
    ):
        a, b = plain.estimate(case.problem, case.tracking), robust.estimate(case.problem, case.tracking)
        assert_same_estimate(b, a, 1e-9)
        assert_allclose(b.details["weights"], 1.0, atol=1e-9)
        assert "weights" not in a.details


@pytest.mark.usefixtures("uncompiled")
def test_the_window_of_all_states_iterated_is_the_robust_graph(case):
    """Huber's cost has one minimum on a linear problem, so both must find it."""
    graph = pz.FactorGraph(loss="huber").estimate(case.problem, case.tracking)
    window = pz.SlidingWindow(lag=case.epochs, iterations=30, loss="huber").estimate(case.problem, case.tracking)
    sigma = np.sqrt(np.diagonal(graph.covariance, axis1=1, axis2=2))
    assert (np.abs(window.mean[-1] - graph.mean[-1]) / sigma[-1]).max() < 1e-5
    assert (np.abs(window.delayed.mean - graph.mean) / sigma).max() < 1e-5
    assert_allclose(window.details["weights"], graph.details["weights"], atol=1e-6)


@pytest.mark.usefixtures("uncompiled")
def test_missing_rows_are_no_outliers(case):
    estimate = pz.FactorGraph(loss="tukey").estimate(case.problem, case.tracking)
    gone = np.isnan(case.values).all(axis=1)
    assert gone.any()
    assert (estimate.details["weights"][gone] == 1.0).all()


def outlying(problem, seed, epochs, share=0.05):
    """A tracking, and the same with a share of its bearings replaced by uniform ones."""
    rng = np.random.default_rng(seed)
    clean = pz.simulate(problem, np.arange(epochs) * 15.0, rng)
    wrong = rng.choice(epochs, round(share * epochs), replace=False)
    values = clean.values.copy()
    values[wrong, 0] = rng.uniform(-np.pi, np.pi, len(wrong))
    return clean, pz.Tracking(clean.row_times, values, truth=clean.truth), wrong


def position_error(estimate):
    return np.sqrt((((estimate.mean - estimate.tracking.truth)[:, :2]) ** 2).sum(axis=1).mean())


@pytest.mark.usefixtures("uncompiled")
def test_live_window_is_the_window():
    problem = satellite()
    _, tracking, _ = outlying(problem, 3, 30)
    settings = pz.SlidingWindow(lag=8, loss="huber")
    whole = settings.estimate(problem, tracking)
    live = settings.start(problem)
    for k, t in enumerate(tracking.times):
        live.update("earth", tracking.values[k], t)
        sigma = np.sqrt(np.diag(whole.covariance[k]))
        assert (np.abs(live.mean - whole.mean[k]) / sigma).max() < 1e-8
    saved = live.checkpoint()
    other = settings.start(problem)
    other.restore(saved)
    for window in (live, other):
        window.update("earth", 1.0, tracking.times[-1] + 15.0)
    assert_allclose(other.mean, live.mean, rtol=1e-12)


@pytest.mark.parametrize("loss", LOSSES, ids=str)
def test_outliers_are_found_where_the_plain_graph_is_lost(loss):
    problem = satellite()
    clean, bad, wrong = outlying(problem, 11, 1441)
    reference, plain = (pz.FactorGraph().estimate(problem, t) for t in (clean, bad))
    robust = pz.FactorGraph(loss=loss).estimate(problem, bad)
    assert robust.success, robust.message
    assert position_error(robust) < 2 * position_error(reference)
    assert position_error(plain) > 10 * position_error(reference)
    off = np.abs(np.angle(np.exp(1j * (bad.values[:, 0] - np.arctan2(bad.truth[:, 1], bad.truth[:, 0]))))) > 0.1
    assert set(np.flatnonzero(off)) <= set(wrong)
    assert robust.details["weights"][off].max() < 0.1
    assert robust.details["weights"][~off].mean() > 0.8
    from piazzi.evaluate.metrics import nis

    assert nis(robust).mean() < 2.0  # what was weighted away says nothing about the rest


@pytest.mark.slow
def test_the_robust_graph_is_as_good_as_the_clean_one_over_fifty_seeds():
    """Median position error with 5 % of the bearings uniform, at most 1.2 times that of the same tracks without."""
    problem = satellite()
    errors = {}
    for seed in range(50):
        clean, bad, _ = outlying(problem, seed, 1441)
        errors.setdefault("clean", []).append(position_error(pz.FactorGraph().estimate(problem, clean)))
        errors.setdefault("plain", []).append(position_error(pz.FactorGraph().estimate(problem, bad)))
        for loss in LOSSES:
            estimate = pz.FactorGraph(loss=loss).estimate(problem, bad)
            assert estimate.success, (seed, estimate.message)
            errors.setdefault(loss.name, []).append(position_error(estimate))
    median = {name: np.median(e) for name, e in errors.items()}
    for loss in LOSSES:
        assert median[loss.name] <= 1.2 * median["clean"], median
    assert median["plain"] > 10 * median["clean"]


@pytest.mark.usefixtures("uncompiled")
def test_tukeys_window_comes_back_from_a_wrong_prior():
    """Fifteen sigma off, every row looks like an outlier; taken at its word, Tukey's loss would never look at one again."""
    problem = satellite(pz.Taylor(3))
    tracking = pz.simulate(problem, np.arange(40) * 15.0, np.random.default_rng(2))
    away = tracking.truth[0] + [1.5e6, 0.0, 0.0, 0.0]
    wrong = satellite(pz.Taylor(3), prior=pz.Gaussian.from_sigma(away, [1e5, 3e6, 800.0, 800.0]))
    loss = pz.Tukey()
    estimate = pz.SlidingWindow(lag=10, loss=loss).estimate(wrong, tracking)
    x, y = estimate.mean[-10:, 0], estimate.mean[-10:, 1]
    residual = (tracking.values[-10:, 0] - np.arctan2(y, x)) / np.sqrt(problem.station_noise[0, 0, 0])
    assert np.abs(residual).mean() < loss.k
    assert estimate.details["weights"][0] < 0.01
    assert estimate.details["weights"][-10:].mean() > 0.5
