"""What a model knows of a function from outside: how many values it takes and gives, and which derivatives are known."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any


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
    """

    kind: str
    arguments: int
    outputs: int
    partials: tuple[tuple[int, int], ...]
    terms: int = 0
    code: str = ""

    @property
    def function(self) -> str:
        """Name of the function in the source of kernels."""
        return f"{self.kind}_{self.outputs}x{self.terms}" if self.terms else self.kind


def signature_of(given: Any, name: str) -> Signature:
    """The signature of a function given as one, or as what has one; raises ValueError for anything else."""
    found = given if isinstance(given, Signature) else getattr(given, "signature", None)
    if not isinstance(found, Signature):
        raise ValueError(f"function {name!r} is {given!r}; it must be a function such as earth.Gravity(...), or its signature")
    return found
