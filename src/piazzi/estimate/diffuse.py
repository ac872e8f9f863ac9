"""What a wide prior leaves, without a covariance of it: states linearised once, solved beside the chain (see `bordered`)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from piazzi.estimate.bordered import BorderedSolver
from piazzi.estimate.chain import Chain
from piazzi.estimate.width import NOT_BORDERED, TOO_WIDE
from piazzi.problem import Problem
from piazzi.problem.checks import Array
from piazzi.problem.inputs import Inputs, with_prior_node


def smoothed(problem: Problem, inputs: Inputs, states: Array) -> tuple[Array, Array, Array]:
    """Means, covariances and lag-one covariances of all epochs, linearised once about `states` (K, n), whatever the prior.

    Raises
    ------
    ValueError
        Where noise or a manoeuvre moves an estimated constant.
    """
    if not BorderedSolver.applies(problem):
        raise ValueError(f"{TOO_WIDE} beside the noise of the measurements: {NOT_BORDERED}")
    nodes = with_prior_node(inputs)
    skip = nodes.epochs - inputs.epochs
    chain = Chain(problem, nodes)
    solver = BorderedSolver(chain)
    chain.x[:] = solver.begin(np.vstack([problem.mean] * skip + [states]))
    chain.linearize()
    solver.solve(0.0)
    covariance = solver.marginals()
    return (chain.x + chain.dx)[skip:], covariance[skip:], solver.cross()[skip:]


def first_epochs(inputs: Inputs, count: int) -> Inputs:
    """The inputs of the first epochs alone."""
    rows = int(inputs.first_row[count])
    return replace(
        inputs,
        t=inputs.t[:count],
        count=inputs.count[:count],
        scale=inputs.scale[:count],
        first_row=inputs.first_row[: count + 1],
        z=inputs.z[:rows],
        station=inputs.station[:rows],
    )


def last_epochs(inputs: Inputs, start: int) -> Inputs:
    """The inputs from epoch `start` on, with a prior at the epoch before it."""
    row = int(inputs.first_row[start])
    return replace(
        inputs,
        t=inputs.t[start:],
        t_prior=float(inputs.t[start - 1]),
        count=inputs.count[start:],
        scale=inputs.scale[start:],
        first_row=inputs.first_row[start:] - row,
        z=inputs.z[row:],
        station=inputs.station[row:],
    )
