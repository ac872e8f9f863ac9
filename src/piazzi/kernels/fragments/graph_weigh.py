"""The cost of a path under a process noise that was linearised elsewhere."""

from piazzi.kernels.vocabulary import *  # noqa: F403


@entry
def graph_weigh(
    K: int, scale: Array, Q: Array, x: Array, f: Array, Q_all: Array, tether: Array, broken: Array, report: Array
) -> None:
    L, D, y = scratch(NN), scratch(N), scratch(N)
    report[3] = 0.0
    weigh_dynamics(K, scale, Q_matrix(Q), x, f, Q_all, tether, L, D, y, broken, report)
