"""Values beside the orbit against what was known of them before: a prior that the measurements contradict.

Of a linear problem the estimate x and the prior's mean x0 differ by a normal value of covariance P0 - P, the part of the
prior's covariance that the measurements took away: x - x0 is what they say, and is independent of the errors of x.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from piazzi.determination.physical import said_name
from piazzi.determination.setup import Setup
from piazzi.estimate.chi_square import quantile
from piazzi.estimate.estimator import Estimate
from piazzi.evaluate.quantities import number
from piazzi.problem.checks import Array

SURE = 0.999  # that honest values are not called dishonest, of both tests together
LEAST = 0.02  # of a prior's variance, taken away by the measurements: they say nothing of the others
SHOWN = 2  # values by name


@dataclass(frozen=True, eq=False)
class Departures:
    """How far values beside the orbit are from what was known of them before.

    Attributes
    ----------
    names : (p,), of the values of the problem
    sigmas : (p,), differences in their own sigmas, NaN where the measurements say nothing
    squares, freedom : of all of them together
    words : (p,), as users know them
    """

    names: tuple[str, ...]
    sigmas: Array
    squares: float
    freedom: int
    words: tuple[str, ...]

    @property
    def far(self) -> list[int]:
        """Those that are too far by themselves, as many as there are, the farthest first."""
        sizes = np.nan_to_num(np.abs(self.sigmas))
        own = sizes**2 > _most(int(np.isfinite(self.sigmas).sum()))
        return [int(i) for i in np.argsort(-sizes, kind="stable") if own[i]]

    @property
    def contradict(self) -> bool:
        """Whether one of them is too far, or all of them together."""
        return bool(self.far) or bool(self.freedom and self.squares > quantile(1.0 - (1.0 - SURE) / 2.0, self.freedom))

    @property
    def size(self) -> float:
        """How many times as large as expected they are together."""
        return float(np.sqrt(self.squares / max(self.freedom, 1)))

    @property
    def excess(self) -> float:
        """How many times as large as expected they are together, or the farthest as honest ones may be."""
        known = int(np.isfinite(self.sigmas).sum())
        alone = float(np.nanmax(np.abs(self.sigmas))) / float(np.sqrt(_most(known))) if known else 0.0
        return max(self.size, alone)

    @property
    def said(self) -> str:
        """What contradicts what was known before, in words."""
        far = self.far
        if not far:
            size = number(self.size, 2)
            return f"{self.freedom} values beside the orbit are {size} times as far from what was known before as that allows"
        told = [f"{self.words[i]} by {number(abs(float(self.sigmas[i])), 2)}" for i in far[:SHOWN]]
        more = f" and {len(far) - SHOWN} more" if len(far) > SHOWN else ""
        return f"values contradict what was known of them before, in sigma: {', '.join(told)}{more}"


def _most(many: int) -> float:
    """The largest square of so many honest values, by themselves."""
    return float(quantile(1.0 - (1.0 - SURE) / 2.0 / max(many, 1), 1))


def departures(given: Setup, answer: Estimate) -> Departures | None:
    """Those of constants, None where there is none; values that vary as processes, and what is a state of the orbit, aside.

    Where constants are considered a covariance is larger by what they do, which is in the estimate's error, too: then the
    sum of both covariances bounds that of the difference.
    """
    problem = given.problem
    moving = {process.state for process in given.chosen.extra.processes}
    own = [i for i, name in enumerate(problem.model.names) if i >= 6 and name not in moving]
    own = [i for i in own if problem.covariance[i, i] > 0]
    if not own or not np.isfinite(answer.covariance[given.solution]).all():
        return None
    P0, P = (np.asarray(one)[np.ix_(own, own)] for one in (problem.covariance, answer.covariance[given.solution]))
    unit = np.sqrt(np.diag(P0))
    off = (answer.mean[given.solution][own] - problem.mean[own]) / unit
    P0, P = P0 / np.outer(unit, unit), P / np.outer(unit, unit)
    taken, S = P0 - P, P0 + P if problem.considered else P0 - P
    shares, vectors = np.linalg.eigh(0.5 * (taken + taken.T))
    told = shares > LEAST
    along, values = vectors.T @ off, np.einsum("ij,ik,kj->j", vectors, S, vectors)
    sigmas = np.where(np.diag(taken) > LEAST, off / np.sqrt(np.maximum(np.diag(S), LEAST)), np.nan)
    names = tuple(problem.model.names[i] for i in own)
    words = tuple(given.labels[name].words if name in given.labels else said_name(name) for name in names)
    return Departures(names, sigmas, float(np.sum(along[told] ** 2 / values[told])), int(told.sum()), words)
