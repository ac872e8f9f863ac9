"""Everything that is wrong with a scenario, collected with the place of each fault."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, NamedTuple

from piazzi.text import one_line

_BARE = re.compile(r"[A-Za-z0-9_-]{1,60}")


class Fault(NamedTuple):
    """What is wrong, and the TOML path where, such as ``stations[1].noise`` (counted from 0)."""

    path: str
    message: str

    def __str__(self) -> str:
        return f"{self.path}: {self.message}" if self.path else self.message


class ScenarioError(ValueError):
    """A scenario file with something wrong in it: the message has the first fault, `faults` all of them."""

    def __init__(self, source: str, faults: list[Fault]) -> None:
        self.faults = tuple(faults)
        others = f" (and {len(faults) - 1} more: `piazzi scenarios check` lists them)" if len(faults) > 1 else ""
        super().__init__(f"{source}: {faults[0]}{others}")


class Faults(list[Fault]):
    """Faults found so far."""

    def add(self, path: str, message: str) -> None:
        self.append(Fault(path, one_line(message)))

    @contextmanager
    def at(self, path: str) -> Iterator[None]:
        """Record a ValueError of the block as a fault at this path."""
        try:
            yield
        except ValueError as error:
            self.add(path, str(error))


def shown(value: Any) -> str:
    """A value as a message shows it: short, and on one line."""
    if isinstance(value, dict):
        return "a table"
    if isinstance(value, list):
        short = len(value) <= 4 and not any(isinstance(v, dict | list) for v in value)
        return one_line(repr(value)) if short else f"a list of {len(value)}"
    text = repr(value) if not isinstance(value, int) or abs(value) < 10**20 else "a number of more than 20 digits"
    return one_line(text if len(text) <= 60 else text[:57] + "...")


def joined(path: str, key: str | int) -> str:
    """Path of a key or an index below `path`."""
    if isinstance(key, int):
        return f"{path}[{key}]"
    name = key if _BARE.fullmatch(key) else shown(key)
    return f"{path}.{name}" if path else name
