"""Worker processes."""

import os
import signal

from piazzi.study.pool import Processes
from piazzi.study.tasks import Task
from tests.study.studies import small
from tests.waiting import until


def test_ctrl_c_is_not_for_workers_however_early_it_comes():
    """In a terminal all processes hear of it, and one whose interpreter is just starting has no handler yet."""
    team = Processes(small(), 1)
    try:
        until(team.pids)
        pids = team.pids()
        os.kill(pids[0], signal.SIGINT)
        team.submit(Task(0, 0, 8))
        (outcome,) = team.wait()
        assert (outcome.died, outcome.error) == ("", "")
        assert team.pids() == pids
    finally:
        team.close()
