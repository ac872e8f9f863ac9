"""Six sentences on a determination, each with the test behind it."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from piazzi.arrays import distinct
from piazzi.determination.analysis import Analysis, of_orbit
from piazzi.determination.completeness import left_out, words_for
from piazzi.determination.faults import Faults
from piazzi.determination.holding import Held
from piazzi.determination.honesty import honest
from piazzi.determination.sentence import Sentence
from piazzi.determination.setup import WIDE, Setup, scale_of
from piazzi.estimate.estimator import Estimate
from piazzi.evaluate.information import singular
from piazzi.evaluate.judgement import APART, NEAR
from piazzi.evaluate.metrics import apart
from piazzi.evaluate.quantities import number
from piazzi.orbit import state_axes
from piazzi.problem.checks import Array
from piazzi.text import counted

KEYS = ("seen", "alone", "converged", "honest", "agreed", "complete")
DECISIVE = KEYS[:3]
TOLD = 3  # forces that are left out, the largest
UNLIKELY = 0.01  # of another orbit that fits
STILL = 1e-2  # sigma of a last step
AXES = (
    "radial position",
    "along-track position",
    "cross-track position",
    "radial velocity",
    "along-track velocity",
    "cross-track velocity",
)


def verdict(
    given: Setup,
    name: str,
    estimates: Mapping[str, Estimate],
    analysis: Analysis | None,
    keep: Array,
    faults: Faults,
    held: Held | None = None,
) -> dict[str, Sentence]:
    """The six of an answer, that of the first estimate; `held` is what became of rows that were held back."""
    answer = estimates[name]
    return dict(
        zip(
            KEYS,
            (
                seen(given, analysis, keep),
                alone(given),
                converged(given, answer, analysis, keep),
                honest(given, answer, analysis, keep, faults, held),
                agreed(given, name, estimates),
                complete(given, answer, analysis, keep),
            ),
            strict=True,
        )
    )


def seen(given: Setup, analysis: Analysis | None, keep: Array) -> Sentence:
    """Whether the measurements alone determine the six values of the orbit."""
    test = (
        f"smallest singular value of the information without the prior, in units of {WIDE:.0%} of distance and speed, above 1"
    )
    if analysis is None:
        return Sentence(None, None, test, "Seen: the fit gave no orbit to ask this of.")
    scale = scale_of(given, given.states[0])
    root = analysis.information(keep, scale)
    values, directions = singular(of_orbit(root))
    smallest, weakest = float(values[-1]), directions[-1] * scale[:6]
    many = int(np.isfinite(analysis.whitened[keep]).sum())
    words = _direction(given.states[0], weakest)
    means = f"{many} measurements" + (f" and {given.earlier.source}" if given.earlier else " alone")
    if not smallest > 1.0:
        blind = int((values <= 1.0).sum())
        return Sentence(
            False, smallest, test,
            f"Not seen: {means.removesuffix(' alone')} leave {blind} of {len(values)} directions as open as the guess, "
            f"the widest {words}.",
        )  # fmt: skip
    words, size = _widest(given.states[0], root, scale)
    return Sentence(
        True, smallest, test,
        f"Seen: {means} determine the orbit, at its start to {_metres(size)} in the widest axis, {words}.",
    )  # fmt: skip


def _widest(state: Array, root: Array, scale: Array) -> tuple[str, float]:
    """The direction in which the first position is known worst, and its sigma (m)."""
    inverse = np.linalg.solve(root, np.eye(len(scale)))[:3] * scale[:3, None]
    values, vectors = np.linalg.eigh(inverse @ inverse.T)
    local = state_axes(state[:3], state[3:6])[:3, :3] @ vectors[:, -1]
    return AXES[int(np.argmax(np.abs(local)))].partition(" ")[0], float(np.sqrt(max(values[-1], 0.0)))


def _direction(state: Array, change: Array) -> str:
    """The largest component of a change of position and velocity along the axes of the orbit."""
    local = state_axes(state[:3], state[3:6]) @ change
    share = np.abs(local) / np.repeat([np.linalg.norm(state[:3]), np.linalg.norm(state[3:6])], 3)
    return AXES[int(np.argmax(share))] if np.isfinite(share).all() else "unknown"


def alone(given: Setup) -> Sentence:
    """Whether another orbit gives the same measurements."""
    test = "two fixes of position or more leave one orbit"
    wide = [len(s.noise) >= 3 and s.sensor.startswith("position") for s in given.problem.stations]
    fixed = np.array(wide)[given.tracking.stations_of(given.problem)] & np.isfinite(given.tracking.values).any(axis=1)
    if distinct(given.tracking.row_times[fixed]).size >= 2:
        return Sentence(True, 0.0, test, "Alone: positions were measured directly, so no other orbit fits them.")
    if given.guess.orbits is None:
        return Sentence(None, None, test, "Alone: twins were not looked for.")
    modes = given.guess.orbits.modes
    others = float(sum(mode.probability for mode in modes[1:]))
    test = f"all orbits that fit, from {given.guess.orbits.starts} starts"
    if others <= UNLIKELY:
        return Sentence(True, others, test, f"Alone: no other orbit that fits has a probability above {UNLIKELY:g}.")
    more = counted(len(modes) - 1, "other orbit")
    return Sentence(False, others, test, f"Not alone: {more} fit, with a probability of {number(others, 2)} together.")


def converged(given: Setup, answer: Estimate, analysis: Analysis | None, keep: Array) -> Sentence:
    """Whether another step would go nowhere, and the estimator ended well."""
    test = f"the estimator's own criterion, and a last step below {STILL:g} sigma"
    if not answer.success:
        return Sentence(False, None, test, f"Not converged: {answer.message}.")
    if analysis is None or answer.view != "delayed" or not given.problem.is_noise_free or "weights" in answer.details:
        return Sentence(True, None, test, f"Converged: the estimator ended after {counted(answer.iterations, 'iteration')}.")
    scale = scale_of(given, given.states[0])
    left = analysis.toward(keep, analysis.information(keep, scale), scale)[1]
    if not left <= STILL:
        return Sentence(False, left, test, f"Not converged: another step would go {number(left, 2)} sigma.")
    return Sentence(
        True,
        left,
        test,
        f"Converged: after {counted(answer.iterations, 'iteration')} another step would go {number(left, 1)} sigma.",
    )


def complete(given: Setup, answer: Estimate, analysis: Analysis | None, keep: Array) -> Sentence:
    """Whether what the forces leave out would move the orbit."""
    test = "largest change of a state of the solution in sigma, with twice the degree of gravity or a force left out, up to 1"
    none = Sentence(None, None, test, "Complete: what the forces leave out is not weighed against sigma here.")
    if analysis is None or answer.view != "delayed" or not answer.success:
        return none
    found = left_out(given, answer.mean, analysis, keep)
    if not found:
        return none
    worst = max(found.values())
    said = [f"{name} by {number(moved, 2)}" for name, moved in found.items()]
    large = [name for name, moved in found.items() if moved > 1.0]
    if large:
        words = f"{', '.join(said[: len(large)])}: --forces '{words_for(given, large)}'"
        return Sentence(False, worst, test, f"Not complete: the solution would move, in sigma, with {words}.")
    return Sentence(True, worst, test, f"Complete: the solution would move, in sigma, with {', '.join(said[:TOLD])}.")


def agreed(given: Setup, name: str, estimates: Mapping[str, Estimate]) -> Sentence:
    """Whether the other estimators say the same."""
    test = f"largest difference of a state in sigma: up to {NEAR:g} of all measurements, {APART:g} of its own in real time"
    others = {other: e for other, e in estimates.items() if other != name}
    if not others:
        return Sentence(None, None, test, "Agreed: only one estimator was asked; --with names more.")
    k, answer = given.solution, estimates[name]
    apart: dict[str, float] = {}
    wrong: list[str] = []
    for other, estimate in others.items():
        off = apart_by(answer, estimate, k)
        apart[other] = off
        limit = NEAR if estimate.view == answer.view == "delayed" else APART
        if not (estimate.success and off <= limit):
            wrong.append(f"{other} {'failed' if not estimate.success else f'is {number(off, 2)} sigma off'}")
    worst = max(apart.values(), key=lambda v: v if np.isfinite(v) else np.inf)
    if wrong:
        return Sentence(False, worst, test, f"Not agreed: {', '.join(wrong)}.")
    return Sentence(True, worst, test, f"Agreed: {', '.join(others)} within {number(worst, 2)} sigma.")


def apart_by(answer: Estimate, other: Estimate, k: int) -> float:
    """The largest difference of a state of the orbit at an epoch, in sigma; see `apart`."""
    return apart(answer, other, k, 6)


def _metres(value: float) -> str:
    return f"{number(value / 1e3, 2)} km" if value >= 1e3 else f"{number(value, 2)} m"
