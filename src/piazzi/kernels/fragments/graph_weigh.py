"""The cost of a path under a process noise that was linearised elsewhere."""

from piazzi.kernels.vocabulary import *  # noqa: F403


@entry
@sizes(broken="K N")
def graph_weigh(run: Run, chain: Chain, broken: Array, report: Report) -> None:
    report.defect[0] = 0.0
    weigh_dynamics(run, chain, broken, report)
