"""What no satellite can have: coefficients below zero."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

POSITIVE = ("cr_a_m", "cd_a_m")  # of sunlight and of air


def physical(given: Any, answer: Any, sentence: Any) -> Any:
    """The sentence on honesty, false where a coefficient came out negative."""
    names, mean = given.problem.model.names, answer.mean[given.solution]
    wrong = [name for name, value in zip(names, mean, strict=True) if name.startswith(POSITIVE) and value < 0.0]
    wrong = [given.labels[name].name if name in given.labels else name for name in wrong if not name.endswith("_change")]
    if not wrong or sentence.ok is False:
        return sentence
    text = f"Not honest: {', '.join(wrong)} came out negative, which no satellite has: the forces do not hold."
    return replace(sentence, ok=False, test=f"{sentence.test}; coefficients are positive", sentence=text)
