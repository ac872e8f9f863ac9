"""Tasks on a Dask cluster: one that is there already, or one started here for the purpose."""

from __future__ import annotations

import logging
import os
import pickle
import time
from collections import Counter
from collections.abc import Callable
from concurrent.futures import CancelledError
from contextlib import suppress
from functools import lru_cache
from queue import Empty, SimpleQueue
from threading import Thread
from typing import TYPE_CHECKING, Any, NoReturn, TypeVar

from piazzi.kernels.ahead import processors
from piazzi.study.pieces import run_task
from piazzi.study.plan import Plan
from piazzi.study.pool import ENVIRONMENT, Outcome
from piazzi.study.tasks import Piece, Task
from piazzi.study.versions import difference_of, fingerprint

if TYPE_CHECKING:
    from distributed import Client, Future

T = TypeVar("T")
LOCAL = "local"
CONNECT_SECONDS = 5  # a dead address fails within ten, however it is dead and with all imports
COUNT_SECONDS = 2.0
WORKERS_SECONDS = 30  # until a scheduler has its first worker
SILENCE_SECONDS = 60.0  # a scheduler that answers nothing for so long is given up
LOSSES = 3  # times that a task is run again because its worker was gone before its results were fetched


class Cluster:
    """Tasks as a cluster's futures.

    Parameters
    ----------
    study : Plan
    address : of a scheduler, ``tcp://host:8786``, or "local"
    workers : processes of a local cluster
    silence : seconds after which a scheduler that answers nothing is given up

    Raises
    ------
    OSError
        Where the scheduler does not answer, here or later.
    ValueError
        Where Dask is not installed, the address makes no sense, or workers have other versions than this process.
    """

    def __init__(self, study: Plan, address: str, workers: int | None, silence: float = SILENCE_SECONDS) -> None:
        try:
            import distributed  # noqa: F401
        except ImportError:
            raise ValueError(
                "--scheduler needs Dask, which is not installed: pip install 'piazzi[cluster]', here and on the workers"
            ) from None
        _silence_dask()
        self._study, self._here = pickle.dumps(study), fingerprint()
        self._futures: dict[str, tuple[Future, Task]] = {}
        self._done: SimpleQueue[str] = SimpleQueue()
        self._losses: Counter[Task] = Counter()
        self._slots, self._counted = 1, -COUNT_SECONDS
        self._silence, self._heard = silence, time.monotonic()
        self._environment = {name: os.environ.get(name) for name in ENVIRONMENT}
        try:
            self._cluster = _local(workers) if address == LOCAL else None
            self.address = self._cluster.scheduler_address if self._cluster else address
            self._client = _client(self.address)
            _check_versions(self._client, self.address, self._here, silence)
        except BaseException:
            self.close()
            raise

    @property
    def slots(self) -> int:
        """Threads of all workers there are, asked for again every few seconds."""
        if time.monotonic() > self._counted + COUNT_SECONDS:
            try:
                self._slots = max(1, int(sum(_with_timeout(self._silence, self._client.nthreads).values())))
            except TimeoutError:
                self._raise_lost(f"has not answered for {self._silence:g} s")
            except OSError:
                self._raise_lost()
            self._counted = time.monotonic()
        return self._slots

    def submit(self, task: Task) -> None:
        future = self._client.submit(_run, self._here, self._study, task, pure=False)
        self._futures[future.key] = (future, task)
        future.add_done_callback(lambda done: self._done.put(done.key))

    def wait(self) -> list[Outcome]:
        while True:
            self._check_connected()
            try:
                key = self._done.get(timeout=1)
            except Empty:
                if time.monotonic() > self._heard + CONNECT_SECONDS:
                    self._check_answers()
                continue
            future, task = self._futures.pop(key)
            outcome = self._outcome(future, task)
            if outcome is not None:
                return [outcome]
            self.submit(task)

    def close(self) -> None:
        for thing in (getattr(self, "_client", None), getattr(self, "_cluster", None)):
            if thing is not None:
                with suppress(Exception):
                    thing.close(timeout=3)
        for name, value in self._environment.items():
            if value is not None:
                os.environ[name] = value
            else:
                os.environ.pop(name, None)

    def _outcome(self, future: Future, task: Task) -> Outcome | None:
        """What became of a task, None where its results were lost with a worker and it has to run again."""
        from distributed.scheduler import KilledWorker

        if future.status in ("cancelled", "lost"):
            return self._lost(task)
        try:
            result = future.result(timeout=CONNECT_SECONDS)
        except KilledWorker:
            return Outcome(task, died="worker lost")
        except (TimeoutError, CancelledError):
            return self._lost(task)
        except Exception as error:
            return Outcome(task, error=f"{type(error).__name__}: {' '.join(str(error).split())}")
        if isinstance(result, Piece):
            return Outcome(task, result)
        return Outcome(task, error=str(result), fatal=True)

    def _lost(self, task: Task) -> Outcome | None:
        """The same where a task was finished and its results are not to be had: the worker is gone, or the scheduler is."""
        self._check_answers()
        self._losses[task] += 1
        if self._losses[task] <= LOSSES:
            return None
        return Outcome(task, died="lost before its results were fetched")

    def _check_connected(self) -> None:
        if self._client.status not in ("running", "connecting"):
            self._raise_lost()

    def _check_answers(self) -> None:
        """Raise where the scheduler, asked for as long as it may be silent, says nothing: it is stopped, or out of reach."""
        end = time.monotonic() + self._silence
        while True:
            self._check_connected()
            try:
                _check_reachable(self.address)
            except ConnectionError:
                if time.monotonic() < end:
                    continue
                self._raise_lost(f"has not answered for {self._silence:g} s")
            self._heard = time.monotonic()
            return

    def _raise_lost(self, how: str = "is gone") -> NoReturn:
        raise ConnectionError(f"the scheduler at {self.address} {how}; what was finished is kept")


def _silence_dask() -> None:
    """Leave it to this module to say what is wrong: Dask gives loggers below its first levels of their own."""
    known = [name for name in logging.root.manager.loggerDict if name.startswith("distributed.")]
    for name in ("distributed", "tornado.application", "asyncio", *known):
        logging.getLogger(name).setLevel(logging.CRITICAL)


def _with_timeout(seconds: float, call: Callable[..., T], *arguments: Any) -> T:
    """What a call returns that may never return; raises TimeoutError where it takes longer."""
    results: SimpleQueue[tuple[bool, Any]] = SimpleQueue()

    def answer() -> None:
        try:
            results.put((True, call(*arguments)))
        except BaseException as error:
            results.put((False, error))

    Thread(target=answer, daemon=True).start()
    try:
        succeeded, result = results.get(timeout=seconds)
    except Empty:
        raise TimeoutError(f"no answer for {seconds:g} s") from None
    if not succeeded:
        raise result
    found: T = result
    return found


def _local(workers: int | None) -> Any:
    """A cluster of single-threaded processes on this machine, which inherit `ENVIRONMENT` from this process."""
    import dask
    from distributed import LocalCluster

    # a worker that dies takes its task with it at once: how often it is tried again is decided here
    dask.config.set({"distributed.scheduler.allowed-failures": 0, "distributed.comm.timeouts.connect": "10s"})
    os.environ.update(ENVIRONMENT)
    return LocalCluster(
        n_workers=workers or processors(), threads_per_worker=1, silence_logs=logging.CRITICAL, dashboard_address="127.0.0.1:0"
    )


def _client(address: str) -> Client:
    from distributed import Client

    _check_reachable(address)
    client = Client(address, timeout=CONNECT_SECONDS, set_as_default=False)
    try:
        client.wait_for_workers(1, timeout=WORKERS_SECONDS)
    except TimeoutError:
        client.close(timeout=3)
        raise ConnectionError(f"the scheduler at {address} has no workers (waited {WORKERS_SECONDS} s)") from None
    return client


def _check_reachable(address: str) -> None:
    """Raise unless something at the address speaks Dask's protocol: a client that cannot connect takes long to give up."""
    import asyncio
    from concurrent.futures import ThreadPoolExecutor

    from distributed.comm import connect, parse_address

    async def greet() -> None:
        comm = await asyncio.wait_for(connect(address, timeout=CONNECT_SECONDS), CONNECT_SECONDS)
        await comm.close()

    started = time.monotonic()
    try:
        parse_address(address, strict=True)
        with ThreadPoolExecutor(1) as elsewhere:  # the caller may have a loop of its own
            elsewhere.submit(asyncio.run, greet()).result()
    except (OSError, TimeoutError, MemoryError) as error:
        waited = time.monotonic() - started
        raise ConnectionError(f"no Dask scheduler answers at {address} (tried for {waited:.0f} s)") from error
    except Exception as error:
        raise ValueError(f"{address!r} is no address of a scheduler, such as tcp://host:8786: {error}") from None


def _check_versions(client: Client, address: str, here: dict[str, str], silence: float) -> None:
    try:
        there: dict[str, dict[str, str]] = _with_timeout(silence, client.run, fingerprint)
    except TimeoutError:
        raise ConnectionError(f"a worker of {address}, or the scheduler, has not answered for {silence:g} s") from None
    except Exception as error:
        raise ValueError(f"workers of {address} cannot run Piazzi: {type(error).__name__}: {error}") from None
    for worker, versions in there.items():
        difference = difference_of(versions, here)
        if difference:
            raise ValueError(f"worker {worker} has {difference}: results would not be the same")


@lru_cache(maxsize=4)
def _unpickled(study: bytes) -> Plan:
    found = pickle.loads(study)
    assert isinstance(found, Plan)
    return found


def _run(expected: dict[str, str], study: bytes, task: Task) -> Piece | str:
    """On a worker: the piece, or why this worker must not make one."""
    difference = difference_of(fingerprint(), expected)
    if difference:
        return f"a worker has {difference}: results would not be the same"
    return run_task(_unpickled(study), task)
