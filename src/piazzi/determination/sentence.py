"""A sentence of the verdict."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from piazzi.evaluate.quantities import finite


@dataclass(frozen=True)
class Sentence:
    """Whether it is so (None: there was nothing to test with), the figure, how it was tested, and the words."""

    ok: bool | None
    figure: float | None
    test: str
    sentence: str

    def to_dict(self) -> dict[str, Any]:
        """As JSON has it."""
        return {"ok": self.ok, "figure": finite(self.figure), "test": self.test, "sentence": self.sentence}
