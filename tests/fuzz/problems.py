"""Random numbers in every place of the library: `python tests/fuzz/problems.py [--problems 1000] [--seed 0] [--keep FOLDER]`.

A problem is refused in one line, or whatever is estimated of it either says in one line that it is no success, or holds: means
and covariances are finite, covariances symmetric without a variance below zero, and no eigenvalue of their correlations lies
below -1e-9 n.  That goes for every view: real-time, delayed, forecasts and live sessions.  Problem i of a seed is the same
however many there are.  Where the model is linear, some are small enough for a reference in 120 digits: there a success is
right, too, for priors up to 1e22 times as wide as the noise, in variance.
"""

import argparse
import os
import random
import sys
import time
import traceback
import warnings
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
sys.path[0] = str(ROOT)
for variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):
    os.environ.setdefault(variable, "1")
os.environ.setdefault("PIAZZI_CACHE", str(ROOT / ".cache" / "tests"))

import numpy as np  # noqa: E402

import piazzi as pz  # noqa: E402
from tests.fuzz.exact import posterior  # noqa: E402

SMALL = [0.0, -0.0, 5e-324, 1e-310, 1e-300, 1e-200, 1e-160, 1e-100, 1e-20, 1e-16, 1e-8, -1e-5, 1.0, -1.0, np.pi]
LARGE = [1e8, 2.0**53, 1e20, 1e100, 1e150, 1e154, 1e160, 1e200, 1e300, -1e300, 1.7e308, np.nan, np.inf, -np.inf]
NOTHING = 5e-324  # in the place of a variance of zero
Array = np.ndarray[Any, Any]

matrix = [[f"a{i}{j}" for j in range(3)] for i in range(3)]
LINEAR = pz.Model(
    ["x", "y", "z"],
    [" + ".join(f"{a}*{s}" for a, s in zip(row, "xyz", strict=True)) for row in matrix],
    [pz.Sensor("one", ["u*x + v*y + w*z"]), pz.Sensor("two", ["u*x + v*y", "w*z - v*x"])],
    parameters=[name for row in matrix for name in row],
    discrete=True,
)
PENDULUM = pz.Model(
    ["angle", "rate"],
    ["rate", "-w*sin(angle) - c*rate"],
    [pz.Sensor("s", ["l*sin(angle)"])],
    parameters=["w", pz.Parameter("c", "estimated")],
)
SHIPPED = ("b612-range", "b612-range-q0")


@dataclass
class Draw:
    """A random generator with the numbers that break things."""

    rng: random.Random

    def number(self, special: float = 0.5) -> float:
        if self.rng.random() < special:
            return self.rng.choice(SMALL + LARGE)
        return self.rng.gauss(0, 1) * 10 ** self.rng.uniform(-3, 3)

    def array(self, *shape: int) -> Any:
        """Numbers in one of the forms that arrays come in."""
        a = np.array([self.number(0.1) for _ in range(int(np.prod(shape)))], dtype=float).reshape(shape)
        with np.errstate(all="ignore"):
            forms = (a.astype(np.float32), a[::-1], np.asfortranarray(a), a.astype(object), a.tolist(), a.astype(">f8"))
        return self.rng.choice((*forms, *(a,) * 6))

    def spread(self, n: int, low: float, high: float) -> Array:
        """Standard deviations, of sizes spread evenly in orders of magnitude."""
        return np.array([10.0 ** self.rng.uniform(low, high) for _ in range(n)])

    def covariance(self, n: int) -> Any:
        """A covariance: regular, singular, of many orders of magnitude, or none at all."""
        A = np.array([[self.rng.gauss(0, 1) for _ in range(n)] for _ in range(n)])
        match self.rng.randrange(8):
            case 0:
                return np.zeros((n, n))
            case 1:
                return np.diag([abs(self.number(0.3)) for _ in range(n)])
            case 2:
                return A @ A.T
            case 3:
                return np.outer(A[0], A[0])
            case 4:
                return np.diag(self.spread(n, -150, 150))
            case 5:
                return self.array(n, n)
            case 6:
                return np.diag(self.spread(n, -8, 11) ** 2)
        C, s = A @ A.T, self.spread(n, -4, 8)
        return C / np.sqrt(np.outer(np.diag(C), np.diag(C))) * np.outer(s, s)


@dataclass(frozen=True)
class Base:
    """A good problem to be damaged."""

    problem: pz.Problem
    tracking: pz.Tracking


def bases() -> list[Base]:
    """The good problems."""
    found = [Base(*pz.load(name)) for name in SHIPPED]
    values = {name: float(i == j) for i, row in enumerate(matrix) for j, name in enumerate(row)} | {"a01": 1.0}
    numbers = {"u": 1.0, "v": 0.0, "w": 0.5}
    for name, width in (("one", 1), ("two", 2)):
        station = pz.Station("s", name, 0.01 * np.eye(width), numbers)
        problem = pz.Problem(LINEAR, pz.Gaussian(np.zeros(3), np.eye(3)), None, [station], values)
        found.append(Base(problem, pz.simulate(problem, np.arange(50.0), np.random.default_rng(0))))
    station, damping = pz.Station("s", "s", 0.01, {"l": 1.0}), pz.Gaussian(0.1, 0.01)
    problem = pz.Problem(
        PENDULUM, pz.Gaussian([1, 0], [0.1, 0.1]), None, [station], {"w": 9.8, "c": damping}, pz.RungeKutta4(substeps=2)
    )
    found.append(Base(problem, pz.simulate(problem, 0.1 * np.arange(50), np.random.default_rng(0))))
    return found


def estimators(rng: random.Random) -> list[Any]:
    """One of each kind, with settings of its own."""
    gate, lag = rng.choice([0.9, 0.999, 1 - 1e-12]), rng.choice([1, 2, 5, 1000])
    return [
        pz.ExtendedKalmanFilter(),
        pz.ExtendedKalmanFilter(gate=gate, iterations=rng.choice([1, 3])),
        pz.UnscentedKalmanFilter(alpha=rng.choice([1.0, 0.1])),
        pz.SquareRootKalmanFilter(gate=rng.choice([None, gate])),
        pz.Smoother(cross_covariances=rng.random() < 0.5),
        pz.SlidingWindow(lag=lag, iterations=rng.choice([1, 2])),
        pz.SlidingWindow(lag=lag, loss=rng.choice(["huber", "cauchy", "tukey"])),
        pz.FactorGraph(solver=rng.choice(["auto", "auto", "chain"]), start=rng.choice(["ekf", "prior", "window"])),
        pz.FactorGraph(loss=rng.choice(["huber", "cauchy", "tukey"]), max_iterations=10),
        pz.BatchLeastSquares(),
    ]


def damaged(base: Base, draw: Draw) -> dict[str, Any]:
    """The parts of a problem like a good one, with random numbers in some places."""
    rng, p, t = draw.rng, base.problem, base.tracking
    n, K = len(p.model.states), rng.choice([0, 1, 1, 2, 3, 10, 30])
    often, width = rng.random(), len(p.stations[0].noise)
    times = np.sort([draw.number(0.05) for _ in range(K)])
    if rng.random() < 0.8:
        times = t.row_times[:K] * rng.choice([1, 1, 1, 1e-3, 3.0, 1e-12]) + rng.choice([0, 0, 0, 1e9, -1e3, 1e15])
    values = np.array(t.values[:K, :width] if rng.random() < 0.7 else draw.array(K, width), dtype=float)
    if K and rng.random() < 0.4:
        values[rng.randrange(K), rng.randrange(width)] = draw.number(1)
    station = p.stations[0]
    noise = p.process_noise
    if rng.random() < often:
        per, method = rng.choice(["second", "step"]), rng.choice(["integral", "scaled"])
        noise = {"covariance": draw.covariance(n), "per": per, "method": method}
    given = dict(p.parameters)
    moved = {name: draw.number(0.2) if isinstance(value, float) else value for name, value in given.items()}
    return {
        "times": times,
        "values": values,
        "mean": p.prior.mean if rng.random() < 0.5 else draw.array(n),
        "covariance": draw.covariance(n) if rng.random() < often else p.prior.covariance,
        "process_noise": noise,
        "noise": draw.covariance(width) if rng.random() < 0.5 * often else station.noise,
        "parameters": moved if rng.random() < 0.4 else given,
        "numbers": {k: draw.number(0.2) for k in station.numbers} if rng.random() < 0.3 else dict(station.numbers),
        "prior_time": draw.number() if rng.random() < 0.2 else None,
    }


def built(base: Base, parts: dict[str, Any]) -> Base:
    """The problem of its parts."""
    p, noise = base.problem, parts["process_noise"]
    station = pz.Station(p.stations[0].name, p.stations[0].sensor, parts["noise"], parts["numbers"])
    prior = pz.Gaussian(parts["mean"], parts["covariance"])
    noise = pz.ProcessNoise(**noise) if isinstance(noise, dict) else noise
    problem = pz.Problem(p.model, prior, noise, [station], parts["parameters"], p.integrator, prior_time=parts["prior_time"])
    return Base(problem, pz.Tracking(parts["times"], parts["values"]))


def unsound(mean: Array, covariance: Array, success: bool, message: str) -> str:
    """What is wrong with beliefs (K, n), (K, n, n) and what they say of themselves, "" where nothing is."""
    if not (message.isprintable() and len(message) < 1000) or not (success or message):
        return "the message is no line"
    if not success:
        return ""
    if not (np.isfinite(mean).all() and np.isfinite(covariance).all()):
        return "success with what is not finite"
    if (np.diagonal(covariance, axis1=1, axis2=2) < 0).any():
        return "success with a negative variance"
    if not np.array_equal(covariance, np.swapaxes(covariance, 1, 2)):
        return "success, not symmetric"
    variance = np.diagonal(covariance, axis1=1, axis2=2)
    sigma = np.sqrt(np.where(variance > 0, variance, NOTHING))
    least = np.linalg.eigvalsh(covariance / sigma[:, :, None] / sigma[:, None, :]).min()
    return "" if least >= -1e-9 * mean.shape[1] else f"success with an eigenvalue below {decade(least)}"


def decade(x: float) -> str:
    """The order of magnitude of a negative number."""
    return f"-1e{int(np.floor(np.log10(-x)))}"


@dataclass
class Tally:
    """What became of the problems."""

    problems: int = 0
    estimates: Counter[str] = field(default_factory=Counter)
    successes: Counter[str] = field(default_factory=Counter)
    refused: int = 0
    judged: Counter[str] = field(default_factory=Counter)
    right: Counter[str] = field(default_factory=Counter)
    found: Counter[str] = field(default_factory=Counter)
    first: dict[str, str] = field(default_factory=dict)

    def note(self, what: str, how: str) -> None:
        self.found[what] += 1
        self.first.setdefault(what, how)

    def beliefs(self, who: str, view: Any, how: str) -> None:
        """Judge something with means and covariances of many times."""
        self.estimates[who] += 1
        self.successes[who] += view.success
        wrong = unsound(view.mean, view.covariance, view.success, view.message)
        if wrong:
            self.note(f"{who}: {wrong}", how)


def views(estimator: Any, good: Base) -> Iterator[tuple[str, Any]]:
    """Everything that an estimator says of a problem, by name."""
    who = type(estimator).__name__
    estimate = estimator.estimate(good.problem, good.tracking)
    yield who, estimate
    if estimate.delayed is not None:
        yield f"{who}.delayed", estimate.delayed
    if estimate.success:
        times = good.tracking.times
        with_span = float(times[-1]) + np.array([0.0, 0.5, 1.0]) * max(1.0, float(np.ptp(times)))
        try:
            yield f"{who}.predict", estimate.predict(with_span)
        except ValueError as error:
            one_line(error)


def one_line(error: Exception) -> None:
    """Raise AssertionError where a refusal is not one printable line."""
    assert str(error).isprintable() and 0 < len(str(error)) < 1000, f"refused in what is no line: {str(error)[:300]!r}"


@dataclass(frozen=True)
class Belief:
    """A live session's belief, as beliefs of one time."""

    mean: Array
    covariance: Array
    success: bool
    message: str


def live(estimator: Any, good: Base) -> Iterator[tuple[str, Any]]:
    """What a live session of an estimator says after each of a few epochs."""
    session = estimator.start(good.problem)
    for t, z in zip(good.tracking.row_times[:5], good.tracking.values, strict=False):
        session.update(good.problem.stations[0].name, z, float(t))
        belief = Belief(session.mean[None], session.covariance[None], session.success, session.message)
        yield f"{type(estimator).__name__}.live", belief


def attempt(base: Base, seed: str, tally: Tally) -> None:
    """One problem, by three estimators."""
    draw = Draw(random.Random(seed))
    parts = damaged(base, draw)
    how = f"{seed} {parts}"
    try:
        good = built(base, parts)
        chosen = draw.rng.sample(estimators(draw.rng), 3)
        for estimator in chosen:
            for who, view in views(estimator, good):
                tally.beliefs(who, view, f"{how}\n{estimator}")
        for estimator in chosen:
            if callable(getattr(estimator, "start", None)) and draw.rng.random() < 0.3:
                for who, view in live(estimator, good):
                    tally.beliefs(who, view, f"{how}\n{estimator}")
    except ValueError as error:
        tally.refused += 1
        one_line(error)


def wide(base: Base, seed: str, tally: Tally) -> None:
    """A linear problem with a wide prior, against 120 digits."""
    draw = Draw(random.Random(seed))
    rng, width = draw.rng, len(base.problem.stations[0].noise)
    K = rng.choice([3, 6])
    A = np.eye(3) + 0.5 * np.array([[rng.gauss(0, 1) for _ in range(3)] for _ in range(3)])
    r = 10.0 ** rng.uniform(-3, 1)
    sigma = r * draw.spread(3, 0, rng.choice([2, 5, 11]))
    Q = (r * draw.spread(3, -3, 1)) ** 2 * (rng.random() < 0.7)
    R = np.diag((r * draw.spread(width, -0.5, 0.5)) ** 2)
    truth = sigma * np.array([rng.gauss(0, 1) for _ in range(3)])
    parts = {
        "times": np.arange(float(K)),
        "values": np.zeros((K, width)),
        "mean": np.zeros(3),
        "covariance": np.diag(sigma**2),
        "process_noise": {"covariance": np.diag(Q), "per": "step"},
        "noise": R,
        "parameters": {name: A[int(name[1]), int(name[2])] for name in base.problem.parameters},
        "numbers": {name: rng.gauss(0, 1) for name in "uvw"},
        "prior_time": None,
    }
    u, v, w = parts["numbers"].values()
    H = np.array([[u, v, w]] if width == 1 else [[u, v, 0.0], [-v, 0.0, w]])
    for k in range(K):
        parts["values"][k] = H @ truth + np.sqrt(np.diag(R)) * [rng.gauss(0, 1) for _ in range(width)]
        truth = A @ truth + np.sqrt(Q) * [rng.gauss(0, 1) for _ in range(3)]
    good = built(base, parts)
    lag = rng.choice([1, 2, 4, 10])
    reference = posterior(sigma**2, A, Q, H, np.diag(R), parts["values"])
    filters = (pz.ExtendedKalmanFilter(), pz.ExtendedKalmanFilter(gate=1 - 1e-12), pz.SquareRootKalmanFilter())
    for estimator in (*filters, pz.Smoother(), pz.FactorGraph(), pz.SlidingWindow(lag=lag)):
        estimate = estimator.estimate(good.problem, good.tracking)
        until = K if estimate.view == "delayed" else 1
        for suffix, view, epochs in (("", estimate, until), (".delayed", estimate.delayed, lag)):
            if view is not None:
                who = f"{type(estimator).__name__}{suffix}"
                tally.judged[who] += 1
                tally.right[who] += view.success
                wrong = off(view, reference, epochs) if view.success else ""
                if wrong:
                    tally.note(f"{who}: {wrong}", f"{seed} {parts}\n{estimator}")
    wide_live(good, reference, tally, f"{seed} {parts}")


def wide_live(good: Base, reference: tuple[Array, Array], tally: Tally, how: str) -> None:
    """The same problem one measurement at a time."""
    for estimator in (pz.ExtendedKalmanFilter(), pz.SquareRootKalmanFilter(), pz.SlidingWindow(lag=3)):
        who = f"{type(estimator).__name__}.live"
        tally.judged[who] += 1
        try:
            session = estimator.start(good.problem)
        except ValueError as error:  # too wide for it, which it says
            one_line(error)
            continue
        for k, (t, z) in enumerate(zip(good.tracking.times, good.tracking.values, strict=True)):
            session.update("s", z, float(t))
            told = Belief(session.mean[None], session.covariance[None], session.success, session.message)
            wrong = off(told, tuple(part[k : k + 1, k : k + 1] for part in reference), 1) if told.success else ""
            if wrong:
                tally.note(f"{who}: {wrong}", how)
                break
        tally.right[who] += session.success


def off(view: Any, reference: tuple[Array, Array], until: int) -> str:
    """What is wrong with an estimate in which each state is given `until` epochs, its own the first."""
    means, covariances = reference
    K = len(view.mean)
    at = [min(k + until - 1, K - 1) for k in range(K)]
    mean = np.array([means[j, k] for k, j in enumerate(at)])
    sigma = np.sqrt([np.diag(covariances[j, k]) for k, j in enumerate(at)])
    rounding = 1e-14 * np.abs(means).max() / sigma
    error = (np.abs(view.mean - mean) / sigma - rounding).max()
    if error > 1e-3:
        return f"success, but off by 1e{int(np.floor(np.log10(error)))} sigma"
    ratio = np.abs(np.sqrt(np.diagonal(view.covariance, axis1=1, axis2=2)) / sigma - 1).max()
    return f"success, but sigma is off by 1e{int(np.floor(np.log10(ratio)))}" if ratio > 1e-3 else ""


def search(seed: int, first: int, many: int, tally: Tally) -> None:
    """Try so many problems of a seed."""
    good = bases()
    linear = [base for base in good if base.problem.model is LINEAR]
    for i in range(first, first + many):
        name = f"{seed}-{i}"
        tally.problems += 1
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # those are for the user; each has tests of its own
                if i % 20 == 0:
                    wide(linear[(i // 20) % 2], name, tally)
                else:
                    attempt(good[i % len(good)], name, tally)
        except Exception as error:  # whatever ends a run is a finding
            tally.note(f"{type(error).__name__}: {str(error)[:100]}", f"{name}\n{traceback.format_exc()}")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--problems", type=int, default=1000)
    parser.add_argument("--first", type=int, default=0, help="number of the first problem")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--keep", type=Path, help="folder for the first finding of each kind")
    options = parser.parse_args()
    tally, started = Tally(), time.monotonic()
    search(options.seed, options.first, options.problems, tally)
    print(
        f"{tally.problems} problems, {tally.refused} refused; {sum(tally.estimates.values())} views, "
        f"{sum(tally.successes.values())} with success; {sum(tally.judged.values())} beside 120 digits, "
        f"{sum(tally.right.values())} with success; {time.monotonic() - started:.0f} s"
    )
    for who, count in sorted(tally.estimates.items()):
        print(f"  {who:50s} {count:8d} {tally.successes[who]:8d} with success")
    for who, count in sorted(tally.judged.items()):
        print(f"  {who + ' beside 120 digits':50s} {count:8d} {tally.right[who]:8d} with success")
    for i, (what, count) in enumerate(tally.found.most_common()):
        print(f"  FOUND {count:6d} {what}")
        if options.keep:
            options.keep.mkdir(parents=True, exist_ok=True)
            (options.keep / f"{options.seed}-{i}.txt").write_text(f"{what}\n{tally.first[what]}\n")
    return 1 if tally.found else 0


if __name__ == "__main__":
    raise SystemExit(main())
