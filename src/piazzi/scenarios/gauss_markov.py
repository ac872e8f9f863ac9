"""Accelerations that nobody modelled, in a scenario file: how strong they are and how long they last."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from piazzi.problem import Problem, with_gauss_markov
from piazzi.scenarios.equations import Physics
from piazzi.scenarios.manoeuvres import named_states
from piazzi.scenarios.table import Table
from piazzi.units import Units

KEYS = ("sigma", "time_constant", "states")


@dataclass(frozen=True)
class GaussMarkov:
    """States whose rates wander, by how much in SI, and for how many seconds."""

    states: Sequence[str]
    sigma: Sequence[float]
    time_constant: float

    def added_to(self, problem: Problem) -> Problem:
        """The problem with these disturbances; raises ValueError where it cannot have them."""
        return with_gauss_markov(problem, self.sigma, self.time_constant, self.states)


def read_gauss_markov(table: Table, physics: Physics, units: Units) -> GaussMarkov | None:
    """What the section [gauss_markov] says; None after noting every fault."""
    for key in KEYS[:2]:
        if table.raw(key) is None:
            table.fault(key, "is missing")
    states = named_states(table, physics)
    constant = table.number("time_constant", units.time(), positive=True)
    sigma = _sigma(table, states)
    table.finish(KEYS)
    if not states or sigma is None or constant is None:
        return None
    return GaussMarkov(
        tuple(states), [s * f / units.time() for s, f in zip(sigma, physics.factors(states), strict=True)], constant
    )


def _sigma(table: Table, states: Sequence[str]) -> list[float] | None:
    """One number for all states, or one for each."""
    given = table.raw("sigma")
    if isinstance(given, list | dict):
        vector = table.vector("sigma", states) if states else None
        return None if vector is None else vector.tolist()
    number = table.number("sigma", positive=True)
    return None if number is None else [number] * len(states)
