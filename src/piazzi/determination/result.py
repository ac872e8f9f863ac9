"""`Determination`: an orbit, what it left of the measurements, and a verdict on it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from piazzi.determination.analysis import Analysis
from piazzi.determination.beliefs import beliefs
from piazzi.determination.case import Case
from piazzi.determination.holding import Held
from piazzi.determination.orbit import Orbit
from piazzi.determination.sentence import Sentence
from piazzi.determination.setup import Setup, carried
from piazzi.determination.verdict import DECISIVE
from piazzi.earth import Epoch, transform
from piazzi.estimate.estimator import Estimate
from piazzi.evaluate.grids import Grid
from piazzi.evaluate.tabled import Tabled
from piazzi.problem import Problem, Tracking
from piazzi.problem.checks import Array
from piazzi.text import listed, one_line

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes


@dataclass(frozen=True, eq=False)
class Determination(Tabled):
    """Result of `determine`.

    Attributes
    ----------
    setup : what was determined from, and with what
    name, estimates : the estimator whose answer it is, and the estimates of all of them
    keep : (J,), which rows of the tracking were used
    reasons : (J,), why a row was not, "" where it was
    analysis : residuals and derivatives at the answer, None where there is none
    verdict : six sentences by name
    scale : of the time in which `epoch` is told
    frame : axes of the answer
    seconds : of all estimators together
    notes : further facts, as a result tells them: options, files
    case : what was asked for, products among it
    held : what became of rows that were held back and predicted by the others, None where none were
    """

    setup: Setup
    name: str
    estimates: Mapping[str, Estimate]
    keep: Array
    reasons: Array
    analysis: Analysis | None
    verdict: Mapping[str, Sentence]
    scale: str
    frame: str
    seconds: float
    notes: Mapping[str, Any]
    case: Case = field(default_factory=Case)
    held: Held | None = None

    @property
    def estimate(self) -> Estimate:
        """That of the estimator whose answer it is."""
        return self.estimates[self.name]

    @property
    def problem(self) -> Problem:
        """An ordinary problem, for every other function of this package."""
        return self.setup.problem

    @property
    def tracking(self) -> Tracking:
        """Its tracking, of the rows that were used; the others are missing values."""
        return self.estimate.tracking

    @property
    def object(self) -> str:
        """Name of what was determined, "" where nobody says it."""
        return self.setup.measured.object

    @property
    def epoch(self) -> Epoch:
        """Where the answer stands."""
        return self.setup.measured.epoch + float(self.setup.tracking.times[self.setup.solution])

    @property
    def success(self) -> bool:
        """Whether the estimator ended well."""
        return self.estimate.success

    @property
    def determined(self) -> bool:
        """Whether it did, and the orbit is seen, alone and converged, as far as that was tested."""
        return self.success and all(self.verdict[key].ok is not False for key in DECISIVE)

    @property
    def message(self) -> str:
        """What the estimator says, or which sentence of the verdict is false."""
        wrong = [s.sentence for s in self.verdict.values() if s.ok is False]
        if not (self.success and wrong):
            return self.estimate.message
        return "; ".join(text for text in (wrong[0], self.estimate.message) if text)

    @cached_property
    def orbit(self) -> Orbit:
        """The orbit in `frame`."""

        def at(epochs: Sequence[Epoch]) -> tuple[Array, Array]:
            return beliefs(self.setup, self.estimate, epochs)

        return Orbit(self.epoch, self.frame, at, self.setup.measured.centre, self.setup.chosen.choice.eop)

    @property
    def modes(self) -> tuple[dict[str, Any], ...]:
        """Orbits that fit, the most probable first, at the epoch of the answer, which is this one."""
        orbits = self.setup.guess.orbits
        modes = () if orbits is None else orbits.modes
        first = modes[0].probability if modes else 1.0
        found = [{"probability": first, "mean": self.orbit.at().tolist(), "weighted_rms": self.weighted_rms}]
        for mode in modes[1:]:
            mean = carried(self.setup, mode.epoch, mode.mean)
            r, v = transform(mean[:3], mean[3:], "GCRF", self.frame, self.epoch, self.orbit.eop)
            mean = np.concatenate([r, np.asarray(v)])
            found.append({"probability": mode.probability, "mean": mean.tolist(), "weighted_rms": mode.weighted_rms})
        return tuple(found)

    @property
    def weighted_rms(self) -> float | None:
        """Root mean square of the residuals in sigma, of rows that were used."""
        if self.analysis is None:
            return None
        own = self.analysis.whitened[self.keep]
        own = own[np.isfinite(own)]
        return float(np.sqrt(np.mean(own**2))) if own.size else None

    @cached_property
    def residuals(self) -> xarray.Dataset:
        """One entry a measurement: time, station, kind, observed, computed, o_minus_c, sigma, weight, used, reason."""
        from piazzi.determination.residuals import dataset

        return dataset(self)

    def to_dict(self) -> dict[str, Any]:
        """The object of schema piazzi.determine/1."""
        from piazzi.determination.document import document

        return document(self)

    def write(self, path: Any, **options: Any) -> None:
        """Write a product by the suffix of its name, whole or not at all: .oem .opm .ocm .tle .nc .csv .json .toml.

        Options are ``span``, ``step`` and ``formal``, whether covariances are written as computed; default those of `case`.
        """
        from piazzi.determination.products import write

        write(self, path, **options)

    def report(self, path: Any, title: str | None = None) -> Any:
        """Write a page; returns its path."""
        from piazzi.determination.reporting import report

        return report(self, path, title)

    def ephemeris(
        self, span: Any = None, step: Any = None, frame: str | None = None, *, station: Any = None, when: Any = "tonight",
        **seen: Any,
    ) -> Any:  # fmt: skip
        """States and covariances over a span, an `Ephemeris`; with a `station` what it sees of the orbit, as `pz.ephemeris`."""
        if station is not None:
            from piazzi.determination.ephemerides import STEP, ephemeris

            return ephemeris(self, station, when, step=STEP if step is None else step, **seen)
        if seen:
            raise ValueError(f"{next(iter(seen))}: what is seen is seen from somewhere: give station=")
        from piazzi.determination.arcs import ephemeris as states

        return states(self, span, step, frame)

    @cached_property
    def _facts(self) -> Mapping[str, Any]:
        """What `to_dict` says, worked out once for all that shows it."""
        return self.to_dict()

    def headlines(self) -> Iterable[str]:
        """What was determined, and the six sentences."""
        from piazzi.determination.showing import heading

        return heading(self, self._facts)

    def grids(self) -> list[Grid]:
        """State, elements, residuals, rejected rows."""
        from piazzi.determination.showing import grids

        return grids(self, self._facts)

    def sentences(self) -> Iterable[str]:
        """Forces, constants, what was left out and what was assumed."""
        from piazzi.determination.showing import remarks

        return remarks(self._facts)

    def plot(self, ax: Axes | None = None, *, what: str = "residuals", which: str | None = None) -> Axes:
        """Draw it on these axes, or on new ones; returns them.

        Parameters
        ----------
        ax : matplotlib Axes; polar ones for the sky
        what : "residuals", "sigma" (of position along R, T and N), "orbit", "ground-track" or "sky"
        which : the kind of residuals, the plane of the orbit ("xy", "yz", "xz", "space"), the station of a sky; else the first

        Raises
        ------
        ValueError
            For what there is not.
        """
        from piazzi.determination.plotting import plot

        return plot(self, ax, what, which)

    def figures(self, folder: Any, formats: Any = "pdf", width: Any = "88mm") -> Any:
        """Write pictures for papers into a folder; returns their paths."""
        from piazzi.determination.figures import figures

        return figures(self, folder, formats, width)

    def __repr__(self) -> str:
        """In short: of what, by which estimators, from how many rows, and whether an orbit was determined."""
        named = f" of {one_line(self.object, 60)}" if self.object else ""
        used = f"{int(self.keep.sum())} of {len(self.keep)} rows, by {listed(self.estimates)}"
        said = "determined" if self.determined else f"not determined: {one_line(self.message, 150)}"
        return f"<Determination{named} at {self.epoch}, {used}; {said}>"
