"""Orbits in space beside hand-written C: calls of the field and of a table, steps, days with transition matrix, tables."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import orbits
from figures import Figure, UnavailableError
from floor.space import build, vector_table_seconds

import piazzi as pz
from piazzi.earth import tabulated
from piazzi.kernels.generate import model_source
from piazzi.model.derivation import derive, derive_sensor
from piazzi.problem import outside

DEGREES = (2, 8, 20, 70)
ROUNDS, CALLS = 9, 200_000
BOUND, LOOK_UP_BOUND, DAY_BOUND = 1.3, 1.5, 1.5
DAY, MONTH = orbits.DAY, 30 * orbits.DAY
NODES = {"a day": (DAY, 0.05), "a month": (MONTH, 1.0)}  # seconds of an arc, CPU seconds
STEPS = (
    180.0,
    150.0,
    120.0,
    100.0,
    90.0,
    75.0,
    60.0,
    50.0,
    45.0,
    40.0,
    30.0,
    25.0,
    20.0,
    15.0,
    12.0,
    10.0,
)  # s, those that are tried
CLOSE = 1e-3  # m at the end of a day
METHODS: dict[str, tuple[str, int, Callable[..., Any]]] = {
    "RK4": ("rk4", 0, pz.RungeKutta4),
    "order 8": ("rk8", 0, pz.RungeKutta8),
    "Gauss-Jackson 12": ("gauss-jackson", 12, lambda max_step: pz.GaussJackson(max_step=max_step, order=12)),
}
# CPU ms of others for a day of the same forces, on the machine of the floor's first figures, with their errors
OTHERS = {
    20: "others for 21x21: satkit 64 (1 mm), Orekit 441 (5 cm), nyx 487 (without matrix), brahe 501 (1 m, no drag)",
    70: "others for 70x70: satkit 569 (1 mm), Orekit 898 (3 m), nyx 1306 (without matrix), brahe 2219 (2 m, no drag)",
}


def figures() -> Iterator[Figure]:
    try:
        build()
    except FileNotFoundError as error:
        raise UnavailableError(f"the floor needs gcc ({error})") from None
    yield from _calls()
    yield _look_up()
    for every in (False, True):
        yield from _steps(every)
    yield from _days()
    yield from _less_gradient()
    yield from _nodes()
    yield _derivation()


def _beside(ours: Callable[[], float], theirs: Callable[[], float], rounds: int = ROUNDS) -> tuple[float, float]:
    """Median of what ours says it took, and median ratio to what the other says right after it."""
    ours()
    theirs()
    pairs = [(ours(), theirs()) for _ in range(rounds)]
    return statistics.median(a for a, _ in pairs), statistics.median(a / b for a, b in pairs)


def _timed(run: Callable[[], Any], count: int) -> Callable[[], float]:
    """CPU seconds of this thread for one of the `count` things that a run does."""

    def seconds() -> float:
        started = time.thread_time()
        run()
        return (time.thread_time() - started) / count

    return seconds


def _figure(name: str, found: tuple[float, float], scale: float, unit: str, bound: float | None, note: str = "") -> Figure:
    return Figure(name, found[0] * scale, unit, ratio=found[1], to="C floor", bound=bound, note=note)


def _calls() -> Iterator[Figure]:
    library, x, out = orbits.calls(), orbits.first_state(), np.empty(24)
    eight = np.repeat(x[:3], 8)
    for degree in DEGREES:
        beside, data, n = orbits.floor(degree, False), orbits.field(degree).data, CALLS // (degree + 1)
        for name, what, entry in (
            ("acceleration", "gravity", library.call_value),
            ("acceleration and gradient", "gradient", library.call_partials),
        ):
            ours = _timed(lambda entry=entry, n=n, data=data: entry(n, x, data, out), n)
            found = _beside(ours, lambda what=what, beside=beside, n=n: beside.call_seconds(what, n))
            yield _figure(f"{name}, degree {degree}", found, 1e9, "ns", BOUND)
        groups = n // 8
        ours = _timed(lambda n=groups, data=data: library.call_lanes(n, eight, data, out), 8 * groups)
        found = _beside(ours, lambda beside=beside, n=n: beside.call_seconds("lanes", n))
        yield _figure("  of one of eight states in lanes", found, 1e9, "ns", BOUND)


def _look_up() -> Figure:
    library, pieces, out = orbits.calls(), orbits.vector_table(), np.empty(4)
    padded = np.zeros((*pieces.coefficients.shape[:2], 4))
    padded[:, :, :3] = pieces.coefficients
    ours = _timed(lambda: library.look_up(CALLS, pieces.block, out), CALLS)
    found = _beside(ours, lambda: vector_table_seconds(pieces.start, pieces.length, padded, CALLS))
    return _figure("look-up of a 3-vector", found, 1e9, "ns", LOOK_UP_BOUND)


def _steps(every: bool) -> Iterator[Figure]:
    """One step of each method with the transition matrix, by a run of many."""
    which = "all forces" if every else "Sun and Moon"
    for degree in (20,) if every else DEGREES:
        case, beside = orbits.problem(degree, every), orbits.floor(degree, every)
        for name, (method, order, make) in METHODS.items():
            count = 1440  # a day: what a call costs in Python does not count
            ours = _timed(orbits.propagation(case, make(max_step=60.0), 60.0 * count), count)
            found = _beside(ours, lambda m=method, o=order, b=beside, n=count: b.propagate(m, n, 60.0 * n, o)[2] / n)
            bound = DAY_BOUND if every else BOUND
            yield _figure(f"step of {name}, degree {degree}, {which}", found, 1e6, "us", bound)


def _days() -> Iterator[Figure]:
    """A day with the transition matrix, each side by the longest step that ends within a millimetre."""
    for degree in (20, 70):
        case, beside = orbits.problem(degree, True), orbits.floor(degree, True)
        theirs = {name: _their_steps(beside, *METHODS[name][:2]) for name in ("order 8", "Gauss-Jackson 12")}
        for name, n in theirs.items():
            method, order, make = METHODS[name]
            step, error = _our_step(case, make)
            ours = _timed(orbits.propagation(case, make(max_step=step), DAY), 1)
            found = _beside(ours, lambda m=method, o=order, b=beside, n=n: b.propagate(m, n, DAY, o)[2])
            note = f"steps of {step:g} s (C {DAY / n:g} s), {error * 1e3:.2g} mm off"
            yield _figure(f"day by {name}, degree {degree}", found, 1e3, "ms", BOUND, note)
            if name != "order 8":
                found = _beside(ours, lambda b=beside, n=theirs["order 8"]: b.propagate("rk8", n, DAY)[2])
                yield _figure("  beside order 8 in C", found, 1e3, "ms", DAY_BOUND, OTHERS[degree])


def _their_steps(beside: Any, method: str, order: int) -> int:
    """The fewest steps over a day that end within a millimetre of order 8 in short ones."""
    exact = beside.propagate("rk8", round(DAY / 7.5), DAY)[0][:3]
    for step in STEPS:
        n = round(DAY / step)
        if np.linalg.norm(beside.propagate(method, n, DAY, order)[0][:3] - exact) <= CLOSE:
            return n
    return round(DAY / STEPS[-1])


def _our_step(case: pz.Problem, make: Callable[..., Any]) -> tuple[float, float]:
    """The longest step, and how far the day's end is then."""
    exact = orbits.propagation(case, pz.RungeKutta8(max_step=7.5), DAY)().x[-1, :3]
    off = np.inf
    for step in STEPS:
        off = float(np.linalg.norm(orbits.propagation(case, make(max_step=step), DAY)().x[-1, :3] - exact))
        if off <= CLOSE:
            return step, off
    return STEPS[-1], off


def _less_gradient() -> Iterator[Figure]:
    """What the transition matrix costs with the gradient of degree 8, beside the whole one."""
    for degree in (20, 70):
        whole, less = (orbits.problem(degree, False, gradient) for gradient in (None, 8))
        runs = [_timed(orbits.propagation(case, pz.RungeKutta8(max_step=60.0), DAY / 4), 1) for case in (less, whole)]
        seconds, ratio = _beside(*runs)
        yield Figure(f"gradient of degree 8 for one of {degree}", seconds * 1e3, "ms", ratio=ratio, to="the whole")


def _nodes() -> Iterator[Figure]:
    """Tables of rotation, Sun and Moon made for an arc, nothing known before."""
    case = orbits.problem(20, True)
    recipes = outside.recipes_of(case.model, case.functions, ())
    for name, (seconds, bound) in NODES.items():

        def make(seconds: float = seconds) -> None:
            tabulated._day.cache_clear()
            outside.block_of(recipes, *outside.days(0.0, seconds))

        run = _timed(make, 1)
        value = statistics.median(run() for _ in range(3))
        yield Figure(f"tables for {name}", value * 1e3, "ms", bound=bound * 1e3)


def _derivation() -> Figure:
    """Partials and source of the equations of an orbit, nothing known before."""
    model = orbits.problem(20, True).model

    def made() -> None:
        derive.__wrapped__(model)
        for sensor in model.sensors:
            derive_sensor.__wrapped__(model, sensor)
        model_source(model, pz.RungeKutta4(1).scheme, 1)

    run = _timed(made, 1)
    return Figure("equations derived, and their source", statistics.median(run() for _ in range(5)), "s", bound=2.0)
