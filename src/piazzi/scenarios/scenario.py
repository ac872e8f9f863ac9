"""What a scenario file says, read and checked."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from piazzi.problem import Problem
from piazzi.problem.checks import Array


@dataclass(frozen=True)
class Picture:
    """What pictures of a scenario show besides states: radius of the planet at the origin, m, or None for no planet."""

    planet_radius: float | None = None


@dataclass(frozen=True)
class Plan:
    """What a study of a scenario does unless told otherwise.

    Attributes
    ----------
    runs : int, or None
    estimators : as the command line writes them
    vary : what is varied, and the values it takes, as text
    """

    runs: int | None = None
    estimators: tuple[str, ...] = ()
    vary: Mapping[str, tuple[str, ...]] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Scenario:
    """A problem with the times at which it is measured.

    Attributes
    ----------
    name, title : str
    problem : Problem, with its `truth` half
    times : (K,) seconds, increasing
    picture : Picture
    study : Plan
    """

    name: str
    title: str
    problem: Problem
    times: Array
    picture: Picture = field(default_factory=Picture)
    study: Plan = field(default_factory=Plan)
