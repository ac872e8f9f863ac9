"""From a study to its store: begin or continue, run, finish."""

from __future__ import annotations

import os
from contextlib import suppress
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any

from piazzi.io.atomic import check_writable
from piazzi.kernels.ahead import processors
from piazzi.scenarios import load_scenario
from piazzi.study.extending import begun, longer
from piazzi.study.log import ENDING, Log
from piazzi.study.plan import Plan
from piazzi.study.pool import Processes, ThisProcess, Workers
from piazzi.study.resume import checks, difference
from piazzi.study.runner import Progress, Runner
from piazzi.study.store import Stored, read_store
from piazzi.study.storing import write_store
from piazzi.study.versions import fingerprint
from piazzi.text import brief


class Study(Plan):
    """Simulate, estimate and score `runs` seeds at every point of a grid.

    Parameters
    ----------
    problem : Problem, with its truth half
    times : (K,) seconds, strictly increasing
    estimators : names as on the command line, or a mapping of the name to show to such a name or an estimator
    runs : int
    seed : int
        Of everything.  Draws of prior, process and measurement noise of a run are children of it by the run's number: a run is
        the same whatever else is run, and at every point of the grid.
    vary : mapping of name to values
        Settings of estimators (``lag``, ``iterations``, ``gate``, ...), each for those that have it; ``R.scale``,
        ``R.STATION.scale``, ``Q.scale``, ``P.scale``, ``substeps`` and parameters by name, for the problem.  A number of the
        problem changes what estimators believe and what happens; with ``assumed.`` or ``truth.`` before it, one of the two.
    name : str, for the record

    Raises
    ------
    ValueError
        For unknown names (with the nearest), values that do not fit, or a grid beyond reason.
    """

    __repr__ = brief

    @classmethod
    def of(cls, scenario: str | os.PathLike[str], **changes: Any) -> Study:
        """The study of a scenario, by name or path: as its section [study] says, with these changes."""
        found = load_scenario(scenario)
        plan = found.study
        given: dict[str, Any] = {
            "estimators": plan.estimators or ("ekf",),
            "runs": plan.runs or 100,
            "vary": plan.vary,
            "name": found.name,
        } | changes
        return cls(found.problem, found.times, **given)

    def run(self, path: str | os.PathLike[str], **options: Any) -> Stored:
        """Run into a NetCDF file; see `piazzi.study.execute.run_study` for the options."""
        return run_study(self, path, **options)


def run_study(
    study: Plan,
    path: str | os.PathLike[str],
    *,
    resume: bool = False,
    workers: int | None = None,
    scheduler: str | None = None,
    chunk: int | None = None,
    progress: Progress | None = None,
) -> Stored:
    """Run a study into a NetCDF file.

    While it runs, finished runs are in a file beside it, `path` with ``.runs`` behind, from which an interrupted study goes on.

    Parameters
    ----------
    study : Study
    path : of the store, ``.nc``
    resume : continue what is there, be it of fewer runs; a finished study is read, nothing is computed twice
    workers : processes, default one for each processor; 0 runs in this one
    scheduler : address of a Dask scheduler, or "local" to start a cluster of `workers` processes here
    chunk : runs per task; default as many as take about a second
    progress : called with the runs that are done and their total

    Raises
    ------
    OSError
        Where the store cannot be written (what is finished is kept), or the scheduler not reached.
    ValueError
        For a store of another study, or one that is there already without `resume`.
    RuntimeError
        Where workers cannot run anything.
    """
    for what, value, least in (("workers", workers, 0), ("chunk", chunk, 1)):
        if value is not None and (value != int(value) or value < least):
            raise ValueError(f"{what} is {value}; it must be a whole number of {least} or more")
    store = Path(path)
    if store.suffix.lower() != ".nc":
        raise ValueError(f"{os.fspath(path)}: a study is kept in a .nc file")
    check_writable(store)
    found = _found(study, store, resume)
    log_path = store.with_name(store.name + ENDING)
    if found is not None and found.about["specification"]["runs"] == study.runs:
        _tidy(study, log_path)
        return found
    log = _log(study, log_path, resume, found)
    try:
        team = _workers(study, workers, scheduler)
        try:
            import_module("h5netcdf")  # now, while the workers start, and not when everybody waits for the file
            Runner(study, log, team, chunk, progress).run()
        finally:
            team.close()
        write_store(store, study, log)
        log.remove()
    finally:
        if log.entries:
            log.close()
        else:
            log.remove()
    return read_store(store)


def kept_runs(path: str | os.PathLike[str]) -> int:
    """Runs of an interrupted study that are on disk; 0 where there is none."""
    try:
        log = Log.open(Path(os.fspath(path) + ENDING))
    except (OSError, ValueError):
        return 0
    log.close()
    return sum(entry.task.count for entry in log.entries)


def _found(study: Plan, store: Path, resume: bool) -> Stored | None:
    """The store, where it is there and of this study; it may have fewer runs."""
    if not store.exists():
        return None
    found = read_store(store)
    there = found.about["specification"]
    fewer = there["runs"] < study.runs
    differs = difference(there | ({"runs": study.runs} if fewer else {}), study.specification)
    if differs:
        raise ValueError(f"{store} holds another study: {differs}")
    if resume:
        return found
    if fewer:
        more = study.runs - there["runs"]
        raise ValueError(f"{store} holds {there['runs']:,} runs of this study: --resume adds the {more:,} that are missing")
    raise ValueError(f"{store} holds this study, finished: --resume shows it, another name or no file there runs it anew")


def _tidy(study: Plan, path: Path) -> None:
    """Remove the log of a study whose end came between the store and that; one of more runs stays."""
    with suppress(OSError, ValueError):
        log = Log.open(path)
        if log.specification.get("runs") == study.runs:
            log.remove()
        log.close()


def _log(study: Plan, path: Path, resume: bool, found: Stored | None = None) -> Log:
    if not path.exists():
        new = study.specification | {"versions": fingerprint()}
        return Log.create(path, new) if found is None else begun(study, found, path)
    if not resume:
        raise ValueError(f"{path} has runs of a study that was not finished: --resume continues it, removing it starts again")
    check = partial(checks, study, path)
    log = Log.open(path, check)
    return log if log.specification["runs"] == study.runs else longer(study, log, check)


def _workers(study: Plan, workers: int | None, scheduler: str | None) -> Workers:
    if scheduler is not None:
        from piazzi.study.cluster import Cluster

        return Cluster(study, scheduler, workers)
    if workers == 0:
        return ThisProcess(study)
    return Processes(study, workers or processors())
