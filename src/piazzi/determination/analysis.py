"""What a solution leaves of the measurements, and what the measurements alone know of it."""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil

import numpy as np

from piazzi.determination.orbit import root_of
from piazzi.determination.setup import Setup, follow
from piazzi.determination.sweep import swept
from piazzi.evaluate.information import NEGLIGIBLE, along, factor, predicted, whitened
from piazzi.problem import Problem
from piazzi.problem.checks import Array
from piazzi.problem.inputs import Inputs, prepare, wrapped
from piazzi.text import brief


@dataclass(frozen=True, eq=False)
class Analysis:
    """Residuals at a solution and their derivatives.

    Attributes
    ----------
    residual : (J, m), observed minus computed, SI, along an angle on the sky; NaN where there is none
    computed : (J, m), what the solution makes of the measurements, an angle within half a turn of what was observed
    whitened : (J, m), the same in units of the noise, components of a row made independent
    rows : (J, m, n), minus the derivatives of `whitened` by the first state and the constants
    prior : (p, n), rows that the priors of the constants are worth, or an orbit that was known before
    prior_miss : (p,), how far the solution is from those priors, in their sigmas
    """

    residual: Array
    computed: Array
    whitened: Array
    rows: Array
    prior: Array
    prior_miss: Array

    __repr__ = brief

    def information(self, keep: Array, scale: Array) -> Array:
        """Root (n, n) of the information of the rows to keep (J,) and of priors of constants, in units of `scale`."""
        n = self.rows.shape[2]
        own = np.nan_to_num(self.rows[keep]).reshape(-1, n)
        return factor(np.vstack([own, self.prior]) * scale)

    def leverage(self, root: Array, scale: Array) -> Array:
        """(J, m, m) whitened H P H^T of every row, with P the covariance that has this root of its information."""
        solved = np.linalg.solve(root.T, (np.nan_to_num(self.rows).reshape(-1, len(scale)) * scale).T).T
        blocks = solved.reshape(self.rows.shape)
        return np.asarray(blocks @ np.swapaxes(blocks, 1, 2))

    def toward(self, keep: Array, root: Array, scale: Array) -> tuple[Array, float]:
        """The next step (n,) of Gauss and Newton in directions that are seen, in units of `scale`; its length in sigma."""
        n = self.rows.shape[2]
        whitened = np.nan_to_num(self.whitened[keep]).reshape(-1)
        J = np.vstack([np.nan_to_num(self.rows[keep]).reshape(-1, n), self.prior]) * scale
        gradient = J.T @ np.concatenate([whitened, self.prior_miss])
        turned = np.linalg.lstsq(root.T, gradient, rcond=NEGLIGIBLE)[0]
        return np.linalg.lstsq(root, turned, rcond=NEGLIGIBLE)[0], float(np.linalg.norm(turned))


def of_orbit(root: Array) -> Array:
    """Root (6, 6) of the information on position and velocity where nothing but `root` is known of what stands behind them."""
    whole = np.asarray(np.linalg.qr(np.hstack([root[:, 6:], root[:, :6]]), mode="r"))
    return whole[-6:, -6:]


def analysed(given: Setup, states: Array, derivatives: Array | None = None) -> Analysis:
    """Of states (K, n) at all epochs, as one orbit without process noise; `derivatives` (K, n, n) are by the first of them."""
    problem = given.problem
    if not problem.is_noise_free:
        from piazzi.estimate.batch import undisturbed

        problem = undisturbed(problem)
    inputs = prepare(problem, given.tracking)
    with np.errstate(all="ignore"):
        innovations, rows = _seen(problem, inputs, states, derivatives, given.chosen.max_step)
        computed = predicted(problem, inputs, states)
    stations = given.tracking.stations_of(problem)
    sigma = np.sqrt(np.diagonal(problem.station_noise, axis1=1, axis2=2))[stations]
    full = problem.station_correlated[stations].astype(np.bool_)[:, None]
    # along an angle on the sky, as kernels have it; of components with a full covariance whitened ones are mixed
    apart = wrapped(problem, stations, inputs.z - computed)
    residual = np.where(full, apart, innovations * sigma)
    if given.before is not None:
        return Analysis(residual, inputs.z - apart, innovations, rows, *_known_before(given, given.before, states[0]))
    constants = 6  # and processes, of which as much is known
    spread = np.sqrt(np.diag(problem.covariance))[constants:]
    known = np.flatnonzero(spread > 0)
    prior = np.zeros((len(known), problem.model.n))
    prior[np.arange(len(known)), constants + known] = 1.0 / spread[known]
    miss = (states[0, constants:] - problem.mean[constants:])[known] / spread[known]
    return Analysis(residual, inputs.z - apart, innovations, rows, prior, -miss)


def _seen(problem: Problem, inputs: Inputs, states: Array, derivatives: Array | None, step: float) -> tuple[Array, Array]:
    """Whitened residuals (J, m), and minus their derivatives (J, m, n) by the first state."""
    if not problem.is_noise_free or not np.isfinite(states[0]).all():
        shot = along(problem, inputs, states)
        return shot.innovations, shot.rows.reshape(*inputs.z.shape, -1)
    if derivatives is None:
        derivatives = swept(problem, inputs.t, states[0], step)[1]
    innovations, rows = whitened(problem, inputs, states)
    return innovations, rows @ derivatives[np.repeat(np.arange(inputs.epochs), np.diff(inputs.first_row))]


def _known_before(given: Setup, before: tuple[Array, Array], first: Array) -> tuple[Array, Array]:
    """Rows (n, n) that an earlier orbit is worth, by the first state, and how far the solution is from it, in its sigmas.

    Without process noise it is compared where it stands, because what it was uncertain by may have grown beyond a straight
    line until the first measurement.
    """
    problem, begun = given.problem, float(given.tracking.times[0])
    mean, root = before
    then, J = first, np.eye(len(first))
    gap = begun - float(begun if problem.prior_time is None else problem.prior_time)
    if problem.is_noise_free and gap > 0.0:
        step = given.chosen.max_step
        path, Phi = follow(problem, np.linspace(begun, begun - gap, ceil(gap / step) + 1), first, step)
        mean, root, then = problem.mean, root_of(problem.covariance), path[-1]
        for one in Phi:
            J = one @ J
    return np.linalg.solve(root, J), np.linalg.solve(root, mean - then)
