"""How time and memory grow with the number of epochs: simulated runs of the same problem.

Memory is what tracemalloc counts: all arrays of NumPy, from when they are asked for; compiled code asks for none.  An EKF needs
its results and, for the kernel, three flat columns about the epochs (substeps, noise scale, station: 24 bytes each).  A graph
keeps what it linearised and predicted at every state besides.
"""

from __future__ import annotations

import tracemalloc
from collections.abc import Iterator
from typing import Any

from cases import Case, long_runs, solved
from figures import Figure, cpu_seconds, rounds

import piazzi as pz

ROUNDS = 5


def figures() -> Iterator[Figure]:
    yield from _ekf()
    yield from _flat("window of 10", pz.SlidingWindow(lag=10), {K: long_runs(K)[0] for K in (10**4, 10**5)}, 1.2)
    yield from _graph()


def _ekf() -> Iterator[Figure]:
    estimator = pz.ExtendedKalmanFilter()
    cases = {K: long_runs(K)[0] for K in (10**4, 10**5, 10**6)}
    yield from _flat("EKF", estimator, cases, 1.15)
    yield _memory("EKF", estimator, cases[10**6], bound=1.2)


def _graph() -> Iterator[Figure]:
    from piazzi.estimate.factor_graph import FactorGraph

    estimator = FactorGraph()
    cases = {K: long_runs(K)[0] for K in (10**4, 10**5)}
    yield from _flat("graph", estimator, cases, 1.2)
    for K in (10**5, 10**6):
        case = cases[K] if K in cases else long_runs(K)[0]
        yield _whole(estimator, case)
        yield _iteration(case)
        yield _memory("graph", estimator, case)


def _flat(what: str, estimator: Any, cases: dict[int, Case], bound: float) -> Iterator[Figure]:
    """Time per epoch at each length, and its ratio to the one of the shortest."""
    seconds = rounds({K: (lambda case=case: estimator.estimate(*case)) for K, case in cases.items()}, ROUNDS)
    per_epoch = {K: s / K for K, s in seconds.items()}
    shortest = min(per_epoch)
    for K, value in per_epoch.items():
        name, to = f"{what}, {_short(K)} epochs, per epoch", f"{_short(shortest)} epochs"
        if shortest == K:
            yield Figure(name, value * 1e9, "ns")
        else:
            yield Figure(name, value * 1e9, "ns", ratio=value / per_epoch[shortest], to=to, bound=bound)


def _memory(what: str, estimator: Any, case: Case, bound: float | None = None) -> Figure:
    """Peak memory of a run over that of its results."""
    K, held = len(case[1].times), []
    tracemalloc.start()
    try:
        before = tracemalloc.get_traced_memory()[0]
        held.append(estimator.estimate(*case))
        peak = tracemalloc.get_traced_memory()[1] - before
    finally:
        tracemalloc.stop()
    e = held.pop()
    results = sum(a.nbytes for a in (e.mean, e.covariance, e.innovations, e.innovation_covariances))
    note = f"results {results / K:.0f} bytes per epoch, beyond them {(peak - results) / K:.0f} at the peak"
    name = f"{what}, {_short(K)} epochs, memory at peak"
    return Figure(name, peak / 2**20, "MiB", ratio=peak / results, to="results", bound=bound, tolerance=0.01, note=note)


def _whole(estimator: Any, case: Case) -> Figure:
    estimates: list[Any] = []
    seconds = cpu_seconds(lambda: estimates.append(estimator.estimate(*case)))
    e = estimates[0]
    note = f"{e.iterations} iterations, with start and marginals; {'converged' if e.success else e.message}"
    return Figure(f"graph, {_short(len(e.times))} epochs, whole", seconds, "s", note=note)


def _iteration(case: Case) -> Figure:
    """One iteration at the solution: linearise and solve."""
    chain, solver = solved(case)

    def iterate() -> None:
        chain.linearize()
        solver.solve(0.0)

    return Figure(f"graph, {_short(len(chain.x))} epochs, per iteration", rounds({0: iterate}, ROUNDS)[0], "s")


def _short(K: int) -> str:
    return f"{K:.0e}".replace("e+0", "e")
