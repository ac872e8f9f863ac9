"""What the forces leave out, in sigma: the same orbit in a field of twice the degree, and what a fit would make of that."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from piazzi.determination.analysis import Analysis, of_orbit
from piazzi.determination.setup import Setup, follow, scale_of
from piazzi.earth import Gravity
from piazzi.evaluate.information import along, singular
from piazzi.problem.checks import Array
from piazzi.problem.inputs import prepare

LARGEST = 120  # degree of the fields of the package
LEAST = 4  # degree that the Earth as a point, or flattened, is compared with


def truncated(given: Setup, states: Array, analysis: Analysis, keep: Array) -> tuple[int, int, float] | None:
    """Degree, the larger one, and by how many sigma the solution would move with it; None where there is no such field.

    The measurements that the first of `states` (K, n) makes in the larger field differ from those it makes in its own.
    What a fit takes up of that, by the derivatives of `analysis`, moves position and velocity: the largest change counts.
    """
    field: Any = given.problem.functions.get("field")
    if not isinstance(field, Gravity) or not given.problem.is_noise_free:
        return None
    degree = int(field.degree or 0)
    more = min(max(2 * degree, LEAST), LARGEST, int(field.field.degree))
    if more <= degree:
        return None
    larger = replace(given.problem, functions={**given.problem.functions, "field": replace(field, degree=more)})
    unit = scale_of(given, states[0])
    root = analysis.information(keep, unit)
    if not singular(of_orbit(root))[0][-1] > 1.0:
        return None
    inputs, times, step = prepare(given.problem, given.tracking), given.tracking.times, given.chosen.max_step
    with np.errstate(all="ignore"):  # whitened; by the same sensors: the field is the orbit's
        here, there = (
            along(given.problem, inputs, follow(problem, times, states[0], step)[0]).innovations
            for problem in (given.problem, larger)
        )
    off = (here - there)[keep]
    rows = np.nan_to_num(analysis.rows[keep]).reshape(-1, len(unit)) * unit
    turned = np.linalg.solve(root.T, rows.T @ np.nan_to_num(off).reshape(-1))
    change = np.linalg.solve(root, turned)
    spread = np.linalg.norm(np.linalg.solve(root, np.eye(len(unit))), axis=1)
    return degree, more, float(np.max(np.abs(change[:6]) / spread[:6]))
