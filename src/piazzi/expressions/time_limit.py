"""A limit on the time that SymPy takes for one equation: some of a hundred characters keep it busy for hours.

It is all Python, so it can be interrupted from another thread, as Ctrl-C interrupts it in the main one.  A child process could
be stopped as well, but would have to start and import SymPy first, for every model.
"""

from __future__ import annotations

import ctypes
import threading
import time
from collections.abc import Callable, Sequence
from typing import TypeVar

A = TypeVar("A")
T = TypeVar("T")
SECONDS = 5.0  # of a processor, where the system can tell, for one equation
_SLICES = 20  # of a limit, after each of which the clock is looked at
_REPEAT_SECONDS = 0.2  # seconds after which the interruption is repeated: SymPy catches some


class TooSlowError(ValueError):
    """Something took longer than it may: of several things, the one of this number."""

    def __init__(self, seconds: float, at: int) -> None:
        super().__init__(f"SymPy needs more than {seconds:g} s for this")
        self.at = at


def with_time_limit(call: Callable[[], T], seconds: float | None = None) -> T:
    """What a call returns; raises TooSlowError where it takes more than `seconds` (default: `SECONDS`)."""
    return each_with_time_limit(lambda _: call(), [None], seconds)[0]


def each_with_time_limit(call: Callable[[A], T], items: Sequence[A], seconds: float | None = None) -> list[T]:
    """What a call makes of each item, in turn; raises TooSlowError where one of them takes more than `seconds`."""
    watch, done = _Timer(SECONDS if seconds is None else seconds), list[T]()
    try:
        try:
            for item in items:
                watch.restart()
                done.append(call(item))
            return done
        finally:
            watch.stop()
    except watch.interruption:
        while True:
            try:
                watch.stop()
                break
            except watch.interruption:  # one that was on its way already
                continue
        if len(done) == len(items):  # it came after the last of them
            return done
        raise TooSlowError(watch.seconds, len(done)) from None


class _Timer:
    """A thread that interrupts the one that made it, until it is stopped.

    It looks at the clock in slices, none of which counts for more than twice its length: where the whole machine was stopped
    for a while, or a garbage collection held the interpreter, SymPy did nothing, yet the clock of a processor may tell of it.
    """

    def __init__(self, seconds: float) -> None:
        # no Exception, because SymPy catches those; one of its own, so that of nested limits each ends its own block
        self.interruption: type[BaseException] = type("Interruption", (BaseException,), {})
        self.seconds, self._sent = seconds, False
        self._thread, self._clock = threading.get_ident(), _clock()
        self._seen, self._used = self._clock(), 0.0
        self._lock, self._stopped = threading.Lock(), threading.Event()
        threading.Thread(target=self._run, daemon=True).start()

    def restart(self) -> None:
        """Begin to count anew."""
        with self._lock:
            self._seen, self._used = self._clock(), 0.0

    def stop(self) -> None:
        """End; nothing is interrupted any more when this has returned."""
        with self._lock:
            self._stopped.set()
        if self._sent:  # taking back what was never sent would leave CPython looking for it at every step, profilers for ever
            _interrupt(self._thread, None)

    def _run(self) -> None:
        part = self.seconds / _SLICES
        while not self._stopped.wait(_REPEAT_SECONDS if self._sent else part):
            with self._lock:
                now = self._clock()
                self._used += min(now - self._seen, 2 * part)
                self._seen = now
                if self._used >= self.seconds and not self._stopped.is_set():
                    self._sent = True
                    _interrupt(self._thread, self.interruption)


def _clock() -> Callable[[], float]:
    """Seconds of a processor that this thread has used, to be asked by any thread; else, of the clock on the wall."""
    try:
        number = time.pthread_getcpuclockid(threading.get_ident())
    except (AttributeError, OSError):
        return time.monotonic
    return lambda: time.clock_gettime(number)


def _interrupt(thread: int, kind: type[BaseException] | None) -> None:
    """Raise in another thread, or take back what was not raised yet; an interpreter other than CPython cannot."""
    interface = getattr(ctypes, "pythonapi", None)
    if interface is not None:
        argument = ctypes.py_object() if kind is None else ctypes.py_object(kind)
        interface.PyThreadState_SetAsyncExc(ctypes.c_ulong(thread), argument)
