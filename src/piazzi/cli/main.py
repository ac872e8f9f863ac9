"""Where the command line starts.  Nothing is imported before Ctrl-C is in good hands."""

from __future__ import annotations

import atexit
import gc
import os
import sys

TYPE_CHECKING = False
if TYPE_CHECKING:
    from collections.abc import Sequence


# Matrices here are small: threads of a linear algebra library would wait for each other, which costs more than they save.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
# What a run makes stays while it runs: to look through all of it for garbage after every 700 objects costs more than it frees.
gc.set_threshold(50_000, 20, 100)
atexit.register(gc.freeze)  # at the end the system takes all of it back


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; returns the exit status."""
    try:
        from piazzi.cli.commands import piazzi
        from piazzi.cli.running import run

        return run(piazzi, arguments)
    except KeyboardInterrupt:
        sys.stderr.write("piazzi: interrupted\n")
        return 130
