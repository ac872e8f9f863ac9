"""Tables of a scenario file, read key by key: values are checked as they are read, and every fault is kept with its place."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from math import isfinite
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from piazzi.problem.checks import Array
from piazzi.text import nearest, one_line, shown

_BARE = re.compile(r"[A-Za-z0-9_-]{1,60}")
MAX_TABLES = 1000
MAX_TEXTS = 100
MAX_UNKNOWN = 50


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
    """Faults found so far, in a file of this folder."""

    folder = Path()

    def add(self, path: str, message: str) -> None:
        self.append(Fault(path, one_line(message)))

    @contextmanager
    def at(self, path: str) -> Iterator[None]:
        """Record a ValueError of the block as a fault at this path."""
        try:
            yield
        except ValueError as error:
            self.add(path, str(error))


def joined(path: str, key: str | int) -> str:
    """Path of a key or an index below `path`."""
    if isinstance(key, int):
        return f"{path}[{key}]"
    name = key if _BARE.fullmatch(key) else shown(key)
    return f"{path}.{name}" if path else name


class Table:
    """One table with its path.  Readers return None (or what is empty) where there is nothing usable, after noting why."""

    def __init__(self, data: Mapping[str, Any], path: str, faults: Faults) -> None:
        # TOML has no null; where the tables come from JSON, it means that the key is not there
        self.data = {key: value for key, value in data.items() if value is not None}
        self.path, self.faults = path, faults
        self._read: set[str] = set()

    def __contains__(self, key: str) -> bool:
        return key in self.data

    def at(self, key: str | int) -> str:
        """Path of a key."""
        return joined(self.path, key)

    def fault(self, key: str, message: str) -> None:
        self.faults.add(self.at(key) if key else self.path, message)

    def raw(self, key: str) -> Any:
        """The value as it is, None where there is none; the key counts as read."""
        self._read.add(key)
        return self.data.get(key)

    def finish(self, known: Collection[str] = ()) -> None:
        """Note every key that was neither read nor is known."""
        valid = sorted({*self._read, *known})
        unknown = [key for key in self.data if key not in valid]
        for key in unknown[:MAX_UNKNOWN]:
            self.fault(key, f"unknown key{nearest(key[:60], valid)}")
        if len(unknown) > MAX_UNKNOWN:
            self.fault("", f"has {len(unknown) - MAX_UNKNOWN} more unknown keys")

    # ---- single values -------------------------------------------------------------------------------------------

    def text(self, key: str, default: str | None = None, choices: Sequence[str] = ()) -> str | None:
        value = self.raw(key)
        if value is None:
            return default
        if not isinstance(value, str):
            self.fault(key, f"must be text in quotes, not {shown(value)}")
            return None
        if choices and value not in choices:
            self.fault(key, f"is {shown(value)}{nearest(value[:60], choices)}")
            return None
        return value

    def flag(self, key: str, default: bool | None = None) -> bool | None:
        value = self.raw(key)
        if value is not None and not isinstance(value, bool):
            self.fault(key, f"must be true or false, not {shown(value)}")
            return default
        return default if value is None else value

    def number(self, key: str, factor: float = 1.0, *, positive: bool = False) -> float | None:
        """The number times `factor`."""
        value = self.raw(key)
        if value is None:
            return None
        out = number(value)
        if out is None or not isfinite(out * factor):
            self.fault(key, f"must be a finite number, not {shown(value)}")
            return None
        if positive and out <= 0:
            self.fault(key, f"is {out:g}; it must be positive")
            return None
        return out * factor

    def whole(self, key: str) -> int | None:
        value = self.raw(key)
        if value is None:
            return None
        if isinstance(value, bool) or not isinstance(value, int) or not 1 <= value <= 10**9:
            self.fault(key, f"must be a whole number of 1 or more, not {shown(value)}")
            return None
        return value

    def texts(self, key: str) -> tuple[str, ...]:
        """One text, or a list of them."""
        value = self.raw(key)
        texts = [] if value is None else value if isinstance(value, list) else [value]
        if not all(isinstance(text, str) for text in texts) or len(texts) > MAX_TEXTS:
            self.fault(key, f"must be text, or a list of at most {MAX_TEXTS} texts, not {shown(value)}")
            return ()
        return tuple(texts)

    # ---- tables --------------------------------------------------------------------------------------------------

    def table(self, key: str) -> Table:
        """The table of that key, an empty one where there is none."""
        value = self.raw(key)
        if value is not None and not isinstance(value, Mapping):
            self.fault(key, f"must be a table, not {shown(value)}")
        return Table(value if isinstance(value, Mapping) else {}, self.at(key), self.faults)

    def tables(self) -> Iterator[tuple[str, Table]]:
        """Every key with its table; a value that is no table is a fault."""
        for key in list(self.data)[:MAX_TABLES]:
            yield key, self.table(key)
        if len(self.data) > MAX_TABLES:
            self.fault("", f"has {len(self.data)} entries; at most {MAX_TABLES} are allowed")

    def array(self, key: str) -> list[Table]:
        """The array of tables of that key."""
        value = self.raw(key)
        if value is None:
            return []
        if not isinstance(value, list) or not all(isinstance(v, Mapping) for v in value):
            self.fault(key, f"must be an array of tables: write [[{key}]] before each of them")
            return []
        if len(value) > MAX_TABLES:
            self.fault(key, f"has {len(value)} entries; at most {MAX_TABLES} are allowed")
        return [Table(v, joined(self.at(key), i), self.faults) for i, v in enumerate(value[:MAX_TABLES])]

    # ---- many numbers --------------------------------------------------------------------------------------------

    def vector(self, key: str, names: Sequence[str], *, missing: float | None = None) -> Array | None:
        """One number for each name: a list in their order, or a table by name (where `missing` stands for those left out)."""
        value = self.raw(key)
        if value is None:
            return None
        if isinstance(value, Mapping):
            return self._by_name(key, value, names, missing)
        items = value if isinstance(value, list) else [value]
        if len(items) != len(names):
            self.fault(key, f"has {len(items)} value{'s' * (len(items) != 1)}; it needs {len(names)}{_for(names)}")
            return None
        return self._finite(self.at(key), list(zip(range(len(names)), items, strict=True)))

    def _by_name(self, key: str, value: Mapping[str, Any], names: Sequence[str], missing: float | None) -> Array | None:
        inner = Table(value, self.at(key), self.faults)
        inner.finish(names)
        absent = [name for name in names if name not in value]
        if absent and missing is None:
            self.fault(key, f"has no value for {absent[0]!r}{_for(names)}")
            return None
        return self._finite(inner.path, [(name, value.get(name, missing)) for name in names])

    def _finite(self, path: str, items: Sequence[tuple[str | int, Any]]) -> Array | None:
        out = [number(value) for _, value in items]
        for (key, value), n in zip(items, out, strict=True):
            if n is None:
                self.faults.add(joined(path, key), f"must be a finite number, not {shown(value)}")
        return None if None in out else np.array(out, dtype=float)

    def matrix(self, key: str, names: Sequence[str]) -> Array | None:
        """A square matrix, rows and columns in the order of the names."""
        value, n = self.raw(key), len(names)
        if value is None:
            return None
        if not isinstance(value, list) or len(value) != n or not all(isinstance(row, list) and len(row) == n for row in value):
            self.fault(key, f"must be {n} lists of {n} numbers{_for(names)}, not {shown(value)}")
            return None
        rows = [self._finite(joined(self.at(key), i), list(enumerate(row))) for i, row in enumerate(value)]
        return None if any(row is None for row in rows) else np.array(rows, dtype=float).reshape(n, n)


def number(value: Any) -> float | None:
    """The value as a finite float, None where it is none."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    try:
        out = float(value)
    except OverflowError:
        return None
    return out if isfinite(out) else None


def _for(names: Sequence[str]) -> str:
    return f" ({', '.join(names[:12])}{', ...' if len(names) > 12 else ''})"
