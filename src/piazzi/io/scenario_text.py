"""A problem as the text of a scenario, with everything spelled out, which every command loads."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from piazzi.io.atomic import atomic_path
from piazzi.problem import Problem
from piazzi.problem.checks import Array
from piazzi.scenarios.toml_text import toml_text
from piazzi.scenarios.write import problem_to_tables

STEP, COUNT = 60.0, 61  # of times where there are none


def scenario_text(
    problem: Problem, times: Any = None, estimators: Sequence[str] = (), sections: Mapping[str, Any] | None = None
) -> str:
    """TOML of a problem.

    Parameters
    ----------
    problem : what functions from outside are given is written by name, by file, or as numbers
    times : (K,) s, when simulation measures; default an hour from the prior, every minute
    estimators : those that a study compares
    sections : further ones

    Raises
    ------
    ValueError
        For a problem that a file cannot hold, as one with functions that are known in Python only.
    """
    tables: dict[str, Any] = {"title": problem.name} if problem.name else {}
    tables |= _plain_units(problem_to_tables(problem))
    tables["times"] = _times(problem, times)
    if estimators:
        tables["study"] = {"estimators": list(estimators)}
    return toml_text({**tables, **(sections or {})}, ("Written by Piazzi: SI units, every default spelled out.",))


def write_scenario(path: str | os.PathLike[str], problem: Problem, times: Any = None) -> str:
    """Write that text, whole or not at all, and return it; raises ValueError, and OSError where nothing can be written."""
    text = scenario_text(problem, times)
    with atomic_path(path) as work:
        work.write_text(text, encoding="utf-8")
    return text


def _plain_units(tables: dict[str, Any]) -> dict[str, Any]:
    """With "1" for the unit of plain numbers, which a recording leaves empty."""
    sensors = {name: _sensor(sensor) for name, sensor in tables["sensors"].items()}
    parameters = {name: {**of, "unit": of["unit"] or "1"} for name, of in tables["parameters"].items()}
    return tables | {"states": _units(tables["states"]), "parameters": parameters, "sensors": sensors}


def _sensor(sensor: dict[str, Any]) -> dict[str, Any]:
    components = {name: {**of, "unit": of["unit"] or "1"} for name, of in sensor["components"].items()}
    return sensor | {"numbers": _units(sensor["numbers"]), "components": components}


def _units(units: Mapping[str, str]) -> dict[str, str]:
    return {name: unit or "1" for name, unit in units.items()}


def _times(problem: Problem, times: Any) -> dict[str, Any]:
    if times is None:
        start = 0.0 if problem.prior_time is None else float(problem.prior_time)
        return {"start": start, "step": STEP, "count": COUNT}
    t: Array = np.unique(np.asarray(times, dtype=float))
    return {"list": t.tolist()}
