"""Where tasks run: in this process, or in worker processes that may die without taking anything with them."""

from __future__ import annotations

import pickle
import signal
import struct
import subprocess
import threading
from contextlib import suppress
from dataclasses import dataclass
from queue import Empty, SimpleQueue
from typing import IO, Protocol

from piazzi.kernels.ahead import interpreter
from piazzi.study.pieces import run_task
from piazzi.study.plan import Plan
from piazzi.study.tasks import Piece, Task

_LENGTH = struct.Struct("<Q")
THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")
# Of every child: one thread, and no import from the working directory, where there may be files of any name
ENVIRONMENT = {**dict.fromkeys(THREADS, "1"), "PYTHONSAFEPATH": "1"}


@dataclass(frozen=True, eq=False)
class Outcome:
    """What became of a task: its piece; or how its worker died; or what was raised, and whether all tasks will fare so."""

    task: Task
    piece: Piece | None = None
    died: str = ""
    error: str = ""
    fatal: bool = False


class UnusableWorker(str):
    """What a worker says where it can run no task at all."""


class Workers(Protocol):
    """Something that runs tasks."""

    @property
    def slots(self) -> int:
        """How many tasks run at once."""

    def submit(self, task: Task) -> None:
        """Begin a task, at most `slots` at a time."""

    def wait(self) -> list[Outcome]:
        """Outcomes of at least one task."""

    def close(self) -> None:
        """End everything, whatever runs."""


class ThisProcess:
    """Tasks in this process, one at a time."""

    slots = 1

    def __init__(self, study: Plan) -> None:
        self._study, self._tasks = study, list[Task]()

    def submit(self, task: Task) -> None:
        self._tasks.append(task)

    def wait(self) -> list[Outcome]:
        task = self._tasks.pop(0)
        try:
            return [Outcome(task, run_task(self._study, task))]
        except (OSError, MemoryError):
            raise
        except Exception as error:  # as a worker process would tell it
            return [Outcome(task, error=f"{type(error).__name__}: {error}")]

    def close(self) -> None:
        self._tasks.clear()


class Processes:
    """Worker processes, each with a thread that feeds it: a death is known at once, with the task that it was about.

    They are new interpreters that import nothing of the caller's program, so a script needs no guard.  The others begin when
    the first has finished a task: by then, every kernel is compiled.
    """

    def __init__(self, study: Plan, count: int) -> None:
        self.slots = count
        self._first = pickle.dumps(study)
        self._tasks: SimpleQueue[Task | None] = SimpleQueue()
        self._outcomes: SimpleQueue[Outcome] = SimpleQueue()
        self._processes: dict[int, subprocess.Popen[bytes]] = {}
        self._warm, self._closed = threading.Event(), False
        self._threads = [threading.Thread(target=self._serve, args=(i,), daemon=True) for i in range(count)]
        for thread in self._threads:
            thread.start()

    def submit(self, task: Task) -> None:
        self._tasks.put(task)

    def wait(self) -> list[Outcome]:
        while True:  # in short waits: a waiting main thread hears of Ctrl-C between them
            with suppress(Empty):
                found = [self._outcomes.get(timeout=0.2)]
                while not self._outcomes.empty():
                    found.append(self._outcomes.get())
                return found

    def close(self) -> None:
        self._closed = True
        self._warm.set()
        for _ in self._threads:
            self._tasks.put(None)
        for process in list(self._processes.values()):
            process.kill()
        for thread in self._threads:
            thread.join(timeout=5)

    def pids(self) -> list[int]:
        """Processes that are alive."""
        return [p.pid for p in self._processes.values() if p.poll() is None]

    def _serve(self, index: int) -> None:
        if hasattr(signal, "pthread_sigmask"):  # which what it starts inherits: Ctrl-C, however early, is not for workers
            signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        process: subprocess.Popen[bytes] | None = None
        with suppress(OSError):  # told with the first task
            process = self._processes[index] = self._start()
        if index:
            self._warm.wait()
        while not self._closed:
            task = self._tasks.get()
            if task is None:
                break
            try:
                if process is None or process.poll() is not None:
                    if process is not None:
                        end(process)
                    process = self._processes[index] = self._start()
                outcome = self._run(process, task)
            except Exception as error:  # whatever happens here, the task is answered for: somebody waits for it
                outcome = Outcome(task, died=f"{type(error).__name__}: {error}")
            self._outcomes.put(outcome)
            self._warm.set()
        if process is not None:
            end(process)

    def _start(self) -> subprocess.Popen[bytes]:
        return interpreter("from piazzi.study.worker import main; main()", ENVIRONMENT)

    def _run(self, process: subprocess.Popen[bytes], task: Task) -> Outcome:
        assert process.stdin is not None
        assert process.stdout is not None
        try:
            if not hasattr(process, "piazzi_ready"):
                send(process.stdin, self._first)
                process.piazzi_ready = True  # type: ignore[attr-defined]
            send(process.stdin, pickle.dumps(task))
            answer = receive(process.stdout)
        except (OSError, EOFError):
            answer = None
        if answer is None:
            return Outcome(task, died=how_it_ended(end(process)))
        result = pickle.loads(answer)
        if isinstance(result, Piece):
            return Outcome(task, result)
        return Outcome(task, error=str(result), fatal=isinstance(result, UnusableWorker))


def end(process: subprocess.Popen[bytes]) -> int:
    """End a process, if it has not ended, and close its streams; its exit status."""
    process.kill()
    status = process.wait()
    for stream in (process.stdin, process.stdout):
        if stream is not None:
            with suppress(OSError):  # what a dead process never read
                stream.close()
    return status


def send(stream: IO[bytes], data: bytes) -> None:
    """Write one message."""
    stream.write(_LENGTH.pack(len(data)))
    stream.write(data)
    stream.flush()


def receive(stream: IO[bytes]) -> bytes | None:
    """Read one message, None at the end of the stream."""
    head = stream.read(_LENGTH.size)
    if len(head) < _LENGTH.size:
        return None
    (length,) = _LENGTH.unpack(head)
    data = stream.read(length)
    return data if len(data) == length else None


def how_it_ended(status: int) -> str:
    """An exit status in words."""
    if status >= 0:
        return f"exit status {status}"
    with suppress(ValueError):
        return signal.Signals(-status).name
    return f"signal {-status}"
