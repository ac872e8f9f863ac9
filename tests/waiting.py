"""Waiting for other processes: for what shows that they are so far, never for so many seconds."""

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
