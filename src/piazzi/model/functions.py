"""What a model knows of a function from outside: how many values it takes and gives, and which derivatives are known."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

AT = "at"  # the state at another instant
ROOT = "root"  # a value that makes an equation zero
STATION_TABLE = "station_table"  # the number of a station that says which table is its own
STATION_TERMS = 12
STATION = "station"  # where the station of the row is: its table is found by a number of the station


@dataclass(frozen=True)
class Signature:
    """The form of a function whose values a kernel fragment computes; the data belong to the `Problem`.

    What is compiled depends on this alone: another date, field or degree has the same signature.

    Parameters
    ----------
    kind : name of the fragment's function, such as "gravity" or "table"
    arguments, outputs : how many numbers it takes and gives
    partials : pairs of output and argument whose derivative is known, by output, then argument; the others are zero
    terms : coefficients of a piece of a table
    code : text of a fragment of the user's own
    transposed : of a rotation, whether the table holds the inverse
    shared : what functions that read the same table have in common
    """

    kind: str
    arguments: int
    outputs: int
    partials: tuple[tuple[int, int], ...]
    terms: int = 0
    code: str = ""
    transposed: bool = False
    shared: str = ""

    @property
    def function(self) -> str:
        """Name of the function in the source of kernels."""
        return f"{self.kind}_{self.outputs}x{self.terms}" if self.terms else self.kind

    @property
    def fragment(self) -> str:
        """Name of the package's fragment that has it."""
        return f"function_{self.kind.partition('_')[0]}"

    @classmethod
    def of_table(cls, columns: int, terms: int) -> Signature:
        """The signature of a table over time, whose columns are all derived by it."""
        return cls("table", 1, columns, tuple((i, 0) for i in range(columns)), terms)

    @classmethod
    def of_station(cls) -> Signature:
        """The signature of a station's own table: position and velocity."""
        return cls.of_table(6, STATION_TERMS)


def signature_of(given: Any, name: str) -> Signature:
    """The signature of a function given as one, or as what has one; raises ValueError for anything else."""
    found = given if isinstance(given, Signature) else getattr(given, "signature", None)
    if not isinstance(found, Signature):
        raise ValueError(f"function {name!r} is {given!r}; it must be a function such as earth.Gravity(...), or its signature")
    return found
