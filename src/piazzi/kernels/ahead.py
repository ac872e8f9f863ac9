"""Kernels that will be needed, compiled beforehand: several at a time, by processes that only fill the cache."""

from __future__ import annotations

import logging
import os
import pickle
import subprocess
import sys
import threading
from collections.abc import Iterable, Mapping
from contextlib import suppress
from queue import Empty, SimpleQueue
from typing import Any

from piazzi.kernels.cache import is_compiled, make, missing
from piazzi.kernels.folder import private_folder, writable_folder
from piazzi.kernels.spec import KernelSpec

LOGGER = logging.getLogger("piazzi.kernels")
# Kernels for which other processes are begun, which take as long to begin as a small one to compile: of dear models, of any
DEAR, ANY = 2, 4
PROGRAM = "from piazzi.kernels.ahead import main; main()"


def processors() -> int:
    """Processors that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def compile_ahead(specs: Iterable[KernelSpec]) -> int:
    """Compile what of these modules is not there yet, in as many processes as there are processors; how many that were.

    Each is told at level INFO on the logger ``piazzi.kernels`` as it begins.  Does nothing on one processor, for few modules,
    and where nothing can be kept.  Whatever fails here is compiled when it is needed.
    """
    if not is_compiled() or processors() < DEAR or not sys.executable or private_folder()[0] is None:
        return 0
    waiting = sorted(missing(specs), key=_effort, reverse=True)
    dear = any(spec.unit or spec.apart is not None for spec in waiting)
    if len(waiting) < (DEAR if dear else ANY) or writable_folder() is None:
        return 0
    _Crew(waiting).work()
    return len(waiting)


def _effort(spec: KernelSpec) -> tuple[bool, int]:
    """What takes long comes first: lanes, and many fragments."""
    return bool(spec.unit) and spec.lanes > 1, len(spec.fragments)


class _Crew:
    """Processes, each with a thread that gives it one module after the other."""

    def __init__(self, specs: list[KernelSpec]) -> None:
        self._count, self._begun = len(specs), 0
        self._waiting: SimpleQueue[KernelSpec] = SimpleQueue()
        for spec in specs:
            self._waiting.put(spec)
        self._lock = threading.Lock()
        self._processes: list[subprocess.Popen[bytes]] = []

    def work(self) -> None:
        """Return when all is done; an interrupt ends the processes."""
        threads = [threading.Thread(target=self._feed, daemon=True) for _ in range(min(processors(), self._count))]
        try:
            for thread in threads:
                thread.start()
            for thread in threads:
                while thread.is_alive():
                    thread.join(0.2)  # in short waits: a waiting main thread hears of Ctrl-C between them
        finally:
            for process in self._processes:
                process.kill()
                process.wait()
                for stream in (process.stdin, process.stdout):
                    if stream is not None:
                        with suppress(OSError):
                            stream.close()

    def _feed(self) -> None:
        with suppress(OSError, pickle.PicklingError):
            # in a session of its own: Ctrl-C is for the process in front, which ends this one
            process = interpreter(PROGRAM, {}, stderr=subprocess.DEVNULL, start_new_session=True)
            self._processes.append(process)
            assert process.stdin is not None
            assert process.stdout is not None
            while (spec := self._next()) is not None:
                pickle.dump(spec, process.stdin)
                process.stdin.flush()
                if not process.stdout.readline():
                    return

    def _next(self) -> KernelSpec | None:
        with self._lock:
            try:
                spec = self._waiting.get_nowait()
            except Empty:
                return None
            self._begun += 1
            what = spec.unit or spec.fragments[-1]
            LOGGER.info("compiling %d of %d: %s for %s", self._begun, self._count, what, spec.subject)
        return spec


def interpreter(program: str, environment: Mapping[str, str], **options: Any) -> subprocess.Popen[bytes]:
    """A new interpreter, spoken to through pipes, that imports nothing of the caller's program, nor from the working directory.

    `environment` is added to that of this process; `options` are of `subprocess.Popen`.
    """
    path = os.pathsep.join(p for p in sys.path if p)
    return subprocess.Popen(
        [sys.executable, "-P", "-c", program],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        env={**os.environ, **environment, "PYTHONSAFEPATH": "1", "PYTHONPATH": path},
        **options,
    )


def main() -> None:
    """Compile one module after the other from the standard input, until it ends; a line for each."""
    while True:
        try:
            spec = pickle.load(sys.stdin.buffer)
        except EOFError:
            return
        with suppress(Exception):  # whoever needs it compiles it then, and is told
            make(spec)
        sys.stdout.write("\n")
        sys.stdout.flush()
