"""What the forces leave out, in sigma: what each would have moved the orbit by, and what a fit makes of that.

Gravity is the same orbit in a field of twice the degree.  Of every other force, its acceleration along the solution is carried
by the solution's own derivatives: to first order the orbit is another one at each time, by what has been added so far.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from math import ceil
from typing import Any

import numpy as np

from piazzi.determination.analysis import Analysis, of_orbit
from piazzi.determination.setup import Setup, scale_of
from piazzi.determination.sweep import swept
from piazzi.earth import Forces, Gravity
from piazzi.earth.defaults import AIR_BELOW, DRAGGED, REFLECTED, lowest_height
from piazzi.earth.force_options import TIDES
from piazzi.earth.force_text import Force
from piazzi.evaluate.information import singular, whitened
from piazzi.expressions import evaluate_arrays
from piazzi.model.definitions import Hoist, definitions_of, in_order
from piazzi.model.pruning import used_definitions
from piazzi.model.values import with_arrays
from piazzi.problem.checks import Array
from piazzi.problem.inputs import prepare

LARGEST = 120  # degree of the fields of the package
LEAST = 4  # degree that the Earth as a point, or flattened, is compared with
NODES, MOST = 48, 6000  # of a turn, and in all, at which accelerations are added up
BODIES = ("sun", "moon", "venus", "jupiter")
RELATIVITY = ("schwarzschild", "lense-thirring", "de-sitter")
WORDS = {
    "radiation_on": "sunlight", "drag_on": "air", "relativity_on": "relativity", "lense_thirring_on": "frame dragging",
    "de_sitter_on": "de Sitter's precession", **dict(zip(("tides_on", "k1_on", "pole_on"), TIDES.values(), strict=True)),
}  # fmt: skip


def left_out(given: Setup, states: Array, analysis: Analysis, keep: Array) -> dict[str, float]:
    """By how many sigma the solution would move with what is left out, each by its name; empty where that cannot be said.

    The measurements that the solution makes with it differ from those without.  What a fit takes up of that, by the derivatives
    of `analysis`, moves position and velocity: the largest change counts.
    """
    if given.measured.about != "earth" or not given.problem.is_noise_free:
        return {}
    unit = scale_of(given, states[0])
    root = analysis.information(keep, unit)
    if not singular(of_orbit(root))[0][-1] > 1.0:
        return {}
    rows = np.nan_to_num(analysis.rows[keep]).reshape(-1, len(unit)) * unit
    spread = np.linalg.norm(np.linalg.solve(root, np.eye(len(unit))), axis=1)

    def moved(off: Array) -> float:
        turned = np.linalg.solve(root.T, rows.T @ np.nan_to_num(off[keep]).reshape(-1))
        return float(np.max(np.abs(np.linalg.solve(root, turned)[:6]) / spread[:6]))

    found = {name: moved(off) for name, off in (*_gravity(given, states), *_others(given, states, analysis))}
    return dict(sorted(found.items(), key=lambda one: -one[1]))


def words_for(given: Setup, names: Iterable[str]) -> str:
    """What --forces says with these of `left_out` among the forces."""
    own = given.chosen.forces
    lists: dict[str, list[str]] = {"tides": list(own.tides), "bodies": list(own.bodies), "relativity": []}
    lists["relativity"] = list(RELATIVITY[:1] if own.relativity is True else own.relativity or ())
    switches, words = {name: switch for switch, name in WORDS.items()}, dict[str, str]()
    of = {**dict(zip(("tides_on", "k1_on", "pole_on"), TIDES, strict=True)),
          **dict(zip(("relativity_on", "lense_thirring_on", "de_sitter_on"), RELATIVITY, strict=True))}  # fmt: skip
    for name in names:
        switch = switches.get(name, "")
        if name.startswith("gravity"):
            words["degree"] = name.split()[3]
        elif switch in ("radiation_on", "drag_on"):
            words |= {"radiation": "cannonball"} if switch == "radiation_on" else {"drag": "harris-priester"}
        else:
            part = of.get(switch) or name.split()[-1].lower()
            key = next((k for k, known in (("tides", TIDES), ("relativity", RELATIVITY)) if part in known), "bodies")
            lists[key].append(part)
            words[key] = ",".join(lists[key])
    start = "default " if given.chosen.choice.source.startswith("default") else ""
    return start + " ".join(f"{key}={value}" for key, value in words.items())


def _gravity(given: Setup, states: Array) -> Iterator[tuple[str, Array]]:
    """What a larger field changes of whitened measurements (J, m)."""
    field: Any = given.problem.functions.get("field")
    degree = int(field.degree or 0) if isinstance(field, Gravity) else LARGEST
    more = min(max(2 * degree, LEAST), LARGEST, int(field.field.degree)) if isinstance(field, Gravity) else 0
    if more <= degree:
        return
    larger = given.problem.with_data({"field": replace(field, degree=more)})
    inputs, times, step = prepare(given.problem, given.tracking), given.tracking.times, given.chosen.max_step
    with np.errstate(all="ignore"):  # whitened; by the same sensors: the field is the orbit's
        here, there = (
            whitened(given.problem, inputs, swept(problem, times, states[0], step)[0])[0] for problem in (given.problem, larger)
        )
    yield f"gravity to degree {more} instead of {f'degree {degree}' if degree > 1 else 'the Earth as a point'}", here - there


def _others(given: Setup, states: Array, analysis: Analysis) -> Iterator[tuple[str, Array]]:
    """What other forces change of whitened measurements (J, m)."""
    rows = given.tracking.row_times
    t, path, back = carrying(given, states)
    if not t[-1] > t[0]:
        return
    for name, pull in _pulls(given, t, path):
        rate = (back @ pull[:, :, None])[..., 0]
        total = np.vstack([np.zeros(6), np.cumsum(0.5 * (rate[1:] + rate[:-1]) * np.diff(t)[:, None], axis=0)])
        change = np.stack([np.interp(rows, t, total[:, i]) for i in range(6)], axis=1)
        yield name, -np.einsum("jmi,ji->jm", analysis.rows[..., :6], change)


def carrying(given: Setup, states: Array) -> tuple[Array, Array, Array]:
    """Times (K,) close over the measurements, the solution (K, n), and the first state (K, 6, 3) by the velocity then."""
    times = given.tracking.times
    turns = float(times[-1] - times[0]) * given.measured.centre.turning(states[0, :3], states[0, 3:6]) / (2.0 * np.pi)
    count = min(max(ceil(NODES * turns), NODES), MOST)
    t = np.linspace(times[0], times[-1], count + 1)
    if not t[-1] > t[0]:
        return t, states[:1], np.zeros((1, 6, 3))
    path, derivatives = swept(given.problem, t, states[0], given.chosen.max_step)
    back = np.linalg.solve(derivatives[:, :6, :6], np.eye(6)[:, 3:])
    return t, path, back


def _pulls(given: Setup, t: Array, path: Array) -> Iterator[tuple[str, Array]]:
    """Accelerations (K, 3) of forces that there might be, by name."""
    own, choice = given.chosen.forces, given.chosen.choice
    low = lowest_height(path[0, :3], path[0, 3:6]) < AIR_BELOW
    every = Forces(
        gravity=own.field, degree=2, bodies=BODIES, tides=tuple(TIDES), relativity=RELATIVITY, radiation="cannonball",
        drag="harris-priester" if low and not own.drag else False, shadows=own.shadows,
    )  # fmt: skip
    there = {part.switch for part in own.parts if given.problem.parameters.get(part.switch, 1.0)}
    missing = [part for part in every.parts if part.switch not in there]
    if not missing:
        return
    numbers = {**every.values, "cr_a_m": REFLECTED, "cd_a_m": DRAGGED, "t": t}
    numbers |= dict(zip(("x", "y", "z", "vx", "vy", "vz"), path.T[:6], strict=True))
    functions = every.functions(given.measured.epoch, choice.eop, choice.kernel)
    text = used_definitions(every.definitions, [text for part in missing for text in part.acceleration])
    calls = Hoist(functions)
    definitions = definitions_of(text, "forces", calls)
    wanted = in_order((*definitions, *calls.found), "forces")
    values = with_arrays(numbers, {name for d in wanted for name in d.provides}, wanted, functions=functions)
    sums: dict[str, Array] = {}
    for part in missing:
        name = WORDS.get(part.switch, f"the pull of {part.switch.removesuffix('_on').title()}")
        sums[name] = sums.get(name, 0.0) + _pull(part, values, functions, t)
    yield from sums.items()


def _pull(part: Force, values: Any, functions: Any, t: Array) -> Array:
    """Acceleration (K, 3) of a force on the axes of the GCRF."""
    parts = [np.broadcast_to(evaluate_arrays(text, values), t.shape) for text in part.acceleration]
    return np.asarray(functions["free"].arrays(t, *parts) if part.fixed else np.stack(parts, axis=1))
