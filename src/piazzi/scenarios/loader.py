"""Scenario files by name or path."""

from __future__ import annotations

import os
import re
import tomllib
from functools import cache
from pathlib import Path
from typing import Any

from piazzi.model import Model
from piazzi.scenarios.faults import Fault, Faults, ScenarioError, shown
from piazzi.scenarios.read import read_scenario
from piazzi.scenarios.scenario import Scenario
from piazzi.sources import opened
from piazzi.text import nearest

FILES = Path(__file__).parent / "files"
TEMPLATE = "template"
MAX_BYTES = 2**18
# TOML takes time in the square of the length of a dotted key
_LONG_KEY = re.compile(rb"(?:[\w\"'-]{1,200}[ \t]{0,20}\.[ \t]{0,20}){30}")
_PLACE = re.compile(r" \(at (line \d+, column \d+|end of document)\)$")


def names() -> list[str]:
    """Names of the built-in scenarios."""
    return sorted(file.stem for file in FILES.glob("*.toml") if file.stem != TEMPLATE)


def show(name: str = TEMPLATE) -> str:
    """The commented text of a built-in scenario, or of "template", to start from; raises ValueError for an unknown name."""
    known = [*names(), TEMPLATE]
    if name not in known:
        raise ValueError(f"unknown scenario {shown(name)}{nearest(name[:60], known)}")
    return (FILES / f"{name}.toml").read_text(encoding="utf-8")


def load_scenario(source: str | os.PathLike[str]) -> Scenario:
    """The scenario of that name, or in the file at that path.

    Raises
    ------
    OSError
        Where the file cannot be read.
    ScenarioError
        (a ValueError) for a file with faults: the message has the first, `faults` all of them.
    ValueError
        For an unknown name, with the nearest.
    """
    text = os.fspath(source)
    if text in (*names(), TEMPLATE):
        return _built_in(text)
    scenario, faults = _read(Path(text))
    if scenario is None:
        raise ScenarioError(text, faults)
    return scenario


def check(source: str | os.PathLike[str]) -> list[Fault]:
    """Everything that is wrong with the scenario of that name or path, each with its place; empty where all is well.

    Raises
    ------
    OSError
        Where the file cannot be read.
    ValueError
        For an unknown name.
    """
    text = os.fspath(source)
    scenario, faults = _read(FILES / f"{text}.toml" if text in (*names(), TEMPLATE) else Path(text))
    return faults if scenario is None or faults else _underivable(scenario.problem.model)


def _underivable(model: Model) -> list[Fault]:
    """What SymPy makes nothing of, or not in time, among equations that are right by themselves."""
    from piazzi.model.derivation import derive, derive_sensor

    faults = Faults()
    with faults.at("dynamics"):
        derive(model)
    for sensor in model.sensors:
        with faults.at(f"sensors.{sensor.name}"):
            derive_sensor(model, sensor)
    return list(faults)


@cache
def _built_in(name: str) -> Scenario:
    scenario, faults = _read(FILES / f"{name}.toml")
    if scenario is None:
        raise ScenarioError(name, faults)
    return scenario


def _read(path: Path) -> tuple[Scenario | None, list[Fault]]:
    if path.suffix != ".toml" and not path.exists():
        hint = nearest(path.name[:60], names())
        raise ValueError(f"there is no file or scenario {shown(os.fspath(path))}{hint}")
    faults = Faults()
    data = _tables(path, faults)
    scenario = read_scenario(data, path.stem, faults) if not faults else None
    return scenario, list(faults)


def _tables(path: Path, faults: Faults) -> dict[str, Any]:
    """The file as plain tables; a fault where it is no TOML."""
    with opened(path) if path.suffix == ".toml" else open(path, "rb") as file:  # <(...) of a shell is a pipe, without ending
        content = file.read(MAX_BYTES + 1)
    if len(content) > MAX_BYTES:
        faults.add("", f"is longer than {MAX_BYTES} bytes, which no scenario is")
        return {}
    long = _LONG_KEY.search(content)
    if long:
        faults.add(f"line {content.count(bytes([10]), 0, long.start()) + 1}", "has a dotted key of more than 30 parts")
        return {}
    try:
        return tomllib.loads(content.decode("utf-8") + "\n")  # so that the end has a line, too
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        faults.add(f"line {line}", f"is not UTF-8 text: byte 0x{content[error.start]:02x}")
    except RecursionError:
        faults.add("", "is nested too deep")
    except ValueError as error:
        place = _PLACE.search(str(error))
        faults.add(place[1] if place else "", f"is not TOML: {_PLACE.sub('', str(error))}")
    return {}
