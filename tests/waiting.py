"""Waiting for other processes, for what shows that they are so far; and work that has to be little, on any machine."""

import time

HANGS = 600  # seconds after which something is taken to hang; no test passes or fails by its speed


def until(condition, process=None):
    """Return once the condition holds; fail where the process that is to bring it about has ended, or hangs."""
    end = time.monotonic() + HANGS
    while not condition():
        if process is not None and process.poll() is not None and not condition():
            raise AssertionError(f"ended with {process.returncode}: {process.stderr.read() if process.stderr else ''}")
        assert time.monotonic() < end, "waited for nothing"
        time.sleep(0.005)


def little(call, seconds):
    """What a call returns that keeps a processor busy for so many seconds at most.

    They are those of a machine that turns a loop a million times in 0.015 s; a slower one may take longer in proportion.
    The clock may jump, where all stood still for a while: then the call is made again.
    """
    for _ in range(3):
        started = time.process_time()
        result = call()
        taken = time.process_time() - started
        if taken <= seconds or taken <= seconds * min(_turns(), _turns()) / 0.015:
            return result
    raise AssertionError(f"{taken:.2f} s, where {seconds} s are plenty")


def _turns():
    started = time.process_time()
    for _ in range(1_000_000):
        pass
    return time.process_time() - started
