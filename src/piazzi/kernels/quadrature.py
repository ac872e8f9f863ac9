"""Lobatto's rules: positive weights, so that integrals of semidefinite matrices are semidefinite."""

from __future__ import annotations

from itertools import pairwise
from math import sqrt


def lobatto(order: int) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Nodes and weights on [0, 1], both ends included, of the rule whose error falls with the power `order`: 6, 8 or 10."""
    middle = {6: sqrt(1 / 5), 8: sqrt(3 / 7), 10: sqrt(1 / 3 - 2 * sqrt(7) / 21)}[order]
    far = sqrt(1 / 3 + 2 * sqrt(7) / 21)
    half = {  # pairs of nodes +-x on [-1, 1] and their weights, from the ends inwards
        6: ((1.0, 1 / 6), (middle, 5 / 6)),
        8: ((1.0, 1 / 10), (middle, 49 / 90)),
        10: ((1.0, 1 / 15), (far, (14 - sqrt(7)) / 30), (middle, (14 + sqrt(7)) / 30)),
    }[order]
    centre = ((0.0, 32 / 45),) if order == 8 else ()
    pairs = [*((-x, w) for x, w in half), *centre, *((x, w) for x, w in reversed(half))]
    return tuple(0.5 * (1 + x) for x, _ in pairs), tuple(0.5 * w for _, w in pairs)


def noise_order(stages: int) -> int:
    """Order of the rule that integrates noise along steps of so many stages: at least the highest that they can reach.

    An explicit method has order s - 1 at most from 5 stages, s - 2 from 8, s - 3 from 10 (Butcher).
    """
    return 4 if stages <= 5 else 6 if stages <= 8 else 8 if stages <= 12 else 10


def rule_source(order: int) -> str:
    """Constants of the rule: its gaps between nodes, the weight at the start and at the end of each gap; "" for Simpson's."""
    if order == 4:
        return ""
    nodes, weights = lobatto(order)
    gaps = tuple(b - a for a, b in pairwise(nodes))
    return f"GAPS = {len(gaps)}\nGAP = {gaps!r}\nNODE = {nodes!r}\nWEIGHT = {weights!r}\n\n\n"
