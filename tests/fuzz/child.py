"""One call of the command line in a forked child: as good as a process of its own, without the second that imports take."""

import gc
import os
import resource
import signal
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

CPU = 20  # seconds of processor time
HANGS = 240  # seconds by the clock; only what waits for ever comes near
MEMORY = 3 * 2**30  # bytes of address space beyond what the parent has
FILE = 2**28  # bytes of the largest file


@dataclass(frozen=True)
class End:
    """How a child ended.

    Attributes
    ----------
    status : exit status, minus the signal that ended it
    seconds : of processor time
    megabytes : peak memory, that of the parent when it forked included
    """

    status: int
    out: str
    err: str
    seconds: float
    megabytes: float


def warm() -> None:
    """Import what commands import, and keep it out of the way of the collector."""
    import h5netcdf
    import h5py
    import llvmlite.binding
    import numpy.random
    import pandas
    import rich.console
    import rich.table
    import sympy

    import piazzi.cli.follow
    import piazzi.evaluate
    import piazzi.io.checkpoint
    import piazzi.io.csv
    import piazzi.io.netcdf
    import piazzi.kernels.plain
    import piazzi.present.study_table
    import piazzi.study.store
    from piazzi.cli import commands

    used = (h5netcdf, h5py, llvmlite, numpy, pandas, rich, sympy, piazzi)
    assert all(used)
    for name in commands.COMMANDS:
        __import__(f"piazzi.cli.{name}")
    gc.collect()
    gc.freeze()


def call(work: Callable[[], int], folder: Path, stdin: bytes = b"", environment: dict[str, str] | None = None) -> End:
    """Run a function in a child whose working folder is `folder`; what it returns is the exit status."""
    out, err, given = (os.memfd_create(name) for name in ("out", "err", "in"))
    os.write(given, stdin)
    os.lseek(given, 0, os.SEEK_SET)
    sys.stdout.flush()
    sys.stderr.flush()
    pid = os.fork()
    if not pid:
        status = 99
        try:
            for end, stream in enumerate((given, out, err)):
                os.dup2(stream, end)
            os.chdir(folder)
            os.environ.update(environment or {})
            _limit()
            status = work()
            sys.stdout.flush()
        except BaseException:
            import traceback

            os.write(2, traceback.format_exc().encode())
        finally:
            os._exit(status)
    status, usage = _waited(pid)
    texts = []
    for stream in (out, err):
        os.lseek(stream, 0, os.SEEK_SET)
        with os.fdopen(stream, "rb") as file:
            texts.append(file.read().decode("utf-8", "surrogateescape"))
    os.close(given)
    return End(status, *texts, usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024)


def _limit() -> None:
    with open("/proc/self/statm") as file:
        here = int(file.read().split()[0]) * resource.getpagesize()
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_AS, (here + MEMORY, here + MEMORY))
    resource.setrlimit(resource.RLIMIT_CPU, (CPU, CPU + 5))
    resource.setrlimit(resource.RLIMIT_FSIZE, (FILE, FILE))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def _waited(pid: int) -> tuple[int, resource.struct_rusage]:
    """The end of a child; one that waits for ever is killed."""
    handle = os.pidfd_open(pid)
    try:
        import select

        poll = select.poll()
        poll.register(handle, select.POLLIN)
        end = time.monotonic() + HANGS
        while not poll.poll(1000):
            if time.monotonic() > end:
                os.kill(pid, signal.SIGKILL)
    finally:
        os.close(handle)
    _, status, usage = os.wait4(pid, 0)
    return os.waitstatus_to_exitcode(status), usage
