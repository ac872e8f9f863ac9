"""From tracking of any kind to an orbit: one call makes the problem, solves it, tests it and writes it down."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from piazzi.determination.determining import determine
    from piazzi.determination.guesses import Guess, guess_of
    from piazzi.determination.orbit import Orbit
    from piazzi.determination.result import Determination
    from piazzi.determination.sensing import Measured, measured

__all__ = ["Determination", "Guess", "Measured", "Orbit", "determine", "guess_of", "measured"]
_WHERE = {
    "Determination": "result", "Guess": "guesses", "Measured": "sensing", "Orbit": "orbit", "determine": "determining",
    "guess_of": "guesses", "measured": "sensing",
}  # fmt: skip


def __getattr__(name: str) -> Any:  # the command asks for the table of options alone, which needs none of these
    if name not in _WHERE:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_WHERE[name]}"), name)
