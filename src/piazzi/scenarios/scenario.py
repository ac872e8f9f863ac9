"""What a scenario file says, read and checked."""

from __future__ import annotations

from dataclasses import dataclass, field

from piazzi.problem import Problem
from piazzi.problem.checks import Array


@dataclass(frozen=True)
class Picture:
    """What pictures of a scenario show besides states: radius of the planet at the origin, m, or None for no planet."""

    planet_radius: float | None = None


@dataclass(frozen=True, eq=False)
class Scenario:
    """A problem with the times at which it is measured.

    Attributes
    ----------
    name, title : str
    problem : Problem, with its `truth` half
    times : (K,) seconds, increasing
    picture : Picture
    """

    name: str
    title: str
    problem: Problem
    times: Array
    picture: Picture = field(default_factory=Picture)
