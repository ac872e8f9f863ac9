"""Whether the measurements say anything about each direction that the prior left open."""

from __future__ import annotations

import numpy as np

from piazzi.problem import Problem
from piazzi.problem.checks import Array

WIDE = 1e6  # times the size of a value: a prior that wide says that it is not known
UNINFORMED = 0.9  # of the prior's variance: the measurements said nothing


def undetermined(problem: Problem, first: Array, states: Array, last: Array | None = None) -> str:
    """A line naming the direction that a wide prior left open and the measurements did not close, "" if there is none.

    Parameters
    ----------
    problem : Problem
    first : (n, n), covariance of the first state given all measurements
    states : (K, n), estimates, which tell how large each value (each group, as a vector) is
    last : (n, n), optional
        Covariance of the last state, where `first` is given the first measurements only: it tells what the others closed.
        So do dynamics that let the direction shrink: what they take from it counts as closed.
    """
    sigma = np.sqrt(np.diag(problem.covariance))
    if not (sigma > WIDE * np.maximum(np.abs(states[0]), 1.0)).any():  # a lower bound of the sizes, which are dearer
        return ""
    wide = sigma > WIDE * _sizes(problem, states)
    if not wide.any():
        return ""
    direction = _widest_direction(first, sigma, wide)
    if direction is None or (last is not None and _widest_direction(last, sigma, wide) is None):
        return ""
    return f"the measurements do not determine {_words(problem, direction)}: it is as uncertain as the prior left it"


def _widest_direction(covariance: Array, sigma: Array, wide: Array) -> Array | None:
    """The widest direction in units of the prior's sigma, None where the measurements said something about it."""
    if not np.isfinite(covariance).all():
        return None
    unit = np.where(sigma > 0, sigma, 1.0)
    values, vectors = np.linalg.eigh(covariance / np.outer(unit, unit))
    direction: Array = vectors[:, -1]
    return direction if values[-1] > UNINFORMED and wide[np.argmax(np.abs(direction))] else None


def _sizes(problem: Problem, states: Array) -> Array:
    """How large each value is along the way, or the group that it belongs to as a vector; one unit at least."""
    with np.errstate(over="ignore"):
        size = np.maximum(np.abs(states).max(axis=0), np.abs(problem.mean))
        for members in problem.model.group_indices.values():
            columns = list(members)
            size[columns] = np.maximum(size[columns], np.sqrt((states[:, columns] ** 2).sum(axis=1)).max())
    return np.asarray(np.maximum(size, 1.0))


def _words(problem: Problem, direction: Array) -> str:
    """A direction in the names of its states, in units of their prior sigma, the largest first."""
    order = [int(i) for i in np.argsort(-np.abs(direction)) if abs(direction[i]) > 0.1]
    names = problem.model.names
    if len(order) == 1:
        return repr(names[order[0]])
    sign = np.sign(direction[order[0]])
    terms = " ".join(f"{sign * direction[i]:+.2f} {names[i]}" for i in order)
    return f"the combination {terms} (in prior sigmas)"
