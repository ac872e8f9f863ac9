"""Whether the first state can be seen at all, how well, and whether it is the only one that fits."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from piazzi.estimate import FactorGraph
from piazzi.evaluate.attempts import Attempt, attempts
from piazzi.evaluate.bounds import full_truth
from piazzi.evaluate.grids import as_text
from piazzi.evaluate.information import along, bound, factor, growth, singular
from piazzi.evaluate.quantities import finite
from piazzi.evaluate.twins import Twin, find_twins
from piazzi.evaluate.verdict import verdict, weakest
from piazzi.model import Sensor
from piazzi.problem import Problem, ProcessNoise, Station, Tracking
from piazzi.problem.checks import Array
from piazzi.problem.inputs import Inputs, prepare

if TYPE_CHECKING:
    import xarray
    from rich.console import Console, ConsoleOptions, RenderResult

SCHEMA = "piazzi.observability/1"
Addition = Station | tuple[Sensor, Station]
_POINTS = 400  # epochs after which the growing information is kept


@dataclass(frozen=True, eq=False)
class Information:
    """Fisher information of the first state as the singular values of its root, each state in units of its prior sigma.

    A singular value s of a direction means that measurements alone tell it to 1/s prior sigmas.

    Attributes
    ----------
    singular_values : (n,), falling, zero where a direction cannot be seen
    directions : (n, n), the unit vector of each singular value in a row, states in units of `Observability.scale`
    crlb_sigma : (n,), Cramer-Rao standard deviation of each state, SI units, infinite where it cannot be seen
    """

    singular_values: Array
    directions: Array
    crlb_sigma: Array

    @property
    def condition(self) -> float:
        """Largest singular value over smallest, infinite where one is zero."""
        low = float(self.singular_values[-1])
        return float(self.singular_values[0]) / low if low > 0 else float("inf")


@dataclass(frozen=True, eq=False)
class Observability:
    """What the measurements of a tracking say about the first state, without the prior.

    Attributes
    ----------
    problem, tracking, source : what was looked at
    about : "truth" or "estimate", where everything was linearised
    state : (n,), the first state there, SI units
    scale : (n,), unit of each state in singular values and directions: its prior sigma (1 where the prior is certain)
    information : Information, over all epochs, with the process noise that the problem assumes
    without_noise : Information, the same if there were no process noise; None where there is none
    growth_times : (E,), epochs, s, up to which `growth_values` (E, n) and `growth_sigma` (E, n) take measurements in:
        singular values, and Cramer-Rao sigma of each state in SI units, infinite as long as it cannot be seen
    twins : tuple of Twin, other first states with the same measurements, best first
    attempts : tuple of Attempt, what estimators made of it beside the bound; empty without truth
    added : Observability with further stations, None where none were asked for
    message : why the factor graph, whose estimate stands in for the truth, did not succeed; "" where it did
    """

    problem: Problem
    tracking: Tracking
    source: str
    about: str
    state: Array
    scale: Array
    information: Information
    without_noise: Information | None
    growth_times: Array
    growth_values: Array
    growth_sigma: Array
    twins: tuple[Twin, ...]
    attempts: tuple[Attempt, ...] = ()
    added: Observability | None = None
    message: str = ""

    @property
    def success(self) -> bool:
        """Whether the states that everything was linearised about can be relied on."""
        return not self.message

    @property
    def singular_values(self) -> Array:
        return self.information.singular_values

    @property
    def condition(self) -> float:
        return self.information.condition

    @property
    def crlb_sigma(self) -> Array:
        return self.information.crlb_sigma

    @property
    def weakest_direction(self) -> dict[str, float]:
        """What is seen worst: its components in units of `scale`, largest first, those below 0.1 left out."""
        return weakest(self.problem.model.names, self.information.directions[-1])

    @property
    def verdict(self) -> str:
        """All of it in plain words."""
        return verdict(self)

    def to_dict(self) -> dict[str, Any]:
        """The object of schema piazzi.observability/1; what is infinite is None."""
        model = self.problem.model
        return {
            "schema": SCHEMA,
            "source": self.source,
            "states": list(model.names),
            "epochs": len(self.tracking.times),
            "prior_time": self.problem.prior_start(self.tracking.times),
            **_information(self.information),
            "weakest_direction": self.weakest_direction,
            "twins": [_twin(twin) for twin in self.twins],
            "verdict": self.verdict,
            "about": self.about,
            "success": self.success,
            "message": self.message,
            "state": self.state.tolist(),
            "units": {name: model.unit(name) for name in model.names},
            "scale": self.scale.tolist(),
            "without_process_noise": None if self.without_noise is None else _information(self.without_noise),
            "attempts": [attempt.to_dict() for attempt in self.attempts],
            "growth": {
                "times": self.growth_times.tolist(),
                "singular_values": self.growth_values.tolist(),
                "crlb_sigma": [[finite(v) for v in row] for row in self.growth_sigma.tolist()],
            },
            "added": None if self.added is None else self.added.to_dict(),
        }

    def to_json(self, indent: int | None = None) -> str:
        """The object of schema piazzi.observability/1 as strict JSON."""
        return json.dumps(self.to_dict(), allow_nan=False, indent=indent)

    def to_dataset(self) -> xarray.Dataset:
        """Singular values, directions, bounds and their growth with names and units."""
        from piazzi.evaluate.dataset import observability_to_dataset

        return observability_to_dataset(self)

    def _repr_html_(self) -> str:
        from piazzi.evaluate.observable_display import html

        return html(self)

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        from piazzi.evaluate.observable_display import render

        return render(self, console, options)

    def __str__(self) -> str:
        return as_text(self)


def _information(found: Information) -> dict[str, Any]:
    return {
        "singular_values": found.singular_values.tolist(),
        "condition": finite(found.condition),
        "crlb_sigma": [finite(v) for v in found.crlb_sigma.tolist()],
    }


def _twin(twin: Twin) -> dict[str, Any]:
    return {"state": twin.state.tolist(), "misfit": twin.misfit, "prior_distance": twin.prior_distance}


def observability(
    problem: Problem,
    tracking: Tracking,
    *,
    add: Sequence[Addition] = (),
    twins: bool = True,
    source: str = "",
) -> Observability:
    """What the measurements say about the first state, at the truth (where it is not known, at the factor graph's estimate).

    Estimated constants count as states.  The information is that of the measurements alone, without prior, with the process
    noise that the problem assumes taken into account, so that the Cramer-Rao sigma is a bound for the problem as it is
    estimated; `without_noise` has the textbook matrix H Phi.

    Parameters
    ----------
    problem : Problem
    tracking : Tracking
    add : stations that measure at every epoch too, each alone or with a sensor that the model does not have, (sensor, station)
        `Observability.added` tells what they would change.
    twins : whether to look for other first states with the same measurements
    source : where the measurements came from, for the record

    Raises
    ------
    ValueError
        Where the tracking does not fit the problem, a station of `add` does not fit the model or has a name that is taken, or
        there is neither truth nor a finite estimate.
    """
    inputs = prepare(problem, tracking)
    more = _with_stations(problem, add) if add else None
    states, about, message = _about(problem, tracking)
    found = _observability(problem, tracking, inputs, states, about, twins, source)
    found = replace(found, attempts=attempts(problem, tracking, found.twins), message=message)
    if more is None:
        return found
    wider = _with_rows(tracking, problem, more)
    return replace(found, added=_observability(more, wider, prepare(more, wider), states, about, twins, source))


def _with_stations(problem: Problem, add: Sequence[Addition]) -> Problem:
    sensors = [part for item in add if isinstance(item, tuple) for part in item[:1]]
    stations = [item[1] if isinstance(item, tuple) else item for item in add]
    model = replace(problem.model, sensors=(*problem.model.sensors, *sensors)) if sensors else problem.model
    return replace(problem, model=model, stations=[*problem.stations, *stations])


def _about(problem: Problem, tracking: Tracking) -> tuple[Array, str, str]:
    """States to linearise about (K, n), what they are, and why they may be wrong."""
    truth = full_truth(problem, tracking)
    if truth is not None:
        return truth, "truth", ""
    estimate = FactorGraph().estimate(problem, tracking)
    if not np.isfinite(estimate.mean).all():
        raise ValueError(f"there is no truth, and the factor graph has no estimate to take its place: {estimate.message}")
    return estimate.mean, "estimate", "" if estimate.success else estimate.message


def _observability(
    problem: Problem, tracking: Tracking, inputs: Inputs, states: Array, about: str, twins: bool, source: str
) -> Observability:
    sigma = np.sqrt(np.diag(problem.covariance))
    scale = np.where(sigma > 0, sigma, 1.0)
    rows = _finite(along(problem, inputs, states).rows * scale)
    total = _summary(factor(rows), scale)
    epochs = _epochs(inputs.epochs)
    values, directions = singular(growth(rows, inputs.first_row[epochs + 1] * inputs.z.shape[1]))
    quiet = None
    if problem.process_noise.covariance.any():
        still = replace(problem, process_noise=ProcessNoise(np.zeros(len(problem.model.states)), "step"), truth=None)
        quiet = _summary(factor(_finite(along(still, inputs, states).rows * scale)), scale)
    root = factor(rows)
    others = find_twins(problem, inputs, states[0], scale, root) if twins else ()
    return Observability(
        problem,
        tracking,
        source,
        about,
        states[0].copy(),
        scale,
        total,
        quiet,
        inputs.t[epochs],
        values,
        bound(values, directions) * scale,
        others,
    )


def _finite(rows: Array) -> Array:
    bad = ~np.isfinite(rows).all(axis=1)
    if bad.any():
        raise ValueError(f"measurement {int(np.argmax(bad))} has no derivative where the problem is linearised")
    return rows


def _summary(root: Array, scale: Array) -> Information:
    values, directions = singular(root)
    largest = np.take_along_axis(directions, np.abs(directions).argmax(axis=1)[:, None], axis=1)
    directions = directions * np.sign(largest)
    return Information(values, directions, bound(values, directions) * scale)


def _epochs(K: int) -> Array:
    """Epochs to tell the growth after: all where there are few, else ever fewer of them, with some spread evenly."""
    if K <= _POINTS:
        return np.arange(K)
    half = _POINTS // 2
    return np.unique(np.concatenate([np.geomspace(1, K, half), np.linspace(1, K, half)]).round().astype(np.int64)) - 1


def _with_rows(tracking: Tracking, problem: Problem, more: Problem) -> Tracking:
    """The tracking with a row for each further station at every epoch, behind those that are there.

    Their values are of no account, as long as they are there.
    """
    width, new = more.model.width, more.stations[len(problem.stations) :]
    K, S = len(tracking.times), len(more.stations) - len(problem.stations)
    extra = np.full((S, width), np.nan)
    for s, station in enumerate(new):
        extra[s, : len(station.noise)] = 0.0
    old = tracking.row_stations if tracking.row_stations is not None else [problem.stations[0].name] * len(tracking.row_times)
    times = np.concatenate([tracking.row_times, np.repeat(tracking.times, S)])
    order = np.argsort(times, kind="stable")
    values = np.concatenate([tracking.padded(width), np.tile(extra, (K, 1))])[order]
    names = np.concatenate([old, np.tile([s.name for s in new], K)])[order]
    return Tracking(times[order], values, names, tracking.truth, tracking.epoch)
