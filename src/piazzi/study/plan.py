"""A study: which runs of which estimators at which points of a grid, and how each run is told from all others."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, is_dataclass
from functools import cached_property
from itertools import product
from math import prod
from typing import Any

import numpy as np

from piazzi.estimate.estimator import View, views_of
from piazzi.estimate.registry import parse
from piazzi.estimate.sliding_window import SlidingWindow
from piazzi.problem import Problem
from piazzi.problem.checks import Array
from piazzi.scenarios.write import problem_to_tables
from piazzi.simulation import Rule, check_times, true_problem
from piazzi.study.variations import Axis, Value, estimator_settings, problems_at, read_value, split, variant

SCHEMA = "piazzi.study/1"
MOST_POINTS = 100_000
MOST_ESTIMATES = 10**9
MOST_EPOCHS = 121  # epochs at which every run is kept; scores are over all of them
BOUND_RUNS = 512  # truths that the Cramer-Rao bound is averaged over
_PIECE_BYTES = 8e6  # what is worked on at once stays near the processor


@dataclass(frozen=True, eq=False)
class Plan:
    """Which runs of which estimators; `Study` says what each field is."""

    problem: Problem
    times: Any
    estimators: Any
    runs: int = 100
    seed: int = 0
    vary: Mapping[str, Sequence[Any]] = field(default_factory=dict)
    name: str = ""

    def __post_init__(self) -> None:
        put = object.__setattr__
        put(self, "times", check_times(self.times))
        put(self, "estimators", _named(self.estimators))
        put(self, "vary", {str(k): tuple(map(read_value, v)) for k, v in self.vary.items()})
        for what, value, least in (("runs", self.runs, 1), ("seed", self.seed, 0)):
            if isinstance(value, bool) or value != int(value) or value < least:
                raise ValueError(f"{what} is {value!r}; it must be a whole number of {least} or more")
        if not self.problem.stations:
            raise ValueError("the problem has no stations, so nothing can be measured")
        self._check()

    def _check(self) -> None:
        """Refuse what no run could do, before the first."""
        if self.points > MOST_POINTS or self.estimates > MOST_ESTIMATES:
            sizes = " x ".join(str(len(axis.values)) for axis in self.axes) or "1"
            raise ValueError(
                f"the grid of {sizes} has {self.points:,} points, with {self.runs:,} runs of {self._variant_count:,} "
                f"estimators {self.estimates:,} estimates; at most {MOST_POINTS:,} points and {MOST_ESTIMATES:,} estimates "
                "are allowed"
            )
        assert self.variants  # made now, so that what is wrong with a setting is told now
        for values in {v for axis_index in range(len(self.axes)) for v in self._corners(axis_index)}:
            problems_at(self.problem, self.axes, values)
        actual = true_problem(self.problem)
        Rule(self.problem.truth.accept if self.problem.truth else (), actual)
        for problem in (self.problem, actual):
            problem.intervals(self.times)

    def _corners(self, index: int) -> list[tuple[Value, ...]]:
        """Every value of one axis, with the first of all others."""
        first = [axis.values[0] for axis in self.axes]
        return [(*first[:index], value, *first[index + 1 :]) for value in self.axes[index].values]

    # ---- the grid ------------------------------------------------------------------------------------------------

    @cached_property
    def _split(self) -> tuple[tuple[Axis, ...], tuple[Axis, ...]]:
        return split([Axis(k, tuple(v)) for k, v in self.vary.items()], self.problem, self.estimators)

    @property
    def axes(self) -> tuple[Axis, ...]:
        """What is varied of the problem: a point is one value of each."""
        return self._split[0]

    @cached_property
    def points(self) -> int:
        return prod(len(axis.values) for axis in self.axes)

    @property
    def estimates(self) -> int:
        """How many times something is estimated in all."""
        return self.points * self.runs * self._variant_count

    @cached_property
    def _variant_count(self) -> int:
        """How many estimators there are with all their settings, without making them."""
        settings = [estimator_settings(estimator) for estimator in self.estimators.values()]
        return sum(prod(len(axis.values) for axis in self._split[1] if axis.name in own) for own in settings)

    def point(self, index: int) -> tuple[Value, ...]:
        """Values of the axes at a point, the last axis fastest."""
        out: list[Value] = []
        for axis in reversed(self.axes):
            index, i = divmod(index, len(axis.values))
            out.append(axis.values[i])
        return tuple(reversed(out))

    def problems(self, index: int) -> tuple[Problem, Problem]:
        """The problem as it is, and as it is believed to be, at a point."""
        return problems_at(self.problem, self.axes, self.point(index))

    @cached_property
    def _variants(self) -> dict[str, tuple[Any, str, dict[str, Value]]]:
        """Every estimator with every combination of the settings that are varied and that it has, by its name here.

        With each, the name that it was given and those settings.
        """
        out: dict[str, tuple[Any, str, dict[str, Value]]] = {}
        for name, estimator in self.estimators.items():
            own = [axis for axis in self._split[1] if axis.name in estimator_settings(estimator)]
            for values in product(*(axis.values for axis in own)):
                settings = dict(zip((axis.name for axis in own), values, strict=True))
                if "lag" in settings and getattr(estimator, "lag_seconds", None) is not None:
                    raise ValueError(f"{name} has a length in seconds, so its lag cannot be varied: give it one in states")
                made = variant(estimator, settings) if settings else estimator
                label = _label(name, made, settings)
                if label in out and _described(out[label][0]) != _described(made):
                    raise ValueError(f"two estimators would both be called {label}: vary one at a time, or name them apart")
                out[label] = made, name, settings
        return out

    @cached_property
    def variants(self) -> dict[str, Any]:
        """Every estimator with every combination of the settings that are varied and that it has, by its name here."""
        return {label: made for label, (made, *_) in self._variants.items()}

    @cached_property
    def settings(self) -> dict[str, tuple[str, dict[str, Value]]]:
        """By the name of each estimator here, the name that it was given, and those of its settings that are varied."""
        return {label: (name, settings) for label, (_, name, settings) in self._variants.items() if settings}

    @cached_property
    def rows(self) -> tuple[tuple[str, View], ...]:
        """Name and view of every row of results: a window has two."""
        return tuple((label, view) for label, estimator in self.variants.items() for view in views_of(estimator))

    @cached_property
    def groups(self) -> dict[str, tuple[int, ...]]:
        """Columns of every group of states, or of every state where the model names no groups."""
        model = self.problem.model
        return dict(model.group_indices) or {name: (i,) for i, name in enumerate(model.names)}

    @cached_property
    def kept(self) -> Array:
        """Indices of the epochs at which every run is kept, evenly spaced, first and last among them."""
        K = len(self.times)
        return np.unique(np.linspace(0, K - 1, min(K, MOST_EPOCHS)).round().astype(np.int64))

    @property
    def largest_piece(self) -> int:
        """Runs that are worked on at once, so that memory stays flat."""
        model, S = self.problem.model, len(self.problem.stations)
        numbers = len(self.times) * (2 * model.n + 2 * len(self.groups) + 1 + 3 * S * model.width)
        return int(max(8, _PIECE_BYTES // (8 * numbers)))

    # ---- what it is known by -------------------------------------------------------------------------------------

    @cached_property
    def specification(self) -> dict[str, Any]:
        """Everything that the results depend on, as it is written into the store."""
        return {
            "schema": SCHEMA,
            "name": self.name,
            "runs": int(self.runs),
            "seed": int(self.seed),
            "estimators": {label: _described(e) for label, e in self.variants.items()},
            "vary": {axis.name: list(axis.values) for axis in self.axes},
            "times": hashlib.sha256(self.times.tobytes()).hexdigest(),
            "problem": problem_to_tables(self.problem, whole=not self.problem.checksums),
        }

    @cached_property
    def digest(self) -> str:
        """Hash of the specification."""
        return hashlib.sha256(json.dumps(self.specification, sort_keys=True).encode()).hexdigest()


def _named(given: Any) -> dict[str, Any]:
    """Estimators by name; texts are parsed."""
    pairs = given.items() if isinstance(given, Mapping) else [(str(text).strip(), text) for text in _listed(given)]
    out = {name: parse(estimator) if isinstance(estimator, str) else estimator for name, estimator in pairs}
    if not out:
        raise ValueError("there are no estimators to study")
    return out


def _listed(given: Any) -> Sequence[Any]:
    return [given] if isinstance(given, str) else list(given)


def _label(name: str, estimator: Any, settings: Mapping[str, Value]) -> str:
    """Name of an estimator with settings of its own: as the command line writes it, where it can."""
    plain = isinstance(estimator, SlidingWindow) and estimator == SlidingWindow(estimator.lag, estimator.iterations)
    if plain and name.partition(":")[0] == "window" and {*settings} <= {"lag", "iterations"}:
        times = f"x{estimator.iterations}" if estimator.iterations > 1 else ""
        return f"window:{estimator.lag}{times}"
    return ":".join([name, *(f"{k}={v}" for k, v in settings.items())])


def _described(estimator: Any) -> str:
    kind = type(estimator)
    settings = repr(estimator) if is_dataclass(estimator) else repr(sorted(vars(estimator).items()))
    return f"{kind.__module__}.{kind.__qualname__}: {settings}"
