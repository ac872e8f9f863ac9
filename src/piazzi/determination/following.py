"""Tracking as it comes: an orbit that is determined from its first rows, and carried on by a filter or a window row by row."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from piazzi.determination.approach import approached
from piazzi.determination.case import Case
from piazzi.determination.case_file import split
from piazzi.determination.determining import analysis_at, answer_axes, observations_of, read, settled_axes, solved
from piazzi.determination.faults import Faults
from piazzi.determination.fit import estimators
from piazzi.determination.guesses import Guess
from piazzi.determination.initial_result import UndeterminedError
from piazzi.determination.live import Live, Taken
from piazzi.determination.orbit_forces import Chosen, orientation_of
from piazzi.determination.partners import partners_of, with_partners
from piazzi.determination.result import Determination
from piazzi.determination.sensing import Measured, measured, of_object
from piazzi.determination.setup import Setup, posed, setup
from piazzi.determination.sites import sites_of
from piazzi.determination.unguided import unguided
from piazzi.determination.unknowns import CLOCK, Estimated, asked, listed
from piazzi.determination.verdict import verdict
from piazzi.estimate.factor_graph import FactorGraph
from piazzi.evaluate.consistency_tests import standardized
from piazzi.formats import Observations, concatenate
from piazzi.formats.streaming import Lines, is_mark, reader
from piazzi.problem.checks import Array

USUAL = "ekf:gate"  # the estimator where nobody names one
FEWEST = 6  # values that an orbit is looked for in
WRONG = "a whole run"


def _silent(step: str) -> None:
    """Say nothing of a step."""


class Following:
    """A determination in progress: `take` rows as they come, `determination` at any time.

    Parameters
    ----------
    tracking : files to begin from; without any, or where they do not suffice, the first rows of the stream do
    words : as `determine` takes them.  ``with_`` is one filter or window, default ``"ekf:gate"``; ``prior`` begins at once from
        an orbit with its covariance, all else from a determination of the first rows

    Attributes
    ----------
    waiting : why nothing is determined yet, "" once it is

    Raises
    ------
    ValueError
        For words that mean a whole run, such as ``estimate="cd/12h"``, and an estimator that does not go row by row.
    """

    def __init__(self, *tracking: Any, case: Case | None = None, **words: Any) -> None:
        files, told = split(tracking)
        self.case = told.told(words) if case is None else case
        chosen = estimators(self.case.with_ or USUAL)
        self.name, self.estimator = next(iter(chosen.items()))
        if len(chosen) > 1 or not callable(getattr(self.estimator, "start", None)):
            names = ", ".join(chosen)
            raise ValueError(f"--follow with {names}: it takes one that goes row by row: ekf, iekf, srekf, ukf or window:6h")
        self._check()
        self.announce: Callable[[str], None] = _silent
        self.waiting, self._began, self._tried = "there are no measurements yet", time.perf_counter(), FEWEST // 2
        self._pending = [observations_of(files, self.case.answers)] if files else []
        self._seen: list[Observations] = []
        self._given: Setup | None = None
        self._live: Live | None = None
        self._sites = sites_of(self.case.stations)
        self._partners = partners_of(self.case.participant)
        self._unknowns = asked(self.case.estimate, self.case.consider)

    def _told(self) -> Case:
        """The case with stations and orbits that were read once."""
        return replace(self.case, stations=self._sites, participant=self._partners or None)

    def _check(self) -> None:
        """Refuse what a run row by row cannot have."""
        case = self.case
        for one in asked(case.estimate, case.consider):
            if one.role == "considered":
                raise ValueError(f"--follow: --consider {one.what} needs {WRONG}: estimate it, or leave it")
            if one.what.per is not None and not one.what.is_process:
                other = "" if one.what.kind else f", or {one.what.name}~12h"
                raise ValueError(f"--follow: {one.what.label} is of {WRONG}: write {one.what.name}{other}")
        for option, value in (("--epoch", case.epoch), ("--hold", case.hold), ("--each", case.each or None)):
            if value is not None:
                raise ValueError(f"--follow: {option} is of {WRONG}; the answer stands at the last measurement used")

    # ---- rows ----------------------------------------------------------------------------------------------------

    def take(self, rows: Observations | None = None, last: bool = False) -> list[Taken]:
        """Rows as they came; what became of each that was measured, of earlier ones too that waited for an orbit.

        `last` says that no more come, so that an orbit is looked for in however few there are.

        Raises
        ------
        ValueError
            For what rows leave open, with the option that says it, and where the estimate cannot be used any more.
        """
        if rows is not None and rows.measured.any():
            if self._live is not None:
                return self._carried(rows)
            self._pending.append(rows)
        if self._live is not None or not self._pending:
            return []
        return self._begun(concatenate(self._pending), last)

    def read(self, lines: Iterable[bytes | str], name: str = "the stream") -> Iterator[Taken]:
        """What becomes of the rows of a TDM or a table whose lines come one by one."""
        stream = self.lines(name)
        for line in lines:
            data = line.encode() if isinstance(line, str) else line
            if is_mark(data):
                yield from self.take(stream.measurements(all_of_them=True))
            stream.add(data)
            yield from self.take(stream.measurements())
        yield from self.take(stream.measurements(all_of_them=True), last=True)

    def lines(self, name: str) -> Lines:
        """What makes measurements of lines, by the conventions of this determination."""
        frame = self.case.frame
        axes = reader(self.case.answers, lambda rows: settled_axes(rows, frame))
        return Lines(name, axes, bool(self.case.answers.get("columns")))

    def _begun(self, rows: Observations, last: bool) -> list[Taken]:
        """An orbit of the first rows, or of the prior; nothing while they do not determine one."""
        seen, chosen, guess, earlier = read([rows], self._told(), passes=False)
        count = int(np.isfinite(seen.tracking.values).sum())
        if earlier is None and not last and count < 2 * self._tried:
            self.waiting = f"{count} values do not determine an orbit yet"
            return []
        self._tried = count
        keep, reasons = np.ones(len(seen.tracking.values), dtype=np.bool_), np.full(len(seen.tracking.values), "", dtype=object)
        try:
            begin = guess or unguided(seen, lambda first: posed(seen, chosen(first, still=True), first))
            given = approached(setup(seen, self._with_air(rows, chosen, begin), begin, earlier=earlier))
            if earlier is None:
                self.announce("determining")
                found = solved(given, {"graph": FactorGraph()}, case=replace(self.case, hold=None))
                if not found.determined:
                    self.waiting = found.message
                    return []
                keep, reasons = found.keep, found.reasons
        except (UndeterminedError, ValueError) as error:
            self.waiting = " ".join(str(error).split())
            return []
        self.waiting, self._given = "", given
        self._live = Live(given, self.estimator)
        return self._fed(given.measured, keep, reasons)

    def _with_air(self, rows: Observations, chosen: Callable[[Guess], Chosen], begin: Guess) -> Chosen:
        """The forces on an orbit, with the density of the air as a process where there is drag: a stream has no last row."""
        found = chosen(begin)
        air, said = found.air_varies, any(one.what.name == "cd" and one.what.is_process for one in self._unknowns)
        if air is None or said:
            return found
        told = [*listed(self.case.estimate), Estimated("cd", f"~{air.time:.0f}s", air.sigma)]
        found = read([rows], replace(self._told(), estimate=told), passes=False)[1](begin)
        text = f"density of the air departs by {air.sigma:.0%}, correlated over {air.time / 3600.0:.3g} h"
        return replace(found, assumed=(*found.assumed, text))

    def _carried(self, rows: Observations) -> list[Taken]:
        """More rows, taken by the estimate in progress."""
        assert self._given is not None and self._live is not None
        own = of_object(with_partners(rows, self._partners), self.case.object)
        if not (own.measured & own.used).any():
            return []
        seen = self._measured(own)
        self._live.widen(seen)
        return self._fed(seen, None, None)

    def _fed(self, seen: Measured, keep: Array | None, reasons: Array | None) -> list[Taken]:
        assert self._live is not None
        self._seen.append(seen.observations)
        return self._live.take(seen, keep, reasons)

    def _measured(self, rows: Observations) -> Measured:
        """Rows as the problem takes them, from its time zero on; of constants of instruments those that it has."""
        assert self._given is not None
        case, first = self.case, self._given.measured
        seen = measured(
            rows, self._sites, com=case.com, corrections=case.answers.get("corrections"),
            clocks=any(one.what.kind == CLOCK for one in self._unknowns), name=case.object or first.object or None,
            about=first.about, antenna=case.antenna, epoch=first.epoch, partners=self._partners,
            eop=orientation_of(case.forces),
        )  # fmt: skip
        return self._live.with_constants(seen) if self._live else seen

    # ---- the answer ----------------------------------------------------------------------------------------------

    @property
    def success(self) -> bool:
        """Whether an orbit is being carried on."""
        return self._live is not None and self._live.session.success

    def determination(self, notes: Any = None) -> Determination:
        """The orbit as it is known now, with its residuals and verdict.

        Raises
        ------
        ValueError
            Where nothing is determined yet.
        """
        if self._live is None or self._given is None:
            raise ValueError(f"not determined: {self.waiting}")
        seen = self._measured(concatenate(self._seen))
        given, estimate, keep, reasons = self._live.whole(seen, time.perf_counter() - self._began)
        analysis, centre = analysis_at(given, given.states), given.measured.centre
        if analysis is not None and not given.problem.is_noise_free:  # no orbit is what all rows are of: what was predicted is
            told = standardized(estimate.innovations, estimate.innovation_covariances)
            analysis = replace(analysis, whitened=np.where(np.isnan(told), analysis.whitened, told))
        sentences = verdict(given, self.name, {self.name: estimate}, analysis, keep, Faults(reasons, ()), None)
        return Determination(
            given, self.name, {self.name: estimate}, keep, reasons, analysis, sentences, centre.scale,
            answer_axes(given, self.case.frame) or centre.frame, estimate.seconds, dict(notes or {}), self.case, None,
        )  # fmt: skip
