"""One door for everything that holds a problem and its measurements."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Mapping, Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from piazzi.problem import Problem, Tracking
from piazzi.problem.inputs import prepare
from piazzi.scenarios import Recording, load_scenario, names
from piazzi.scenarios.loader import tables_of

KINDS = (".npz", ".nc", ".csv", ".toml")


WORDS = {"chosen": "object", "participants": "participant"}  # of a `Recording`, as options call them


def load(
    source: str | os.PathLike[str],
    *,
    seed: int = 0,
    scenario: str | os.PathLike[str] | None = None,
    scale: str | None = None,
    columns: Mapping[str, str] | str | None = None,
    stations: Any = None,
    participant: Any = (),
    object: str | None = None,  # noqa: A002  # as everywhere
    sigma: str | Sequence[str] = (),
    **conventions: Any,
) -> tuple[Problem, Tracking]:
    """Problem and tracking of a recording, of a file of tracking, or of a scenario simulated with `seed`.

    Parameters
    ----------
    source : name of a built-in scenario, or a path
        ``.npz`` (founding layout), ``.nc``, ``.csv`` (with `scenario`), a scenario's ``.toml``, or with `scenario` any file
        that `read_tracking` knows (TDM, CRD, SP3, ...); a ``.csv`` is one too where the scenario has no stations of its own.
    seed : int
        Of the simulation; recordings do not use it.
    scenario : name or path, optional
        The problem that a ``.csv`` or file of tracking measures.
    scale : UTC, TAI, TT, TDB, TCG, GPS or UT1, optional
        Of dates in a ``.csv`` that name none; default what the scenario's [recording] says.
    columns : mapping of a name here to a column of the file, or text such as ``"range=RNG[km] week=gps_week sow=gps_tow"``
        For a ``.csv`` with other names; default what the scenario's [recording] says.
    stations, participant, object, sigma, conventions
        Files of stations, orbits of other satellites (``"NAME=FILE"``), name, texts such as ``"range.BER=10m"``, ``frame``,
        ``range``, ...: what files of tracking do not say, as `read_tracking` takes it; default what the scenario's [recording]
        says.

    Dates become seconds past the problem's epoch.  One without an epoch, whose prior is at the first measurement, gets that of
    the file.

    The prior of a scenario stands at the start of its ``[times]``, or at the ``time`` of its ``[prior]``.  For a recording that
    begins before that it is propagated back, see `with_prior_at`; for one that begins later, estimators propagate it forward.

    Raises
    ------
    OSError
        Where the file cannot be read.
    ValueError
        For an unknown scenario or a file with something wrong in it: what, the value, and where.
    """
    listed = {"sigma": sigma, "stations": () if stations is None else stations, "participants": participant}
    texts = {name: (given,) if isinstance(given, str | os.PathLike) else tuple(given) for name, given in listed.items()}
    frame = conventions.pop("frame", None)
    said = Recording(_mapping(columns), scale, object, frame=frame, answers=conventions, **texts)
    if is_tracking(os.fspath(source), scenario):
        from piazzi.determination.recorded import recorded

        assert scenario is not None, "files of tracking have one"
        return recorded(source, scenario, said)
    problem, tracking = _loaded(os.fspath(source), seed, scenario, said)
    with contextlib.suppress(ValueError):  # estimators say what does not fit
        prepare(problem, tracking)
    return problem, tracking


def words_of(said: Recording) -> dict[str, Any]:
    """The same as words for `load`."""
    own = {f.name: getattr(said, f.name) for f in fields(said) if f.name != "answers"}
    return {**said.answers, **{WORDS.get(name, name): value for name, value in own.items()}}


def is_tracking(source: str, scenario: str | os.PathLike[str] | None) -> bool:
    """Whether a source is a file of tracking that a scenario makes a problem of: no recording, and no scenario itself."""
    if not scenario or source in ("-", *names()):
        return False
    if source.lower().endswith(".csv"):
        return "stations" not in tables_of(scenario)[0]
    return not source.lower().endswith(KINDS)


def _with_prior_before(text: str, problem: Problem, tracking: Tracking) -> tuple[Problem, Tracking]:
    """The same with the prior no later than the first measurement."""
    first = float(tracking.times[0])
    if problem.prior_time is None or problem.prior_time <= first:
        return problem, tracking
    from piazzi.estimate.prior import with_prior_at

    try:
        return with_prior_at(problem, first), tracking
    except ValueError as error:
        raise ValueError(f"{text}: {error}") from None


def _mapping(columns: Mapping[str, str] | str | None) -> Mapping[str, str]:
    if not isinstance(columns, str):
        return columns or {}
    from piazzi.tables.names import parse_columns

    return parse_columns(columns)


def _loaded(text: str, seed: int, scenario: str | os.PathLike[str] | None, said: Recording) -> tuple[Problem, Tracking]:
    kind = Path(text).suffix.lower()
    taken = ("columns", "scale") if kind == ".csv" else ()
    usual = Recording()
    others = (f.name for f in fields(said) if f.name not in taken and getattr(said, f.name) != getattr(usual, f.name))
    if given := next(others, None):
        word = next(iter(said.answers)) if given == "answers" else WORDS.get(given, given)
        raise ValueError(f"{text}: --{word} is for files of tracking, with --scenario")
    if scenario is not None and kind != ".csv":
        raise ValueError(f"{text}: only a .csv file is loaded with a scenario; this one holds its own problem")
    if kind == ".npz":
        from piazzi.io.npz import read_npz

        return read_npz(text)
    if kind == ".nc":
        from piazzi.io.netcdf import read_netcdf

        return _with_prior_before(text, *read_netcdf(text))
    if kind == ".csv":
        from piazzi.io.csv import read_csv

        if scenario is None:
            raise ValueError(f"{text}: name the scenario that this .csv file measures: {', '.join(names())}, or a path")
        found = load_scenario(scenario)
        problem = found.problem
        tracking = read_csv(text, problem, said.scale, said.columns, found.recording)
        if problem.epoch is None and tracking.epoch is not None:
            problem = replace(problem, epoch=tracking.epoch)
        return _with_prior_before(text, problem, tracking)
    if kind != ".toml" and os.path.isfile(text):
        raise ValueError(f"{text}: files end in {', '.join(KINDS)}, not {kind!r}; those of tracking need a scenario")
    from piazzi.determination.case_file import refuse_case

    refuse_case(text)
    found = load_scenario(text)
    from piazzi.simulation import simulate

    return found.problem, simulate(found.problem, found.times, np.random.default_rng(seed))
