"""Covariances do not depend on the order of the states: advection on a ring and Lorenz-96, against 60 digits."""

import mpmath as mp
import numpy as np
import pytest
from numpy.testing import assert_allclose

import piazzi as pz


def posterior(prior, Phi, Q, H, R, K):
    """Covariances (K, n, n) of all states given all measurements, by the normal matrix of the whole run in 60 digits.

    `prior`, `Q` and `R` are diagonals, `Phi` (K - 1, n, n), `H` (m, n) of every epoch.
    """
    n = len(prior)
    with mp.workdps(60):
        Y = mp.zeros(K * n)

        def add(A, weights, at):
            for row, weight in zip(A, weights, strict=True):
                used = [(i, mp.mpf(float(v))) for i, v in enumerate(row) if v]
                for i, u in used:
                    for j, v in used:
                        Y[at + i, at + j] += u * v / mp.mpf(float(weight))

        add(np.eye(n), prior, 0)
        for k in range(K):
            add(H, R, k * n)
            if k > 0:
                add(np.hstack([-Phi[k - 1], np.eye(n)]), Q, (k - 1) * n)
        P = Y**-1
        return np.array([[[float(P[k * n + i, k * n + j]) for j in range(n)] for i in range(n)] for k in range(K)])


def permuted(order, states, dynamics, seen, q, r, prior, truth):
    """The problem with its states in that order."""
    names = [states[i] for i in order]
    model = pz.Model(names, [dynamics[i] for i in order], [pz.Sensor("s", [states[i] for i in seen])], discrete=True)
    return pz.Problem(
        model,
        pz.Gaussian([truth[i] for i in order], np.diag(prior[order])),
        pz.ProcessNoise(q * np.eye(len(names)), per="step"),
        [pz.Station("s", "s", r * np.eye(len(seen)))],
    )


ORDERS = [np.arange(10), np.arange(10)[::-1], np.random.default_rng(0).permutation(10)]
NAMES = ["forward", "backward", "mixed"]


@pytest.fixture(scope="module")
def advection():
    """Ten states on a ring, moved by a fiftieth of a cell a step, of which the second half is measured; and what is true."""
    c, n, K = 0.02, 10, 6
    A = np.eye(n) * (1 - c) + c * np.roll(np.eye(n), 1, axis=0)
    states = [f"x{i}" for i in range(n)]
    dynamics = [f"{1 - c!r}*x{i} + {c!r}*x{(i - 1) % n}" for i in range(n)]
    assert_allclose(A[3], (1 - c) * np.eye(n)[3] + c * np.eye(n)[2])
    given = {"states": states, "dynamics": dynamics, "seen": [5, 6, 7, 8, 9], "q": 1e-6, "r": 1e-4}
    given |= {"prior": np.ones(n), "truth": np.zeros(n)}
    return given, posterior(np.ones(n), [A] * (K - 1), [1e-6] * n, np.eye(n)[5:], [1e-4] * 5, K)


@pytest.mark.parametrize(
    "order",
    [pytest.param(o, id=i, marks=() if i == "mixed" else pytest.mark.slow) for o, i in zip(ORDERS, NAMES, strict=True)],
)
@pytest.mark.parametrize(
    "estimator",
    [pz.Smoother(), pz.FactorGraph(), pytest.param(pz.SlidingWindow(lag=10), marks=pytest.mark.slow)],  # the dearest kernel
    ids=lambda e: type(e).__name__,
)
@pytest.mark.parametrize("lanes", ["", "1"])
def test_advection_in_any_order(advection, order, estimator, lanes, monkeypatch):
    from piazzi.kernels.spec import machine_lanes

    if lanes:
        monkeypatch.setenv("PIAZZI_LANES", lanes)
        machine_lanes.cache_clear()
    given, truth = advection
    try:
        estimate = estimator.estimate(permuted(order, **given), pz.Tracking(np.arange(6.0), np.zeros((6, 5))))
    finally:
        monkeypatch.undo()
        machine_lanes.cache_clear()
    estimate = estimate.delayed or estimate
    assert estimate.success
    back = np.argsort(order)
    found = estimate.covariance[:, back][:, :, back]
    sigma = np.sqrt(np.diagonal(truth, axis1=1, axis2=2))
    scale = sigma[:, :, None] * sigma[:, None, :]
    assert_allclose(found / scale, truth / scale, rtol=0, atol=1e-10)


@pytest.mark.slow
@pytest.mark.parametrize("reverse", [False, True])
def test_lorenz_96_in_both_orders(reverse, monkeypatch):
    """Twenty states, seven of them seen: the graph's covariances against those of its own linearisation in 60 digits."""
    monkeypatch.setenv("PIAZZI_JIT", "0")
    n, K, dt = 20, 6, 0.05
    rates = [f"(x{(i + 1) % n} - x{(i - 2) % n})*x{(i - 1) % n} - x{i} + 8" for i in range(n)]
    rng = np.random.default_rng(4)
    start = 8 + rng.normal(0, 1, n)
    order = np.arange(n)[::-1] if reverse else np.arange(n)
    states, seen = [f"x{i}" for i in range(n)], list(range(0, n, 3))
    dynamics = [f"x{i} + dt*({rate})" for i, rate in enumerate(rates)]
    problem = permuted(order, states, dynamics, seen, 1e-6, 1e-4, np.full(n, 0.25), start)
    tracking = pz.simulate(problem, dt * np.arange(K), np.random.default_rng(5))
    estimate = pz.FactorGraph(tolerance=1e-9).estimate(problem, tracking)  # so that it is linearised where it ends
    assert estimate.success
    back = np.argsort(order)
    Phi = [problem.step(x, dt, 0.0)[1][back][:, back] for x in estimate.mean[:-1]]
    truth = posterior(np.full(n, 0.25), Phi, [1e-6] * n, np.eye(n)[seen], [1e-4] * len(seen), K)
    sigma = np.sqrt(np.diagonal(truth, axis1=1, axis2=2))
    scale = sigma[:, :, None] * sigma[:, None, :]
    assert_allclose(estimate.covariance[:, back][:, :, back] / scale, truth / scale, rtol=0, atol=1e-10)
