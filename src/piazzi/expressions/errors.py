"""The one error of the equation language, and the wording it shares: excerpts on one line, and the nearest valid name."""

from __future__ import annotations

from collections.abc import Iterable

EXCERPT = 60
QUOTE = 24


class ExpressionError(ValueError):
    """An equation was refused; its one-line message says where, in which text, and what was wrong.

    Parameters
    ----------
    problem : str
        What was wrong, on one line.
    text : str
        The whole equation.
    column : int
        Where in `text`, counted from 1.
    """

    def __init__(self, problem: str, text: str, column: int = 1) -> None:
        super().__init__(problem, text, column)  # these are also what pickle calls the class with
        self.problem = problem
        self.text = text
        self.column = column

    def __str__(self) -> str:
        """Return the message: one printable line, whatever the text holds."""
        return f"column {self.column} of '{_excerpt(self.text, self.column)}': {self.problem}"


def quote(text: str) -> str:
    """Return `text` in quotes, escaped and short enough to stand inside a message."""
    return f"'{_escape(text if len(text) <= QUOTE else text[:QUOTE] + '...')}'"


def suggest(name: str, valid: Iterable[str]) -> str:
    """Return "; did you mean ...?" with the valid name nearest to `name`, or nothing when none is near."""
    import difflib

    folded = {candidate.casefold(): candidate for candidate in sorted(valid)}
    near = difflib.get_close_matches(name.casefold(), folded, n=1)
    return f"; did you mean {quote(folded[near[0]])}?" if near else ""


def _excerpt(text: str, column: int) -> str:
    start = max(0, min(column - 1 - EXCERPT // 2, len(text) - EXCERPT))
    end = start + EXCERPT
    return ("..." if start else "") + _escape(text[start:end]) + ("..." if end < len(text) else "")


def _escape(text: str) -> str:
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode("ascii") for c in text)
