"""CPU seconds of whole processes, as a user starts them."""

from __future__ import annotations

import os
import resource
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path

from cases import recording
from figures import Figure, UnavailableError

REPEATS = 5


def figures() -> Iterator[Figure]:
    python = sys.executable
    bare = _cpu([python, "-c", "pass"])
    yield Figure("Python itself", bare, "s CPU")
    imported = _cpu([python, "-c", "import piazzi"])
    yield Figure("import piazzi", imported - bare, "s CPU", bound=0.15, note="over Python itself")
    script = Path(python).parent / "piazzi"
    program = [str(script)] if script.exists() else [python, "-m", "piazzi"]
    estimate = [*program, "estimate", str(recording()), "--json"]
    yield Figure("piazzi --help", _cpu([*program, "--help"]), "s CPU", bound=0.3)
    with tempfile.TemporaryDirectory(prefix="piazzi-bench-") as empty:
        once = {"PIAZZI_CACHE": empty}
        yield Figure("piazzi estimate, cold", _cpu(estimate, once, repeats=1), "s CPU", bound=15.0, note="nothing compiled yet")
        yield Figure("piazzi estimate, warm", _cpu(estimate, once), "s CPU", bound=1.0)
        run = [
            "-c",
            f"import sys; from piazzi.cli.main import main; sys.argv = {['piazzi', *estimate[len(program) :]]!r}; main()",
        ]
        for name, seconds in _imports([python, "-X", "importtime", *run], once):
            yield Figure(f"  of it importing {name}", seconds, "s", note="wall clock, slowed by being watched")


def _imports(command: list[str], environment: Mapping[str, str]) -> list[tuple[str, float]]:
    """Seconds that each package's own modules took to import, the five largest and what the others add up to."""
    done = subprocess.run(command, capture_output=True, text=True, env=os.environ | environment)
    spent: dict[str, float] = {}
    for line in done.stderr.splitlines():
        if line.startswith("import time:") and line.split("|")[0].split(":")[1].strip().isdigit():
            own, _, name = line.removeprefix("import time:").split("|")
            package = name.strip().split(".")[0]
            package = "the standard library" if package in sys.stdlib_module_names else package
            spent[package] = spent.get(package, 0.0) + int(own) * 1e-6
    largest = sorted(spent.items(), key=lambda item: -item[1])
    return [*largest[:5], ("the rest", sum(seconds for _, seconds in largest[5:]))]


def _cpu(command: list[str], environment: Mapping[str, str] | None = None, repeats: int = REPEATS) -> float:
    """Median CPU seconds, user and system, of the process and its children; raises where it fails."""
    return statistics.median(_cpu_once(command, environment or {}) for _ in range(repeats))


def _cpu_once(command: list[str], environment: Mapping[str, str]) -> float:
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    given = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}  # what pip installs has it
    done = subprocess.run(command, capture_output=True, text=True, env=given | dict(environment))
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    if done.returncode:
        raise UnavailableError(f"{' '.join(command)} ended with {done.returncode}: {done.stderr.strip().splitlines()[-1:]}")
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
