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
    problem.cover(float(times[0]), float(times[-1]))
    way = _Way(times, first, derivative)
    if steps.grid is None:
        _by_intervals(problem, times, way.out, steps, events=True)
        return way.out
    for when, jump in [*_jumps(problem, times), (np.inf, np.zeros(len(first)))]:
        slack = SAME * max(abs(when), 1.0) if np.isfinite(when) else 0.0
        stop = int(np.searchsorted(times, when + slack, "right"))
        inner = times[way.last + 1 : stop]
        on_epoch = stop == len(times) if not np.isfinite(when) else bool(len(inner)) and inner[-1] >= when - slack
        nodes = np.concatenate([[way.node], inner, [] if on_epoch else [when]])
        way.go(_smooth(problem, nodes, way.now, steps, derivative), len(inner), float(nodes[-1]))
        way.now = way.now + jump
        if on_epoch:
            way.out.x[stop - 1] = way.now
    return way.out


class _Way:
    """An arc that is put together of stretches, which may end between its epochs.

    Attributes
    ----------
    out : what is known of it
    last : the last epoch that was reached
    node, now, before : where the next stretch begins, the state there, and its derivative by that of the last epoch
    """

    def __init__(self, times: Array, first: Array, derivative: bool) -> None:
        K, n = len(times), len(first)
        self.out = Arc(np.empty((K, n)), np.empty((K - 1, n, n) if derivative else (0, n, n)))
        self.out.x[0] = first
        self.last, self.node, self.now, self.before = 0, float(times[0]), self.out.x[0], np.eye(n)

    def go(self, stretch: Arc, inside: int, node: float) -> None:
        """Add a stretch whose nodes behind its first are `inside` epochs, and one more if it does not end at an epoch."""
        first, stop = self.last, self.last + inside
        self.out.x[first + 1 : stop + 1] = stretch.x[1 : inside + 1]
        if len(stretch.Phi):
            stretch.Phi[0] = stretch.Phi[0] @ self.before
            self.out.Phi[first:stop] = stretch.Phi[:inside]
            self.before = np.eye(len(self.now)) if inside == len(stretch.Phi) else stretch.Phi[-1]
        self.last, self.node, self.now = stop, node, stretch.x[-1]


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
    """A stretch without manoeuvres, on a grid of its own that ends where it does.

    Before a step in which an event may be passed the grid ends too; that step is one of order 8, and another grid begins
    behind it.  Where that comes more often than every `FEWEST` steps, the rest goes by order 8.
    """
    way, taken, ends = _Way(nodes, first, derivative), 0, 0
    while way.last < len(nodes) - 1:
        at = np.concatenate([[way.node], nodes[way.last + 1 :]])
        count = grid_steps(at[-1] - at[0], steps)
        if count < FEWEST or (ends > 1 and taken < FEWEST * ends):
            way.go(_stepped(problem, at, way.now, steps, derivative), len(at) - 1, float(at[-1]))
            break
        done, inside, node, part = _on_grid(problem, at, way.now, count, derivative)
        way.go(part, inside, node)
        if done == count:
            break
        taken, ends = taken + done, ends + 1
        end = float(at[-1] if done + 1 == count else at[0] + (done + 1) * ((at[-1] - at[0]) / count))
        inner = nodes[way.last + 1 : int(np.searchsorted(nodes, end, "right"))]
        beyond = [] if len(inner) and inner[-1] == end else [end]
        step = np.concatenate([[node], inner, beyond])
        way.go(_stepped(problem, step, way.now, steps, derivative), len(inner), end)
    return way.out


def _on_grid(problem: Moving, at: Array, first: Array, count: int, derivative: bool) -> tuple[int, int, float, Arc]:
    """So many equal steps of the multi-step method, or those before an event: how many, and how many epochs, until when."""
    n, K = len(first), len(at)
    out, last_Phi = Arc(np.empty((K, n)), np.empty((K - 1, n, n) if derivative else (0, n, n))), np.eye(n)
    out.x[0] = first
    assert problem.integrator is not None
    watched = ("events", "arc_watched") if problem.model.events else ("arc_unwatched",)
    carried = ("gauss_jackson_rows", "gauss_jackson_intervals") if derivative else ("gauss_jackson_state",)
    fragments = ("matrices", *watched, *carried, "gauss_jackson")
    library = kernels.load(spec_of(problem, problem.integrator.arc_scheme, fragments))
    done = np.array([count, K - 1, at[-1]])
    library.run_multistep(K, at, count, problem.given_bundle, out.x, out.Phi, done, last_Phi)
    inside = int(done[1])
    if int(done[0]) < count:
        Phi = np.concatenate([out.Phi[:inside], last_Phi[None]]) if derivative else out.Phi
        out = Arc(out.x[: inside + 2], Phi)
    return int(done[0]), inside, float(done[2]), out


def _stepped(problem: Moving, at: Array, first: Array, steps: Steps, derivative: bool) -> Arc:
    """A stretch without manoeuvres by one-step methods."""
    n, K = len(first), len(at)
    out = Arc(np.empty((K, n)), np.empty((K - 1, n, n) if derivative else (0, n, n)))
    out.x[0] = first
    _by_intervals(problem, at, out, steps, events=False)
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
        library = kernels.load(spec_of(problem, integrator.scheme, ("matrices", *motion, "transition", name)))
    if name == "transitions":
        library.run_transitions(len(times), times, count, given, out.x, out.Phi)
    else:
        library.run_propagation(len(times), times, count, given, out.x)


def spec_of(problem: Moving, scheme: tuple[object, ...], fragments: tuple[str, ...]) -> KernelSpec:
    """The compiled module of this model with these fragments as they are, whatever the problem's events."""
    key = (*fragments, *map(str, scheme[:1])), -1
    spec = problem.specs.get(key)
    if spec is None or spec.scheme != scheme:
        spec = problem.specs[key] = KernelSpec(problem.model, scheme, outside_fragments(problem.model) + fragments, 1)
    return spec
