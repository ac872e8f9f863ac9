"""Results that are tables and sentences: how they show, print and write themselves."""

from __future__ import annotations

import json
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

from piazzi.evaluate.grids import Grid, as_html, as_rich, as_text
from piazzi.evaluate.latex import as_latex

if TYPE_CHECKING:
    from rich.console import Console, ConsoleOptions


class Tabled:
    """A result that is tables and sentences, the same in a terminal, a notebook, LaTeX and text."""

    def headlines(self) -> Iterable[str]:
        """What is said above them."""
        return ()

    def grids(self) -> list[Grid]:
        """The tables."""
        raise NotImplementedError

    def sentences(self) -> Iterable[str]:
        """What is said below them."""
        raise NotImplementedError

    def to_dict(self) -> dict[str, Any]:
        """All of it, as plain values."""
        raise NotImplementedError

    def to_json(self, indent: int | None = None) -> str:
        """What `to_dict` says as strict JSON, an object of the schema that it names."""
        return json.dumps(self.to_dict(), allow_nan=False, indent=indent)

    def to_latex(self) -> str:
        """Its tables as LaTeX (booktabs), values rounded by their sigmas."""
        return as_latex(self.grids())

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> Iterable[Any]:
        yield from as_rich(self.grids(), self.sentences(), console, options, self.headlines())

    def _repr_html_(self) -> str:
        return as_html(self.grids(), [*self.headlines(), *self.sentences()])

    def __str__(self) -> str:
        return as_text(self)
