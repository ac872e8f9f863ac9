"""Order conditions of Runge-Kutta methods from rooted trees (Butcher 1963; Hairer, Norsett and Wanner I, II.2).

A method has order p if for every rooted tree of up to p nodes the weighted sum over its stages equals 1 / gamma.
"""

from functools import cache
from itertools import combinations_with_replacement

import numpy as np

Tree = tuple  # a node is the tuple of its children, in order


@cache
def forests(nodes: int, largest: int) -> tuple[tuple[Tree, ...], ...]:
    """Multisets of trees with so many nodes together, none with more than `largest`."""
    if nodes == 0:
        return ((),)
    found = []
    for size in range(min(nodes, largest), 0, -1):
        for count in range(1, nodes // size + 1):
            rest = forests(nodes - count * size, size - 1)
            found += [chosen + other for chosen in combinations_with_replacement(trees(size), count) for other in rest]
    return tuple(found)


@cache
def trees(nodes: int) -> tuple[Tree, ...]:
    """Rooted trees with so many nodes: a root and a forest of one node fewer."""
    return forests(nodes - 1, nodes - 1)


def size(tree: Tree) -> int:
    return 1 + sum(map(size, tree))


def gamma(tree: Tree) -> int:
    """Size of the tree times that of all its subtrees."""
    return size(tree) * int(np.prod([gamma(child) for child in tree], dtype=object))


def stages(tree: Tree, A: np.ndarray) -> np.ndarray:
    """Elementary weight of the tree at every stage."""
    out = np.ones(len(A))
    for child in tree:
        out = out * (A @ stages(child, A))
    return out


def defect(a, b, order: int) -> float:
    """Largest violation of the conditions of exactly this order."""
    A = np.zeros((len(b), len(b)))
    for i, row in enumerate(a):
        A[i, : len(row)] = row
    return max(abs(np.asarray(b) @ stages(tree, A) - 1 / gamma(tree)) for tree in trees(order))


def order_of(a, b, most: int = 9, tolerance: float = 1e-12) -> int:
    """Order of the method with these coefficients and weights."""
    order = 0
    while order < most and defect(a, b, order + 1) < tolerance:
        order += 1
    return order
