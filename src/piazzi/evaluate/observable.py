"""What the measurements say about the first state: numbers, a verdict, tables."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from piazzi.drawn import Drawn
from piazzi.evaluate.attempts import Attempt
from piazzi.evaluate.grids import Grid
from piazzi.evaluate.information import Information
from piazzi.evaluate.quantities import displays, finite, number
from piazzi.evaluate.tabled import Tabled
from piazzi.evaluate.twins import NO_SEARCH, Search, Twin
from piazzi.evaluate.verdict import AS_THE_PRIOR, conclusion, local, twins_found, unreliable, weakest
from piazzi.problem import Problem, Tracking
from piazzi.problem.checks import Array
from piazzi.problem.epochs import dated
from piazzi.text import printable

if TYPE_CHECKING:
    import xarray

SCHEMA = "piazzi.observability/1"
_LISTED = 8  # twins in the table


@dataclass(frozen=True, eq=False)
class Observability(Tabled, Drawn):
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
    searched : Search, how many starts there were for twins, and from how many of them a fit was made
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
    searched: Search = NO_SEARCH

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
        model, noise = self.problem.model, self.without_noise is not None
        count = int((~np.isnan(self.tracking.values)).sum())
        parts = [
            *unreliable(self.message),
            *local(model, self.information, self.weakest_direction, self.since, noise=noise),
            *twins_found(model.names, self.searched, count, continuum=self.information.blind > 0),
            *conclusion(self.attempts, model.n, blind=self.information.blind > 0),
        ]
        return printable(" ".join(parts))

    @property
    def since(self) -> float | None:
        """Time, s, from which on the measurements determine every direction better than the prior; None for never."""
        better = np.flatnonzero(self.growth_values[:, -1] > AS_THE_PRIOR)
        return float(self.growth_times[better[0]]) if better.size else None

    def to_dict(self) -> dict[str, Any]:
        """The object of schema piazzi.observability/1; what is infinite is None."""
        model = self.problem.model
        return {
            "schema": SCHEMA,
            "source": self.source,
            "states": list(model.names),
            "epochs": len(self.tracking.times),
            "prior_time": self.problem.prior_start(self.tracking.times),
            **dated(self.problem, self.tracking),
            **self.information.to_dict(),
            "weakest_direction": self.weakest_direction,
            "twins": [twin.to_dict() for twin in self.twins],
            "searched": self.searched.to_dict(),
            "verdict": self.verdict,
            "about": self.about,
            "success": self.success,
            "message": self.message,
            "state": self.state.tolist(),
            "units": {name: model.unit(name) for name in model.names},
            "scale": self.scale.tolist(),
            "without_process_noise": None if self.without_noise is None else self.without_noise.to_dict(),
            "attempts": [attempt.to_dict() for attempt in self.attempts],
            "growth": {
                "times": self.growth_times.tolist(),
                "singular_values": self.growth_values.tolist(),
                "crlb_sigma": [[finite(v) for v in row] for row in self.growth_sigma.tolist()],
            },
            "added": None if self.added is None else self.added.to_dict(),
        }

    def to_dataset(self) -> xarray.Dataset:
        """Singular values, directions, bounds and their growth with names and units."""
        import xarray as xr

        model, twins = self.problem.model, self.twins
        variables: dict[str, Any] = {
            "first_state": (("state",), self.state),
            "scale": (("state",), self.scale, {"long_name": "unit of each state in directions"}),
            "crlb_sigma": (("state",), self.crlb_sigma, {"long_name": "Cramer-Rao standard deviation"}),
            "singular_value": (("direction",), self.singular_values),
            "direction_vector": (("direction", "state"), self.information.directions),
            "singular_value_growth": (("time", "direction"), self.growth_values),
            "crlb_sigma_growth": (("time", "state"), self.growth_sigma),
            "twin_state": (("twin", "state"), np.array([t.state for t in twins]).reshape(-1, model.n)),
            "twin_misfit": (("twin",), np.array([t.misfit for t in twins]), {"long_name": "RMS difference in sigma"}),
        }
        coordinates = {
            "state": ("state", np.array(model.names, dtype=object)),
            "unit": ("state", np.array([model.unit(name) for name in model.names], dtype=object)),
            "time": ("time", self.growth_times, {"units": "s"}),
        }
        return xr.Dataset(variables, coordinates, {"source": self.source, "about": self.about, "verdict": self.verdict})

    def grids(self) -> list[Grid]:
        """The first state with its bounds; the directions with their singular values; the twins."""
        return [_states(self), _directions(self), *([_twins(self)] if self.twins else [])]

    def sentences(self) -> list[str]:
        """The verdict, and what further stations would change, one sentence a line."""
        out = _split(self.verdict)
        if self.added is not None:
            names = ", ".join(s.name for s in self.added.problem.stations[len(self.problem.stations) :])
            out.append(f"With {names} too:")
            out += [line for line in _split(self.added.verdict) if line.startswith(("Observability", "Twin"))]
        return out

    def __repr__(self) -> str:
        """In short: the verdict's first sentence, on what."""
        return f"<{_split(self.verdict)[0].removesuffix('.')}; {self.problem!r}>"


def _split(text: str) -> list[str]:
    return re.split(r"(?<=[.:]) (?=[A-Z])", text)


def _states(found: Observability) -> Grid:
    model, more = found.problem.model, found.added
    heads = ["state", f"first state\n({found.about})", "prior sigma", "Cramer-Rao\nsigma"]
    heads += [] if found.without_noise is None else ["without\nprocess noise"]
    heads += [] if more is None else ["with the\nfurther stations"]
    rows = []
    sigma = np.sqrt(np.diag(found.problem.covariance))
    shows = displays([model.unit(name) for name in model.names], [[v] for v in found.state], model.group_indices.values())
    for i, (name, show) in enumerate(zip(model.names, shows, strict=True)):
        values = [found.state[i], sigma[i], found.crlb_sigma[i]]
        values += [] if found.without_noise is None else [found.without_noise.crlb_sigma[i]]
        values += [] if more is None else [more.crlb_sigma[i]]
        rows.append((name, *(number(float(v) * show.factor, 4) for v in values), show.unit))
    return Grid("First state, and how well the measurements alone determine it", (*heads, "unit"), tuple(rows))


def _directions(found: Observability) -> Grid:
    names, more = found.problem.model.names, found.added
    heads = ["", "singular\nvalue", *names]
    rows = [_direction(v, d) for v, d in zip(found.singular_values, found.information.directions, strict=True)]
    if more is not None:
        heads.insert(2, "with the\nfurther stations")
        rows = [(*row[:2], number(float(v), 4), *row[2:]) for row, v in zip(rows, more.singular_values, strict=True)]
    rows[0], rows[-1] = ("best seen", *rows[0][1:]), ("worst seen", *rows[-1][1:])
    return Grid("Directions of the first state, in prior sigmas, and their information", tuple(heads), tuple(rows))


def _direction(value: float, direction: np.ndarray[tuple[int], np.dtype[np.float64]]) -> tuple[str, ...]:
    return ("", number(float(value), 4), *(f"{c:+.3f}" for c in direction))


def _twins(found: Observability) -> Grid:
    names = found.problem.model.names
    rows = []
    for i, twin in enumerate(found.twins[:_LISTED]):
        distance = "-" if twin.prior_distance is None else number(twin.prior_distance, 3)
        rows.append((str(i + 1), number(twin.misfit, 2), distance, *(number(float(v), 5) for v in twin.state)))
    heads = ("twin", "misfit\n[sigma]", "from prior\n[sigma]", *names)
    return Grid("Other first states with (nearly) the same measurements", heads, tuple(rows))
