"""Dates of problems and trackings: the instant that times are seconds past, and how far from it they may be."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from piazzi.problem.checks import Array

if TYPE_CHECKING:
    from piazzi.earth import Epoch

FARTHEST = 1e8  # seconds: beyond, a time holds no more than 15 ns


class Timed(Protocol):
    """What has times: a problem, a tracking."""

    @property
    def epoch(self) -> Any: ...


def epoch_given(value: Any) -> Epoch | None:
    """The value as an Epoch, None where there is none; raises ValueError, TypeError for what is no date."""
    if value is None or (isinstance(value, str) and not value.strip()):
        return None
    from piazzi.earth.epoch import Epoch  # only those wait for it who have dates

    return value if isinstance(value, Epoch) else Epoch(value)


def check_near(times: Any, epoch: Epoch | None, what: str) -> None:
    """Raise ValueError where one of these times, with the name of their kind, is far from its epoch."""
    if epoch is None:
        return
    t = np.atleast_1d(np.asarray(times, dtype=float))
    if t.size and np.abs(t).max() >= FARTHEST:
        far = float(t[np.argmax(np.abs(t))])
        raise ValueError(
            f"{what} {far:g} s is {abs(far) / 31557600.0:.3g} years from the epoch, {epoch}; times stay within "
            f"{FARTHEST:g} s of it, so give a nearer epoch"
        )


def check_same(problem: Timed, tracking: Timed) -> None:
    """Raise ValueError where the times of a tracking are past another instant than those of the problem."""
    theirs, ours = tracking.epoch, problem.epoch
    if theirs is not None and ours is not None and theirs != ours:
        raise ValueError(
            f"times of the tracking are past {theirs.exact()}, those of the problem past {ours.exact()}: "
            "tracking.with_epoch(problem.epoch) moves them"
        )


def epoch_of(problem: Timed, tracking: Timed) -> Epoch | None:
    """The instant that times of both are past, None where neither says one."""
    found: Epoch | None = problem.epoch if tracking.epoch is None else tracking.epoch
    return found


def dated(problem: Timed, tracking: Timed) -> dict[str, str]:
    """The epoch as an entry of an object, none where there is none."""
    epoch = epoch_of(problem, tracking)
    return {} if epoch is None else {"epoch": epoch.exact()}


def shifted(times: Array, seconds: tuple[float, float]) -> Array:
    """Times later by whole seconds and a fraction, rounded once."""
    whole = np.floor(times)
    out: Array = (whole + seconds[0]) + ((times - whole) + seconds[1])
    return out
