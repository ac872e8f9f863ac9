"""Motion over a whole arc from one first state: interval by interval, or by a multi-step method on a grid of its own."""

from __future__ import annotations

from typing import Any, NamedTuple, Protocol

import numpy as np

from piazzi import kernels
from piazzi.kernels import Integrator, KernelSpec
from piazzi.kernels.bundle import Given
from piazzi.kernels.spec import outside_fragments
from piazzi.model import Model
from piazzi.problem.checks import Array
from piazzi.problem.evaluation import cut_at_events
from piazzi.problem.manoeuvres import SAME

FEWEST = 30  # steps between two beginnings of a multi-step method: with fewer, its beginning costs what it saves


class Moving(Protocol):
    """What an arc needs to know of a problem."""

    @property
    def model(self) -> Model: ...

    @property
    def integrator(self) -> Integrator | None: ...

    @property
    def covariance(self) -> Array: ...

    @property
    def given_bundle(self) -> Given: ...

    @property
    def specs(self) -> dict[tuple[Any, ...], KernelSpec]: ...

    def spec(self, *fragments: str, lanes: int = 1) -> KernelSpec: ...

    def cover(self, first: float, last: float) -> bool: ...


class Steps(NamedTuple):
    """Longest steps of an arc: of a one-step method, None where it chooses its own; of a multi-step one, None for none."""

    one: float | None
    grid: float | None = None


class Arc(NamedTuple):
    """States x_k (K, n), and transition matrices Phi(k, k - 1) (K - 1, n, n), which are empty where they were not wanted."""

    x: Array
    Phi: Array


def arc(problem: Moving, times: Array, first: Array, steps: Steps, derivative: bool) -> Arc:
    """The states at increasing times (K,) of the orbit from `first` (n,), which is the state at the first of them."""
    K, n = len(times), problem.model.n
    problem.cover(float(times[0]), float(times[-1]))
    out = Arc(np.empty((K, n)), np.empty((K - 1, n, n) if derivative else (0, n, n)))
    out.x[0] = first
    if steps.grid is None:
        _by_intervals(problem, times, out, steps, events=True)
        return out
    last, node, now = 0, float(times[0]), out.x[0]  # the last epoch; where a smooth stretch begins, with the state there
    before = np.eye(n)  # the derivative of that state by the one at the last epoch
    for when, jump in [*_jumps(problem, times), (np.inf, np.zeros(n))]:
        slack = SAME * max(abs(when), 1.0) if np.isfinite(when) else 0.0
        stop = int(np.searchsorted(times, when + slack, "right"))
        inner = times[last + 1 : stop]
        on_epoch = stop == K if not np.isfinite(when) else bool(len(inner)) and inner[-1] >= when - slack
        nodes = np.concatenate([[node], inner, [] if on_epoch else [when]])
        stretch = _smooth(problem, nodes, now, steps, derivative)
        inside = len(inner)
        out.x[last + 1 : stop] = stretch.x[1 : inside + 1]
        now = stretch.x[-1] + jump
        if derivative and len(nodes) > 1:
            stretch.Phi[0] = stretch.Phi[0] @ before
            out.Phi[last : stop - 1] = stretch.Phi[:inside]
            before = np.eye(n) if on_epoch else stretch.Phi[-1]
        if on_epoch:
            out.x[stop - 1] = now
        last, node = stop - 1, float(nodes[-1])
    return out


def _jumps(problem: Moving, times: Array) -> list[tuple[float, Array]]:
    """Times of the manoeuvres after the first of the times and up to the last, and what they add to the state."""
    n, given = problem.model.n, problem.given_bundle.manoeuvres
    rows = given[1:].reshape(int(given[0]), 1 + n + n * n)
    found = []
    for when, jump in zip(rows[:, 0].tolist(), rows[:, 1 : 1 + n], strict=True):
        slack = SAME * max(abs(when), 1.0)
        if when - times[0] > slack and when - times[-1] <= slack:
            found.append((when, jump))
    return found


def _smooth(problem: Moving, nodes: Array, first: Array, steps: Steps, derivative: bool) -> Arc:
    """A stretch without manoeuvres, on a grid of its own that ends where it does."""
    n, K = problem.model.n, len(nodes)
    out = Arc(np.empty((K, n)), np.empty((K - 1, n, n) if derivative else (0, n, n)))
    out.x[0] = first
    if K < 2:
        return out
    count = grid_steps(nodes[-1] - nodes[0], steps)
    if count < FEWEST:
        _by_intervals(problem, nodes, out, steps, events=False)
        return out
    assert problem.integrator is not None
    scheme = problem.integrator.arc_scheme
    kind = "rows" if derivative else "state"
    library = kernels.load(_spec(problem, scheme, ("matrices", f"gauss_jackson_{kind}", "gauss_jackson")))
    library.run_multistep(K, nodes, count, problem.given_bundle, out.x, out.Phi)
    return out


def grid_steps(length: float, steps: Steps) -> int:
    """Steps of the grid over a stretch of so many seconds."""
    assert steps.grid is not None
    return max(int(np.ceil(length / steps.grid * (1 - SAME))), 1)


def _by_intervals(problem: Moving, times: Array, out: Arc, steps: Steps, events: bool) -> None:
    """One interval after the other; the manoeuvres on the way, where they are not left to the caller."""
    integrator, given, name = problem.integrator, problem.given_bundle, "transitions" if len(out.Phi) else "propagate"
    assert integrator is not None
    if steps.one is not None:
        integrator = kernels.RungeKutta8(max_step=steps.one)
    count = integrator.counts(np.diff(times, prepend=times[0]))
    if events:
        library = kernels.load(problem.spec("transition", name))
    else:
        motion = cut_at_events(problem.model, integrator.fragments)
        library = kernels.load(_spec(problem, integrator.scheme, ("matrices", *motion, "transition", name)))
    if name == "transitions":
        library.run_transitions(len(times), times, count, given, out.x, out.Phi)
    else:
        library.run_propagation(len(times), times, count, given, out.x)


def _spec(problem: Moving, scheme: tuple[object, ...], fragments: tuple[str, ...]) -> KernelSpec:
    """The compiled module of this model with these fragments as they are, whatever the problem's events."""
    key = (*fragments, *map(str, scheme[:1])), -1
    spec = problem.specs.get(key)
    if spec is None or spec.scheme != scheme:
        spec = problem.specs[key] = KernelSpec(problem.model, scheme, outside_fragments(problem.model) + fragments, 1)
    return spec
