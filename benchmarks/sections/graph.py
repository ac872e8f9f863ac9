"""The full factor graph through ``estimate``: EKF start, iterations, marginal covariances; measurements new at every call."""

from __future__ import annotations

from collections.abc import Iterator

from cases import apart, calls, floor, recording, solved, variants
from figures import Figure, interleaved, rounds

import piazzi as pz

REPEATS = 20
BOUND = 2.0


def figures() -> Iterator[Figure]:
    from piazzi.estimate.factor_graph import FactorGraph

    estimator, cases = FactorGraph(), variants(REPEATS + 1)
    seconds, ratio = interleaved(calls(estimator, cases), lambda: floor().seconds("graph", 3))
    estimate = estimator.estimate(*pz.load(recording()))
    note = f"{estimate.iterations} iterations, the floor 4; {apart(floor().graph()[0], estimate)}"
    yield Figure("graph from the EKF, with marginals", seconds * 1e3, "ms", ratio=ratio, to="C floor", bound=BOUND, note=note)
    yield from _parts()


def _parts() -> Iterator[Figure]:
    """One operation each at the solution, for where the time goes."""
    chain, solver = solved()
    parts = {"linearize": chain.linearize, "solve": lambda: solver.solve(0.0), "marginals": solver.marginals}
    for name, seconds in rounds(parts, 25).items():
        yield Figure(f"  {name}, once", seconds * 1e3, "ms", ratio=seconds / floor().seconds(name, 5), to="C floor")
    innovations = rounds({"innovations": chain.innovations}, 25)["innovations"]
    yield Figure("  innovations, once", innovations * 1e3, "ms", note="the floor has none")
