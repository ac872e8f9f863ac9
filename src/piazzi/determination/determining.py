"""`determine`: tracking in, an orbit with a tested covariance and a verdict out."""

from __future__ import annotations

import os
import re
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from piazzi.determination.additions import with_unknowns
from piazzi.determination.analysis import Analysis, analysed
from piazzi.determination.approach import approached, refined
from piazzi.determination.burns import burns_of
from piazzi.determination.case import Case
from piazzi.determination.case_file import split
from piazzi.determination.common import BIASES, pass_biases, with_wider_biases
from piazzi.determination.density import with_density
from piazzi.determination.editing import edited
from piazzi.determination.faults import BEYOND, CORRELATED, Faults, named
from piazzi.determination.fit import begun, estimate, estimators
from piazzi.determination.guesses import Guess, from_fixes, guess_of
from piazzi.determination.holding import NONE, Held, held, unasked
from piazzi.determination.instruments import with_instruments
from piazzi.determination.orbit_forces import Chosen, check_forces, chosen_forces, orientation_of
from piazzi.determination.partners import Partner, check_partners, partners_of, with_partners
from piazzi.determination.result import Determination
from piazzi.determination.sensing import Measured, measured, of_object
from piazzi.determination.setup import Setup, at_last_used, posed, setup
from piazzi.determination.sunlight import with_sunlight
from piazzi.determination.unknowns import BIAS, CLOCK, SCALE, asked
from piazzi.determination.verdict import verdict
from piazzi.determination.whiteness import with_white_fixes
from piazzi.earth import Epoch
from piazzi.earth.dates import read_date
from piazzi.earth.rotation import frame_named
from piazzi.estimate.ahead import compile_for
from piazzi.estimate.estimator import Estimate, Estimator
from piazzi.formats import Conventions, Observations, concatenate, read_tracking
from piazzi.formats.conventions import with_conventions
from piazzi.problem.checks import Array

if TYPE_CHECKING:
    from piazzi.determination.earlier import Earlier
    from piazzi.determination.initial_result import InitialOrbits

SOURCES = (str, os.PathLike)
INSTRUMENTS = (BIAS, SCALE, CLOCK)
_OF_ROWS = "--frame {} names the axes of measurements whose file names none, and so not those of the answer"
LOW = 6.8e6  # m: of an orbit on which every force acts
ROUNDS = 4  # of the answer, while rows are left out or taken back


def determine(
    *tracking: Any,
    guess: Any = None,
    prior: Any = None,
    from_: Any = None,
    stations: Any = None,
    participant: Any = None,
    with_: Any = None,
    forces: Any = None,
    estimate: Any = None,
    consider: Any = None,
    manoeuvre: Any = (),
    mass: float | None = None,
    area: float | None = None,
    com: float | None = None,
    epoch: Any = None,
    frame: str | None = None,
    about: str | None = None,
    object: str | None = None,  # noqa: A002  # as everywhere
    hold: Any = None,
    announce: Callable[[str], None] | None = None,
    notes: Mapping[str, Any] | None = None,
    **conventions: Any,
) -> Determination:
    """Determine the orbit of one object from its tracking.

    Parameters
    ----------
    tracking : files, or `Observations`, put together; a file ``.toml`` among them is a case, which the words override
    guess : where to begin: text, ``"a=7078km e=0.001 i=98.2deg raan=10deg argp=0deg nu=0deg epoch=2026-11-03T04:12:00Z"``
        or ``"x=7000km ... vz=7.5km/s epoch=..."``; a file (OEM, OPM, OCM, TLE, OMM, SP3, CPF, a determination's JSON); a
        `Guess`.  None, or "none": all orbits that fit are looked for.
    prior : an orbit of before whose covariance is taken too: a determination, its JSON or .nc, an OEM, OPM or OCM with
        covariances, two-line elements; measurements that it has used already are left out
    from_ : date from which on measurements are new to that prior, where it does not say it
    stations : files, `earth.Station` objects or a `StationList`; "ilrs" are those of the package
    participant : other satellites that took part and whose orbits are given: ``"NAME=FILE"``, files (of all their objects, such
        as an SP3 of navigation satellites), or a mapping from names to files or ephemerides
    with_ : estimators, as the command line writes them; the first is the answer.  Default the graph.
    forces : "default" (by height, as without it), "none", text such as ``"gravity=EGM2008 degree=40 drag=exponential"``, or
        `earth.Forces`
    estimate : further unknowns, as text such as ``"cd/12h cr bias.range.7090/pass=1m clock.BER=1ms"``, or `pz.Estimated`
    consider : constants that are uncertain, ``{"cr": 0.1}``, or text ``"cr=0.1"``
    manoeuvre : text such as ``"2026-11-03T04:12:00Z dv=0,0.3,0m/s axes=RTN sigma=0.05m/s for=600s"``, files (CSV, OPM, OCM)
    mass, area, com : kg, m2; and what a range is shorter by than to the centre of mass, m
    epoch : where the answer stands; default the last measurement
    frame : axes of measurements whose file names none; where every file does, those of the answer, which are else the GCRF,
        about the Sun the ICRF
    about : "earth" or "sun"; default the Sun where directions fit no orbit about the Earth
    object : name of what to determine, in files of several
    hold : rows to predict without them: "last", "passes" (each in turn), or a share such as "1/4"; default each pass where
        there are 3 to 60 and the orbit has no process noise
    announce : called with the name of each step as it begins
    notes : kept in the result: the command
    conventions : what the files do not say, as `read_tracking` takes it: ``range="two-way"``, ``sigma=["range.BER=10m"]``

    Raises
    ------
    OSError
        Where a file cannot be read.
    ValueError
        For what is wrong with the input or open, with the option that says it.
    """
    words = {name: value for name, value in locals().items() if name not in ("tracking", "announce", "notes", "conventions")}
    files, case = split(tracking)
    return determined(files, case.told({**words, **conventions}), announce, notes)


def determined(
    tracking: Sequence[Any],
    case: Case,
    announce: Callable[[str], None] | None = None,
    notes: Mapping[str, Any] | None = None,
) -> Determination:
    """What `determine` returns, of a case."""
    say = announce or (lambda step: None)
    chosen = estimators(case.with_)
    scale, _ = _instant(case.epoch)
    if case.frame:
        frame_named(case.frame)
    say("reading")
    given = prepared(*tracking, case=case)
    if case.output:
        from piazzi.determination.products import check_writable

        check_writable(given.problem, case.output)
    axes = answer_axes(given, case.frame)
    say("approaching")
    centre = given.measured.centre
    return solved(ready(given), chosen, axes or centre.frame, scale or centre.scale, say, notes or {}, case)


def prepared(*tracking: Any, case: Case | None = None, **words: Any) -> Setup:
    """The problem and tracking that `determine` solves, of a case or of the same words; raises as it does."""
    files, told = split(tracking)
    case = told.told(words) if case is None else case
    _, at = _instant(case.epoch)
    seen, chosen, begin, earlier = read(files, case)
    if begin is None:
        from piazzi.determination.unguided import unguided

        begin = unguided(seen, lambda first: posed(seen, chosen(first, still=True), first))
    return setup(seen, chosen(begin), begin, at=at, earlier=earlier)


def ready(given: Setup) -> Setup:
    """The set-up near its answer, with the noise that it shows: of the air where drag matters, of stations, of fixes."""
    near = approached(given)
    found = with_sunlight(with_density(near))
    return with_white_fixes(with_wider_biases(near if found is near else refined(found)))


def fitting_orbits(*tracking: Any, case: Case | None = None, **words: Any) -> InitialOrbits:
    """All orbits that fit a tracking, of the same words as `determine`, whose guess is not asked for."""
    from piazzi.determination.initial import initial_orbits
    from piazzi.determination.unguided import first_look

    files, told = split(tracking)
    case = told.told(words) if case is None else case
    seen, chosen, _, _ = read(files, replace(case, guess=None, prior=None))
    return initial_orbits(posed(seen, chosen(first := first_look(seen), still=True), first), seen.tracking)


def read(
    files: Sequence[Any], case: Case, passes: bool = True
) -> tuple[Measured, Callable[..., Chosen], Guess | None, Earlier | None]:
    """What was measured, the forces on an orbit (`still`: without processes), where to begin if said, the orbit of before.

    Lasers have a bias for each of their `passes`, unless more rows may come.
    """
    wanted, burns = asked(case.estimate, case.consider), burns_of(case.manoeuvre)
    partners = partners_of(case.participant)
    everything = observations_of(files, case.answers)
    check_partners(everything, partners, case.stations)
    rows = of_object(with_partners(everything, partners), case.object)
    rows, earlier = _beside_prior(rows, case)
    seen, begin = _seen(rows, case, earlier, any(one.what.kind == CLOCK for one in wanted), partners)
    if seen.about != "sun":
        check_forces(case.forces)  # an orbit that they are for may be long in coming
    own = [one for one in wanted if one.what.kind in INSTRUMENTS]
    common = pass_biases(seen, own) if passes else []
    seen = with_instruments(seen, [*own, *common])
    seen = replace(seen, assumed=(*seen.assumed, BIASES)) if common else seen

    def chosen(orbit: Guess, still: bool = False) -> Chosen:
        if seen.about == "sun":
            from piazzi.determination.sun_forces import forces_about_the_sun

            found = forces_about_the_sun(case.forces, orbit.state)
        else:
            found = chosen_forces(case.forces, orbit.state, name=seen.object, mass=case.mass, area=case.area)
        return with_unknowns(found, [one for one in wanted if not (still and one.what.is_process)], burns, seen)

    if begin is None and wanted:
        from piazzi.determination.unguided import nominal

        chosen(nominal(seen, LOW))  # what no orbit has is refused before one is looked for
    return seen, chosen, begin, earlier


def _beside_prior(rows: Observations, case: Case) -> tuple[Observations, Earlier | None]:
    """The measurements that are new to the orbit of before, and that orbit; all of them where there is none."""
    since = None if case.from_ is None else Epoch(case.from_)
    if case.prior is None:
        if since is not None:
            raise ValueError("--from says from when on measurements are new to --prior, which is not given")
        return rows, None
    there = rows.t[rows.measured]
    if not len(there):
        raise ValueError("there is no measurement to use")
    first = rows.epoch + float(there.min())
    from piazzi.determination.earlier import earlier_of, fresh

    earlier = earlier_of(case.prior, first if since is None else max(first, since), case.object)
    return fresh(rows, earlier, since), earlier


def _seen(
    rows: Observations, case: Case, earlier: Earlier | None, clocks: bool, partners: Mapping[str, Partner]
) -> tuple[Measured, Guess | None]:
    """What was measured, by the centre that the user, the guess or the measurements say; and the guess where there is one."""

    def by(about: str) -> Measured:
        corrections = case.answers.get("corrections")
        return measured(
            rows,
            case.stations,
            com=case.com,
            corrections=corrections,
            clocks=clocks,
            name=case.object,
            about=about,
            antenna=case.antenna,
            partners=partners,
            eop=orientation_of(case.forces),
        )

    seen = by(case.about or "earth")
    begin = earlier.guess if earlier and case.guess is None else _guess(case.guess, seen, case.object)
    about = begin.about if begin is not None else seen.about
    if case.about is None and begin is None:
        from piazzi.determination.unguided import goes_about_the_sun

        about = "sun" if goes_about_the_sun(seen) else about
    if case.about not in (None, about):
        raise ValueError(f"--about {case.about}: the guess is about the {about.title()}")
    return (seen if about == seen.about else by(about)), begin


def objects_in(tracking: Sequence[Any], case: Case) -> list[str | None]:
    """Names of all objects of files."""
    return list(with_partners(observations_of(tracking, case.answers), partners_of(case.participant)).objects) or [None]


def solved(
    given: Setup,
    chosen: Mapping[str, Estimator],
    frame: str = "GCRF",
    scale: str = "UTC",
    announce: Callable[[str], None] = lambda step: None,
    notes: Mapping[str, Any] | None = None,
    case: Case | None = None,
) -> Determination:
    """The determination of a problem by estimators, of which the first is the answer."""
    found: dict[str, Estimate] = {}
    started = time.perf_counter()
    answer = next(iter(chosen))
    announce(answer)
    compile_for(given.problem, [begun(given, estimator) for estimator in chosen.values()])
    keep, reasons, found[answer], analysis = _answered(given, chosen[answer])
    for name, estimator in list(chosen.items())[1:]:
        announce(name)
        found[name] = estimate(given, estimator, keep)
    seconds = time.perf_counter() - started
    announce("testing")
    case = Case() if case is None else case
    given = at_last_used(given, keep) if case.epoch is None else given
    faults = _faults(given, found[answer], analysis, keep, reasons)
    unseen = _unseen(given, chosen[answer], found[answer], analysis, keep, case.hold)
    sentences = verdict(given, answer, found, analysis, keep, faults, unseen)
    return Determination(
        given, answer, found, keep, faults.reasons, analysis, sentences, scale, frame, seconds, dict(notes or {}), case, unseen
    )


def _faults(given: Setup, answer: Estimate, analysis: Analysis | None, keep: Array, reasons: Array) -> Faults:
    """Why rows are not used, looked into where an orbit without process noise says it."""
    if analysis is None or answer.view != "delayed" or not given.problem.is_noise_free or (reasons == "").all():
        return Faults(reasons, ())
    return named(given, answer.mean, keep, reasons)


def _unseen(
    given: Setup, estimator: Estimator, answer: Estimate, analysis: Analysis | None, keep: Array, hold: str | float | None
) -> Held | None:
    """What rows that are held back say of the answer; None where there is nothing to hold back."""
    how = hold or unasked(given, keep)
    if how in (None, NONE) or analysis is None or not answer.success:
        return None
    if given.problem.is_noise_free and answer.view != "delayed":
        return None
    found = held(given, estimator, answer, analysis, keep, how)
    return found if found.groups or hold else None


def _answered(given: Setup, estimator: Estimator) -> tuple[Array, Array, Estimate, Analysis | None]:
    """Rows that are kept, why the others are not, the answer from these, and what it leaves: edited until nothing changes."""
    keep = np.ones(len(given.rows), dtype=np.bool_)
    reasons = np.full(len(keep), "", dtype=np.object_)
    if given.spare is not None:
        keep, reasons[given.spare] = ~given.spare, CORRELATED
    first = analysis_at(given, given.states)
    robust = getattr(estimator, "loss", None) is not None  # it weighs rows itself
    if first is not None and not robust:
        keep, reasons = edited(given, first)
    for left in reversed(range(ROUNDS)):
        answer = estimate(given, estimator, keep)
        analysis = analysis_at(given, answer.mean) if answer.view == "delayed" else first
        if analysis is None or robust or answer.view != "delayed":
            return *_gated(answer, keep, reasons), answer, analysis
        again, why = edited(given, analysis, keep)
        if not left or (again == keep).all():
            break
        keep, reasons = again, why
    return keep, reasons, answer, analysis


def _gated(answer: Estimate, keep: Array, reasons: Array) -> tuple[Array, Array]:
    """Which rows are kept, and why not the others, with those that a filter's gate rejected."""
    rejected = answer.details.get("rejected")
    if rejected is None or not np.any(rejected):
        return keep, reasons
    own = np.asarray(rejected, dtype=np.bool_) & keep
    reasons = np.where(own, BEYOND, reasons)
    return keep & ~own, reasons


def analysis_at(given: Setup, states: Array) -> Analysis | None:
    """None where the states are not finite, or cannot be linearised about."""
    if not np.isfinite(states).all():
        return None
    found = analysed(given, states)
    there = ~np.isnan(given.tracking.values)
    return found if np.isfinite(found.whitened[there]).all() and np.isfinite(found.rows[there]).all() else None


def observations_of(tracking: Sequence[Any], told: Mapping[str, Any]) -> Observations:
    """Measurements of files and objects, put together, with what is told of those of files."""
    if not tracking:
        raise ValueError("there is no tracking: name a file")
    paths = [t for t in tracking if isinstance(t, SOURCES)]
    ready = [t for t in tracking if not isinstance(t, SOURCES)]
    for one in ready:
        if not isinstance(one, Observations):
            raise ValueError(f"tracking is a file or Observations, not a {type(one).__name__}")
    return concatenate([*([_of_files(paths, told)] if paths else []), *ready])


def _of_files(paths: Sequence[Any], told: Mapping[str, Any]) -> Observations:
    rest = {name: value for name, value in told.items() if name != "frame"}
    return settled_axes(read_tracking(*paths, **rest), told.get("frame"))


def settled_axes(rows: Observations, frame: str | None) -> Observations:
    """Measurements whose axes are those of ``--frame`` where their file names none, as is told then."""
    if frame is None or not any("--frame" in text for text in rows.open):
        return rows
    named = with_conventions(rows, Conventions.of(frame=frame))
    return replace(named, assumed=(*named.assumed, _OF_ROWS.format(frame)))


def answer_axes(given: Setup, frame: str | None) -> str | None:
    """The axes of the answer that ``--frame`` names, None where it names none, or those of the measurements."""
    return None if frame is None or _OF_ROWS.format(frame) in given.assumed else frame_named(frame)


def _instant(epoch: Any) -> tuple[str | None, Epoch | None]:
    """The scale to tell dates in, where it is said, and where the answer stands."""
    if epoch is None:
        return None, None
    return read_date(epoch).scale if isinstance(epoch, str) else None, Epoch(epoch)


def _guess(given: Any, seen: Measured, chosen: str | None) -> Guess | None:
    """The user's, or what fixes give by themselves; None where there is neither."""
    if given is not None and given != "none":
        return guess_of(given, seen.first, chosen or seen.object or None, seen.about)
    wide = {s.name for s in seen.stations if s.sensor.startswith("position")}
    own = np.isin(seen.tracking.row_stations, list(wide)) & np.isfinite(seen.tracking.values[:, :3]).all(axis=1) if wide else []
    if not np.any(own):
        from piazzi.determination.pseudoranges import positions

        found = from_fixes(seen.epoch, *positions(seen.stations, seen.tracking))
        return None if found is None else replace(found, source="the pseudoranges")
    return from_fixes(seen.epoch, seen.tracking.row_times[own], seen.tracking.values[own, :3])


def plain_command(words: Sequence[str]) -> str:
    """The command as a shell takes it, on one line."""
    quoted = [word if re.fullmatch(r"[\w@%+=:,./~-]+", word) else "'" + word.replace("'", "'\\''") + "'" for word in words]
    return " ".join(quoted)
