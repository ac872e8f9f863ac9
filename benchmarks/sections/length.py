"""How time and memory grow with the number of epochs: simulated runs of the same problem."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from cases import Case, long_runs
from figures import Figure, rounds
from memory import peak_bytes, peak_resident_bytes, result_bytes

import piazzi as pz

ROUNDS = 5


def figures() -> Iterator[Figure]:
    yield from _ekf()
    yield from _graph()


def _ekf() -> Iterator[Figure]:
    estimator = pz.ExtendedKalmanFilter()
    cases = {K: long_runs(K)[0] for K in (10**4, 10**5, 10**6)}
    yield from _flat("EKF", estimator, cases, 1.15)
    yield from _memory("EKF", estimator, cases[10**6])


def _graph() -> Iterator[Figure]:
    from piazzi.estimate.factor_graph import FactorGraph

    estimator = FactorGraph()
    cases = {K: long_runs(K)[0] for K in (10**4, 10**5)}
    yield from _flat("graph", estimator, cases, 1.2)
    for K in (10**5, 10**6):
        case = cases[K] if K in cases else long_runs(K)[0]
        yield from _iterations(estimator, case)
        yield from _memory("graph", estimator, case)


def _flat(what: str, estimator: Any, cases: dict[int, Case], bound: float) -> Iterator[Figure]:
    """Time per epoch at each length, and the largest over the smallest."""
    seconds = rounds({K: (lambda case=case: estimator.estimate(*case)) for K, case in cases.items()}, ROUNDS)
    per_epoch = {K: s / K for K, s in seconds.items()}
    shortest = min(per_epoch)
    for K, value in per_epoch.items():
        name, to = f"{what}, {K:.0e} epochs, per epoch", f"{shortest:.0e} epochs"
        if K == shortest:
            yield Figure(name, value * 1e9, "ns")
        else:
            yield Figure(name, value * 1e9, "ns", ratio=value / per_epoch[shortest], to=to, bound=bound)


def _memory(what: str, estimator: Any, case: Case) -> Iterator[Figure]:
    """Peak memory of a run: what it asks for by tracemalloc, and by how much the process grew."""
    K = len(case[1].times)
    estimate, traced = peak_bytes(lambda: estimator.estimate(*case))
    results = result_bytes(estimate)
    del estimate
    note = f"results {results / K:.0f} bytes per epoch, beyond them {(traced - results) / K:.0f} at the peak"
    name = f"{what}, {K:.0e} epochs, memory at peak"
    yield Figure(name, traced / 2**20, "MiB", ratio=traced / results, to="results", note=note)
    _, resident = peak_resident_bytes(lambda: estimator.estimate(*case))
    if resident is not None:
        yield Figure("  growth of the resident set", resident / 2**20, "MiB", ratio=resident / results, to="results")


def _iterations(estimator: Any, case: Case) -> Iterator[Figure]:
    estimate = estimator.estimate(*case)
    K = len(estimate.times)
    state = "converged" if estimate.success else estimate.message
    note = f"{estimate.iterations} iterations, {estimate.seconds:.2f} s with start and marginals; {state}"
    yield Figure(f"graph, {K:.0e} epochs, per iteration", estimate.seconds / max(estimate.iterations, 1), "s", note=note)
