"""The one error of the equation language, and the wording it shares: excerpts on one line."""

from __future__ import annotations

from piazzi.text import printable

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
    return f"'{printable(text if len(text) <= QUOTE else text[:QUOTE] + '...')}'"


def _excerpt(text: str, column: int) -> str:
    start = max(0, min(column - 1 - EXCERPT // 2, len(text) - EXCERPT))
    end = start + EXCERPT
    return ("..." if start else "") + printable(text[start:end]) + ("..." if end < len(text) else "")
