"""A worker process: a study on its standard input, then tasks; their results on standard output."""

from __future__ import annotations

import os
import pickle
import signal
import sys
from contextlib import suppress


def main() -> None:
    """Serve until the input ends, which it does when the process that reads the results is gone."""
    with suppress(ValueError, OSError):
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the process in front, which ends this one
    source, sink = sys.stdin.buffer, os.fdopen(os.dup(sys.stdout.fileno()), "wb")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())  # what somebody prints must not get between the results
    from piazzi.study.pieces import run_task
    from piazzi.study.pool import UnusableWorker, receive, send

    first = receive(source)
    if first is None:
        return
    try:
        study, why = pickle.loads(first), ""
    except Exception as error:
        study, why = None, f"a worker cannot read the study: {_error_text(error)}"
    while (message := receive(source)) is not None:
        try:
            answer = pickle.dumps(UnusableWorker(why) if why else run_task(study, pickle.loads(message)))
        except Exception as error:
            answer = pickle.dumps(_error_text(error))
        try:
            send(sink, answer)
        except BrokenPipeError:
            return


def _error_text(error: Exception) -> str:
    return f"{type(error).__name__}: {' '.join(str(error).split())}"
