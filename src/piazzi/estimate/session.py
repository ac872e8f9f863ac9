"""What live estimates have in common: whether they can be used, checkpoints, and copies that go on by themselves."""

from __future__ import annotations

import copy
from abc import ABC, abstractmethod
from collections.abc import Mapping
from math import isfinite
from typing import Any, ClassVar, Self

import numpy as np

from piazzi.estimate.soundness import defect
from piazzi.problem import Problem
from piazzi.problem.checks import Array
from piazzi.problem.lost_root import lost_root_of


class Session(ABC):
    """An estimate in progress.

    Attributes
    ----------
    success, message : whether every belief is finite with a semidefinite covariance, and no measurement so far found a state
        so open that covariances lose what it leaves; else why not.  Looked at when asked for
    """

    problem: Problem
    _settings: tuple[Any, ...]
    # What copies have and checkpoints need not: nothing to come depends on it
    _shown: ClassVar[tuple[str, ...]] = ("innovation", "innovation_covariance", "_lost")
    mean: Array
    _has_roots: bool  # set with the others: an attribute that comes later makes all of them slower
    _lost = ""  # the first root that was not found

    @property
    @abstractmethod
    def _belief_time(self) -> float | None:
        """Time that the beliefs are for."""

    @abstractmethod
    def _beliefs(self) -> list[tuple[Array, Array]]:
        """Every mean (n,) with its covariance (n, n) that the next call depends on, that to be read first."""

    @abstractmethod
    def _foretold(self, t: float) -> Array:
        """The state (n,) about which a measurement at `t`, the last one, was linearised."""

    def _look_for_root(self, s: int, t: float) -> None:
        """After a measurement of station `s`: note what is lost, the first time that the belief is no number."""
        if not (isfinite(self.mean.item(0)) or self._lost):
            self._lost = lost_root_of(self.problem, s, t, self._foretold(t))

    @abstractmethod
    def _saved_state(self) -> dict[str, Array]:
        """Copies of everything that the next call depends on."""

    @abstractmethod
    def _checked(self, saved: Mapping[str, Array]) -> dict[str, Array]:
        """The same, out of what may be anything; raises ValueError where it does not fit."""

    @abstractmethod
    def _set_state(self, kept: Mapping[str, Array]) -> None:
        """Go on from there."""

    @property
    def success(self) -> bool:
        return not self.message

    @property
    def message(self) -> str:
        means, covariances = zip(*self._beliefs(), strict=True)
        t = self._belief_time
        place = "" if t is None else f"at t = {t:g} s"
        found = defect(np.array(means), np.array(covariances), self.problem.model.names, lambda k: place).rstrip()
        return f"{found}: {self._lost}" if found and self._lost else found or self._why_unusable()

    def _why_unusable(self) -> str:
        """Why beliefs that look good cannot be used, "" where they can."""
        return ""

    def checkpoint(self) -> dict[str, Array]:
        """Everything that the next call depends on, as arrays; `restore` takes it back.

        Raises
        ------
        ValueError
            Where it could not be taken back, because the estimate cannot be used: `message` says why.
        """
        if not self.success:
            raise ValueError(self.message)
        kept = self._saved_state()
        self._checked(kept)
        return kept

    def restore(self, saved: Mapping[str, Array]) -> None:
        """Go on from a checkpoint of the same problem; raises ValueError where it does not fit."""
        self._set_state(self._checked(saved))
        self._lost = ""

    def __reduce__(self) -> tuple[Any, ...]:
        shown = {name: copy.copy(getattr(self, name)) for name in self._shown}
        return type(self), (self.problem, *self._settings), (self._saved_state(), shown)

    def __setstate__(self, state: tuple[dict[str, Array], dict[str, Any]]) -> None:
        kept, shown = state
        self._set_state(kept)
        for name, value in shown.items():
            if isinstance(value, np.ndarray):
                getattr(self, name)[...] = value  # where kernels write to
            else:
                setattr(self, name, value)

    def __deepcopy__(self, memo: dict[int, Any]) -> Self:
        return copy.copy(self)  # shares the problem and the settings, which do not change, and nothing else
