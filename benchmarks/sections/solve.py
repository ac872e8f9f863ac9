"""One linear solve of the final linearisation beside GTSAM's paths through the same system, and a whole optimisation.

GTSAM's graph is built from our f, Phi, H and Q before the clock starts.  The right-hand side is that of the solution with
measurement residuals drawn anew, so that there is a step to compare; what GTSAM raises is said and not timed.
"""

from __future__ import annotations

import statistics
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from by_hand import bearing, bearing_jacobian, bearing_residual, step
from cases import apart, floor, recording, solved
from figures import Figure, UnavailableError, cpu_seconds

import piazzi as pz

REPEATS = 15
BOUND = 30.0


def figures() -> Iterator[Figure]:
    try:
        import gtsam
    except ImportError as error:
        raise UnavailableError(f"GTSAM: {error}") from None
    chain, solver = solved()
    chain.nu[:] = np.random.default_rng(0).normal(size=chain.nu.shape)
    solver.solve(0.0)
    step, sigma = chain.dx.copy(), np.sqrt(np.diagonal(solver.marginals(), axis1=1, axis2=2))
    working, raised = [], []
    for name, path in _paths(gtsam, _linear_graph(gtsam, chain), len(step)):
        try:
            error = float((np.abs(_stacked(path(), len(step)) - step) / sigma).max())
        except RuntimeError as problem:
            raised.append(f"{name} ({' '.join(str(problem).split())[:34]})" if not raised else name)
            continue
        working.append((*_interleaved(path, lambda: solver.solve(0.0)), name, error))
    ours = statistics.median(ours for _, _, ours, _, _ in working)
    yield Figure("one linear solve, N = 1441", ours * 1e3, "ms", ratio=ours / floor().seconds("solve", 7), to="C floor")
    working.sort()
    qr = [row for row in working if "QR" in row[3]]
    for what, (ratio, theirs, _, name, error) in (("fastest that works", working[0]), ("fastest by QR", qr[0])):
        note = f"{name}; {error:.0e} sigma from ours"
        yield Figure(f"  GTSAM, {what}", theirs * 1e3, "ms", "higher", ratio, "ours", BOUND, note=note)
    slowest = f"the slowest: {working[-1][3]}, {working[-1][1] * 1e3:.0f} ms"
    yield Figure("  GTSAM, paths that work", len(working), f"of {len(working) + len(raised)}", "higher", note=slowest)
    if raised:
        yield Figure("  GTSAM, paths that raise", len(raised), f"of {len(working) + len(raised)}", note=", ".join(raised))
    yield from _optimizations(gtsam)


def _linear_graph(gtsam: Any, chain: Any) -> Any:
    """The same least-squares problem as whitened Jacobian factors."""
    problem, inputs, x = chain.problem, chain.inputs, chain.x
    graph = gtsam.GaussianFactorGraph()
    four, one = gtsam.noiseModel.Unit.Create(4), gtsam.noiseModel.Unit.Create(1)
    W = np.linalg.inv(np.linalg.cholesky(problem.covariance))
    graph.add(0, W, W @ (problem.mean - x[0]), four)
    for k in range(len(x) - 1):
        W = np.linalg.inv(np.linalg.cholesky(problem.process_noise.covariance * inputs.scale[k + 1]))
        graph.add(k, -W @ chain.Phi[k], k + 1, W, W @ (chain.f[k] - x[k + 1]), four)
    for k in range(len(x)):
        graph.add(k, chain.H[k], chain.nu[k], one)
    return graph


def _paths(gtsam: Any, graph: Any, K: int) -> Iterator[tuple[str, Callable[[], Any]]]:
    """Every way through: multifrontal or sequential, Cholesky or QR, in each ordering (finding the ordering is not timed)."""
    yield "optimize() by default", graph.optimize
    for kind in ("NATURAL", "COLAMD", "METIS"):
        order = gtsam.Ordering.CreateGaussianFactorGraph(getattr(gtsam.Ordering.OrderingType, kind), graph)
        for method, more in (("Cholesky", ()), ("QR", (gtsam.EliminateQR,))):
            name = f"{method} in {kind.lower()} order"
            yield f"multifrontal {name}", lambda order=order, more=more: graph.optimize(order, *more)
            yield f"sequential {name}", lambda order=order, more=more: graph.eliminateSequential(order, *more).optimize()
    for solver in ("MULTIFRONTAL_QR", "SEQUENTIAL_QR"):
        yield f"{solver} inside an optimizer", _within_optimizer(gtsam, graph, K, solver)


def _within_optimizer(gtsam: Any, graph: Any, K: int, solver: str) -> Callable[[], Any]:
    """One iteration over the linear factors in wrappers: QR without a call back into Python is had in optimizers only."""
    values, wrapped = gtsam.Values(), gtsam.NonlinearFactorGraph()
    for key in range(K):
        values.insert(key, np.zeros(4))
    for i in range(graph.size()):
        wrapped.push_back(gtsam.LinearContainerFactor(graph.at(i)))
    parameters = gtsam.GaussNewtonParams()
    parameters.setLinearSolverType(solver)

    def iterate() -> Any:
        optimizer = gtsam.GaussNewtonOptimizer(wrapped, values, parameters)
        optimizer.iterate()
        return optimizer.values()

    return iterate


def _stacked(solution: Any, K: int) -> np.ndarray:
    read = solution.atVector if hasattr(solution, "atVector") else solution.at
    return np.array([read(k) for k in range(K)])


def _interleaved(theirs: Callable[[], Any], ours: Callable[[], Any]) -> tuple[float, float, float]:
    """Median ratio of their seconds to ours, and both medians."""
    pairs = [(cpu_seconds(theirs), statistics.median(cpu_seconds(ours) for _ in range(5))) for _ in range(REPEATS)]
    a, b = zip(*pairs, strict=True)
    return statistics.median(x / y for x, y in pairs), statistics.median(a), statistics.median(b)


# ---- a whole optimisation, as a user of GTSAM in Python writes it ------------------------------------------------------


def _optimizations(gtsam: Any) -> Iterator[Figure]:
    from piazzi.estimate.factor_graph import FactorGraph

    problem, tracking = pz.load(recording())
    start = pz.ExtendedKalmanFilter().estimate(problem, tracking).mean
    ours = FactorGraph(start=start)
    estimate = ours.estimate(problem, tracking)
    mine = statistics.median(cpu_seconds(lambda: ours.estimate(problem, tracking)) for _ in range(9))
    yield Figure("graph from given states, with marginals", mine * 1e3, "ms", note=f"{estimate.iterations} iterations")
    graph, values = _nonlinear_graph(gtsam, problem, tracking, start)
    parameters = gtsam.GaussNewtonParams()
    parameters.setLinearSolverType("MULTIFRONTAL_QR")
    optimizer = gtsam.GaussNewtonOptimizer(graph, values, parameters)
    theirs = cpu_seconds(optimizer.optimize)
    what = f"Gauss-Newton with QR, factors in Python, {optimizer.iterations()} iterations, no marginals"
    note = f"{what}; {apart(_stacked(optimizer.values(), len(start)), estimate)}"
    yield Figure("  GTSAM optimize()", theirs * 1e3, "ms", "higher", theirs / mine, "ours", BOUND, note=note)


def _nonlinear_graph(gtsam: Any, problem: pz.Problem, tracking: pz.Tracking, start: np.ndarray) -> tuple[Any, Any]:
    """Prior, dynamics and bearing factors with Python functions for their errors, and values to start from."""
    graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
    gaussian = gtsam.noiseModel.Gaussian.Covariance
    dt = float(tracking.times[1] - tracking.times[0])
    substeps = int(problem.integrator.counts(np.array([dt]))[0])

    def dynamics(factor: Any, states: Any, jacobians: Any) -> np.ndarray:
        before, after = factor.keys()
        reached, Phi = step(states.atVector(before), dt, substeps)
        if jacobians is not None:
            jacobians[0], jacobians[1] = -Phi, np.eye(4)
        return states.atVector(after) - reached

    def measured(z: float) -> Callable[[Any, Any, Any], np.ndarray]:
        def error(factor: Any, states: Any, jacobians: Any) -> np.ndarray:
            x = states.atVector(factor.keys()[0])
            if jacobians is not None:
                jacobians[0] = bearing_jacobian(x)
            return -bearing_residual(z, bearing(x))

        return error

    graph.add(gtsam.PriorFactorVector(0, problem.mean, gaussian(problem.covariance)))
    Q, R = gaussian(problem.process_noise.covariance * dt), gaussian(problem.stations[0].noise)
    for k, z in enumerate(tracking.values[:, 0]):
        values.insert(k, start[k])
        graph.add(gtsam.CustomFactor(R, [k], measured(z)))
        if k:
            graph.add(gtsam.CustomFactor(Q, [k - 1, k], dynamics))
    return graph, values
