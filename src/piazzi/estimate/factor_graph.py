"""The full factor graph: the most probable path of all states together, and its covariance."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from piazzi.drawn import later
from piazzi.estimate.bank import Bank, Paths, search, with_first
from piazzi.estimate.bordered import BorderedSolver
from piazzi.estimate.chain import Chain, CovarianceSolver, Solver
from piazzi.estimate.considered import nominal, with_considered
from piazzi.estimate.estimator import Estimate, Stopwatch, View
from piazzi.estimate.gauss_newton import Outcome, optimize
from piazzi.estimate.gradients import ended_exactly
from piazzi.estimate.joint_mode import applies, bias_message, marginal
from piazzi.estimate.kalman import filter_run
from piazzi.estimate.losses import Cauchy, loss_of
from piazzi.estimate.robust import RobustChain, chain_for, gated_run, minimize, solve_at
from piazzi.estimate.shooting import OrbitChain, ShootingSolver, dense_steps, steps_taken
from piazzi.estimate.sliding_window import SlidingWindow
from piazzi.estimate.width import DIFFUSE, NOT_BORDERED, ROUNDED, TOO_WIDE, undetermined
from piazzi.problem import Problem, Tracking
from piazzi.problem.checks import Array, numeric
from piazzi.problem.inputs import Inputs, prepare, with_prior_node

STARTS = ("ekf", "prior", "window", "bank", "orbits")
CONSTANTS = ("joint", "marginal")
SOLVERS = ("auto", "chain", "bordered")
# iterations that a second solution may take before the first is kept
MAX_SECOND = 20
AS_ONE = 1e-4  # sigma, to which an orbit is found: over days rounding moves it by more than a smaller step
FINEST = 1e-6  # asked for; less than that is found state by state
MOST = 60  # unknowns: with more, the chain costs less
ONE_ORBIT = 1e-4  # of the largest value: given states nearer than that to the orbit of the first are meant to be one


@dataclass(frozen=True, eq=False)
class FactorGraph:
    """Maximum a posteriori estimate of every state, by Gauss-Newton on prior, dynamics and measurement factors.

    Parameters
    ----------
    start : "ekf", "prior", "window", "bank", "orbits", a `Bank`, or states (K, n)
        Where the iterations begin.  A bank begins in many places of the prior too, and takes the most probable of the
        solutions that it finds; see `Bank`.  "orbits" begins at every orbit that `initial_orbits` finds in the tracking, which
        needs no prior that knows where the body is, and lists and weighs the solutions as a bank does.
    max_iterations : int
        From each start; with a loss four times as many, because reweighting converges linearly.
    tolerance : float
        Converged when no state moves by more than this many of its standard deviations.
    cross_covariances : bool
        Keep Cov(x[k], x[k+1]) as ``details["cross_covariances"]``, shape (K - 1, n, n).
    solver : "auto", "chain" or "bordered"
        Covariances throughout, or the first state and the estimated constants beside the chain by column-scaled QR: for
        constants, and for priors about a million times as wide as what the measurements leave, where covariances lose what
        they hold.  "auto" decides, and ``details["solver"]`` tells.
    loss : Huber, Cauchy or Tukey, or "huber", "cauchy" or "tukey"; optional
        Rows that do not fit the others are weighted down; ``details["weights"]`` (J,) has the weight of each.
    constants : "joint" or "marginal"
        Estimated constants as the most probable path of everything together has them, or the most probable constants, whatever
        the path (Laplace's approximation), with the most probable path for these; covariances are those of Gauss-Newton there.
        The two differ by many sigmas where a constant multiplies states that process noise moves, over many epochs; a joint
        mode that is off by more than half a sigma says so in `Estimate.message`.

    Notes
    -----
    Each step is a linearised Kalman filter forward and a Bryson-Frazier recursion back, so process noise may be singular or
    zero.  Steps that raise the cost are shortened or damped (Levenberg-Marquardt, scaled by the prior covariance), except the
    first, whose cost says nothing: a start that leaves the dynamics has any cost at all.  Where Gauss-Newton is slow or repels,
    its last steps are extrapolated; where iterations run out within 1e-3 sigma of the end, the result succeeds and its message
    says how far it may be off.  Process noise that depends on the states is that of the newest states, held fixed within an
    iteration: what is found is a fixed point of that.  With singular noise "cost" uses the
    pseudo-inverse of Q and stands beside "defect", the largest violation of the dynamics in prior standard deviations.

    Given states that are one orbit of a problem without process noise are moved by the first alone, to 1e-4 sigma, where epochs
    are denser than the steps that its forces ask for: ``details["solver"]`` is "batch", and `BatchLeastSquares` does it.  For a
    `tolerance` below 1e-6, and for more than 60 unknowns, they are moved one by one.

    With a loss the cost is the robust one, found by iterated reweighting; the start is a filter with a gate, and where the
    solution then rejects many measurements, a window with a loss and the prior are tried too.  Tukey's and Cauchy's losses are
    followed from where Huber's leads, and from given states or a bank's members directly too.  Covariances are those of the
    weighted measurements: they allow for rows that were weighted down, not for having chosen them by their residuals, and are
    some per cent off where noise is Gaussian or worse.
    """

    views: ClassVar[tuple[View, ...]] = ("delayed",)

    start: Any = "ekf"
    max_iterations: int = 100
    tolerance: float = 1e-6
    cross_covariances: bool = False
    solver: str = "auto"
    loss: Any = None
    constants: str = "joint"

    def __post_init__(self) -> None:
        object.__setattr__(self, "loss", loss_of(self.loss))
        if isinstance(self.start, str) and self.start not in STARTS:
            raise ValueError(f"start is {self.start!r}; it must be one of {', '.join(STARTS)}, or states")
        if self.solver not in SOLVERS:
            raise ValueError(f"solver is {self.solver!r}; it must be one of {', '.join(SOLVERS)}")
        if self.constants not in CONSTANTS:
            raise ValueError(f"constants is {self.constants!r}; it must be one of {', '.join(CONSTANTS)}")
        if self.max_iterations < 1:
            raise ValueError(f"max_iterations is {self.max_iterations}; it must be 1 or more")
        if not self.tolerance > 0:
            raise ValueError(f"tolerance is {self.tolerance}; it must be positive")

    @with_considered
    @ended_exactly(lambda near: near.mean)
    def estimate(self, problem: Problem, tracking: Tracking) -> Estimate:
        """Smoothed means and covariances at every epoch; `success` is False where the iterations do not converge.

        Raises
        ------
        ValueError
            Where the tracking does not fit the problem, or the start has the wrong shape; of orbits where none fits.
        """
        if isinstance(self.start, str) and self.start == "orbits":
            paths = later("determination.initial", "orbit_paths")(problem, tracking)
            return replace(self, start=Paths(tuple(paths)))._estimated(problem, tracking)
        return self._estimated(problem, tracking)

    def _estimated(self, problem: Problem, tracking: Tracking) -> Estimate:
        inputs = prepare(problem, tracking)
        nodes = with_prior_node(inputs)
        skip = nodes.epochs - inputs.epochs
        watch = Stopwatch()
        chain, solver, outcome, used = self._along_orbit(problem, nodes, tracking) or self._of_states(problem, nodes, tracking)
        if self._bank is not None:
            outcome = search(self._bank, chain, solver, inputs, outcome, self.tolerance)
        if not outcome.failure and applies(chain):
            outcome = self._with_constants(chain, solver, outcome)
        nu, S = chain.innovations()
        details = {"start": used} | outcome.details | {"first_state": chain.x[0].copy(), "residuals": chain.residuals()}
        details |= steps_taken(chain)
        if isinstance(chain, RobustChain):
            details |= {"loss": str(self.loss), "weights": chain.weights}
        failure = outcome.failure or undetermined(problem, outcome.covariance[0], chain.x)
        if self.cross_covariances and not outcome.failure:
            details["cross_covariances"] = solver.cross()[skip:]
        return Estimate(
            problem,
            tracking,
            chain.x[skip:],
            outcome.covariance[skip:],
            nu,
            S,
            outcome.iterations,
            watch.seconds(),
            "delayed",
            None,
            details,
            failure,
        )

    def _of_states(self, problem: Problem, nodes: Inputs, tracking: Tracking) -> tuple[Chain, Solver, Outcome, str]:
        """Every state by itself: the chain, its solver, how that ended, and the starts used."""
        chain = chain_for(problem, nodes, self.loss)
        outcome, solver, used = self._optimize(chain, prepare(problem, tracking), tracking)
        return chain, solver, outcome, used

    def _along_orbit(self, problem: Problem, nodes: Inputs, tracking: Tracking) -> tuple[Chain, Solver, Outcome, str] | None:
        """The same of given states that are one orbit, where nothing but its first state and the constants is unknown.

        None where epochs are not dense enough for that to be faster, and where it does not end as it should.
        """
        named = isinstance(self.start, (str, Bank, Paths)) or self.solver != "auto" or self.loss is not None
        others = named or self.tolerance < FINEST or problem.model.n > MOST
        if others or not problem.is_noise_free or not dense_steps(problem, nodes):
            return None
        chain = OrbitChain(problem, nodes)
        states, solver = with_first(chain, self._given(problem, tracking)), ShootingSolver(chain)
        away = np.abs(chain.orbit(states[0]) - states).max(axis=0)
        if not (away <= ONE_ORBIT * np.abs(states).max(axis=0)).all():
            return None
        outcome = optimize(chain, solver, states, self.max_iterations, max(self.tolerance, AS_ONE))
        return None if outcome.failure or "remark" in outcome.details else (chain, solver, outcome, "given")

    def _with_constants(self, chain: Chain, solver: Solver, outcome: Outcome) -> Outcome:
        """The outcome with its constants at the marginal mode, where that is asked for; else what is to be said about them."""
        if self.constants == "marginal":
            return marginal(chain, solver, outcome, self.max_iterations, self.tolerance)
        remarks = [outcome.details.get("remark"), bias_message(chain, solver, outcome.covariance)]
        said = "; ".join(filter(None, remarks))
        return replace(outcome, details=outcome.details | {"remark": said}) if said else outcome

    @property
    def _bank(self) -> Bank | Paths | None:
        if isinstance(self.start, str):
            return Bank() if self.start == "bank" else None
        return self.start if isinstance(self.start, (Bank, Paths)) else None

    def _optimize(self, chain: Chain, inputs: Inputs, tracking: Tracking) -> tuple[Outcome, Solver, str]:
        """Optimise from the start asked for; the outcome, its solver, and the starts used.

        Where the iterations fail, once more from a window, then from the prior.  Where the prior turns out too wide for a
        filter, in bordered form and from the prior first; where it was only so wide that rounding may be why every start
        failed, in that form too.  Where the filter behind the start was wrong about its errors, from the prior too: it may have
        led to another solution of the same measurements.
        """
        problem, name = chain.problem, self.start if isinstance(self.start, str) else "given"
        name = name if self._bank is None or isinstance(self.start, Paths) else "ekf"
        applies = BorderedSolver.applies(problem)
        if self.solver == "bordered" and not applies:
            raise ValueError(f"solver 'bordered' cannot be used: {NOT_BORDERED}")
        bordered = self.solver == "bordered" or (self.solver == "auto" and applies and bool(problem.model.constants))
        solver: Solver = BorderedSolver(chain) if bordered else CovarianceSolver(chain)
        wide = False
        waiting = [name, *(s for s in ("window", "prior") if s != name)]
        tried: list[tuple[str, Outcome]] = []
        doubtful = False
        while waiting and not (tried and not tried[-1][1].failure):
            start = waiting.pop(0)
            states, wrong = self._begin(start, chain.problem, tracking, inputs)
            doubtful = doubtful or wrong
            outcome = minimize(
                chain,
                solver,
                with_first(chain, states),
                self.max_iterations,
                self.tolerance,
                np.inf if wide else DIFFUSE,
                direct=start == "given",
            )
            tried.append((start, outcome))
            if outcome.failure == TOO_WIDE:
                if self.solver == "chain" or not applies:
                    return _too_wide(outcome, self.solver), solver, start
                solver, wide, tried = solver if bordered else BorderedSolver(chain), True, []
                waiting = [*(["given"] if name == "given" else []), "prior", "window"]
            elif outcome.failure and not waiting and not wide and applies and self._rounds(solver):
                solver, wide, waiting = BorderedSolver(chain), True, [*(["given"] if name == "given" else []), "prior"]
        outcome, used = _together(tried), ", then ".join(start for start, _ in tried)
        used = used.replace("given", "orbits") if isinstance(self.start, Paths) else used
        for start in self._others(chain, doubtful, tried[-1][0]) if not outcome.failure else ():
            states, _ = self._begin(start, chain.problem, tracking, inputs)
            outcome, better = self._or_better(chain, solver, outcome, with_first(chain, states))
            used = start if better else used
        return outcome, solver, used

    def _rounds(self, solver: Solver) -> bool:
        """Whether steps by covariances that failed may have done so for their rounding."""
        return self.solver == "auto" and isinstance(solver, CovarianceSolver) and solver.widest() > ROUNDED

    def _others(self, chain: Chain, doubtful: bool, used: str) -> Iterator[str]:
        """Where else to begin, for as long as the solution may not be the best."""
        for start in ("window", "prior") if isinstance(chain, RobustChain) else ("prior",):
            if start != used and (chain.mostly_rejects if isinstance(chain, RobustChain) else doubtful):
                yield start

    def _or_better(self, chain: Chain, solver: Solver, outcome: Outcome, states: Array) -> tuple[Outcome, bool]:
        """The outcome, or that from other states where its cost is lower, and whether it is; the chain is left there."""
        x = chain.x.copy()
        other = minimize(chain, solver, states, min(self.max_iterations, MAX_SECOND), self.tolerance)
        if not other.failure and other.details["cost"] < outcome.details["cost"] - 1e-6:
            spent = outcome.iterations + other.iterations
            if "remark" in other.details:  # on the way to the better one, which deserves as many iterations as the first
                other = minimize(chain, solver, chain.x.copy(), self.max_iterations, self.tolerance)
                spent += other.iterations
            return replace(other, iterations=spent), True
        solve_at(chain, solver, x)
        return outcome, False

    def _given(self, problem: Problem, tracking: Tracking) -> Array:
        """States (K, n) to start from, as they were given."""
        K, n = len(tracking.times), problem.model.n
        states = numeric(self.start.states[0] if isinstance(self.start, Paths) else self.start, "start")
        if states.shape != (K, n) or not np.isfinite(states).all():
            raise ValueError(f"start has shape {states.shape}; it must be ({K}, {n}), and finite")
        return states

    def _begin(self, start: str, problem: Problem, tracking: Tracking, inputs: Inputs) -> tuple[Array, bool]:
        """States to start from, (K, n), and whether the filter that they come from was wrong about its errors."""
        if start == "given":
            return self._given(problem, tracking), False
        if start == "window":
            first = nominal(SlidingWindow(loss=None if self.loss is None else Cauchy()), problem, tracking)
            assert first.delayed is not None
            return first.delayed.mean, inconsistent(first.innovations, first.innovation_covariances)
        if start == "ekf" and self.loss is not None:
            return gated_run(problem, inputs), False
        seen = inputs if start == "ekf" else replace(inputs, z=np.full_like(inputs.z, np.nan))
        mean, _, nu, S, *_ = filter_run(problem, seen)
        return mean, inconsistent(nu, S)


def inconsistent(innovations: Array, covariances: Array) -> bool:
    """Whether innovations are larger than their covariances allow, by five standard deviations of chi-square."""
    with np.errstate(all="ignore"):
        squared = innovations**2 / np.diagonal(covariances, axis1=1, axis2=2)
    there = squared[~np.isnan(squared)]
    return bool(there.sum() > there.size + 5 * np.sqrt(2 * there.size))


def _together(tried: list[tuple[str, Outcome]]) -> Outcome:
    """The last outcome, with the iterations of all; where that failed too, with what was wrong with each."""
    last = tried[-1][1]
    if len(tried) == 1:
        return last
    failure = "; ".join(f"from {start}: {outcome.failure}" for start, outcome in tried) if last.failure else ""
    return replace(last, iterations=sum(outcome.iterations for _, outcome in tried), failure=failure)


def _too_wide(outcome: Outcome, solver: str) -> Outcome:
    """The outcome for a prior too wide for covariances where they must be used."""
    way = "choose solver='auto'" if solver == "chain" else NOT_BORDERED
    return replace(outcome, failure=f"{TOO_WIDE} beside the noise of the measurements: {way}")
