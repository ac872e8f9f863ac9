"""Kills commands with SIGKILL and goes on after: `python tests/fuzz/kills.py [--kills 200] [--seed 0] [--only KIND]`.

A command is killed when what it has written shows how far it is, or at a random time; then it is called again.  The second call
must end with 0 and leave exactly the files of a call that nobody killed, bit for bit; processes of the first must be gone.
"""

import argparse
import os
import random
import re
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
if __name__ == "__main__":
    sys.path[0] = str(ROOT)
    os.environ.setdefault("PIAZZI_CACHE", str(ROOT / ".cache" / "tests"))

from tests.waiting import HANGS, until  # noqa: E402

SCENARIO = "b612-range"
SMALL = """
states = ["x", "v"]
dynamics = { x = "v", v = "-x" }
sensors.radar.components = { range = "x" }
stations = [{ name = "west", sensor = "radar", noise = { sigma = 1 } }]
prior = { mean = [1, 0], sigma = [1, 1] }
times = { step = 0.1, count = 20 }
"""
FOLLOW = ("estimate", SCENARIO, "--with", "window:5", "-o", "o.csv", "--checkpoint", "k.npz", "--follow")
STUDY = ("study", SCENARIO, "--runs", "40", "--with", "ekf", "--chunk", "2", "--workers", "2", "-o", "s.nc")
COMMANDS = {
    "report": ("report", SCENARIO, "--with", "ekf", "-o", "r.html"),
    "simulate": ("simulate", SCENARIO, "-o", "s.nc"),
    "estimate": ("estimate", SCENARIO, "-o", "e.npz"),
    "cache": ("estimate", "small.toml", "-o", "e.csv"),
}
CLOCK = re.compile(rb"[\d.]+( [um]?s\b)?")  # numbers, with the unit of times
KINDS = ("follow", "study", "worker", *COMMANDS)

Done = subprocess.CompletedProcess[bytes]
Process = subprocess.Popen[bytes]


@dataclass
class Tally:
    """What became of the kills of one kind."""

    kind: str
    kills: int = 0
    late: int = 0  # the command had ended before
    wrong: list[str] = field(default_factory=list)
    left: list[str] = field(default_factory=list)


class Place:
    """Folders of their own for files, temporary files and, where kernels are what is killed, the cache."""

    def __init__(self, folder: Path, own_cache: bool = False) -> None:
        self.work, self.tmp, self.cache = (folder / name for name in ("work", "tmp", "cache"))
        for path in (self.work, self.tmp, self.cache):
            path.mkdir(parents=True, mode=0o700)
        (self.work / "small.toml").write_text(SMALL)
        self.environment = {**os.environ, "TMPDIR": str(self.tmp)} | ({"PIAZZI_CACHE": str(self.cache)} if own_cache else {})

    def start(self, *arguments: str) -> Process:
        command = [sys.executable, "-m", "piazzi", *arguments]
        pipe = subprocess.PIPE if arguments[-1] == "-" else subprocess.DEVNULL
        return subprocess.Popen(
            command, cwd=self.work, env=self.environment, stdin=pipe, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )

    def run(self, *arguments: str) -> Done:
        command = [sys.executable, "-m", "piazzi", *arguments]
        return subprocess.run(command, cwd=self.work, env=self.environment, capture_output=True, timeout=HANGS)

    def names(self) -> set[str]:
        """Everything that is there, the insides of finished kernels aside."""
        cached = {f"cache/{path.name}" for path in self.cache.iterdir()}
        return cached | {f"{at.name}/{path.name}" for at in (self.work, self.tmp) for path in at.rglob("*")}


@contextmanager
def killed(process: Process) -> Iterator[None]:
    """Kill the process when the block ends, and wait until it and its children are gone."""
    try:
        yield
    finally:
        found = children(process.pid)
        process.kill()
        process.wait()
        if process.stdin is not None:
            with suppress(BrokenPipeError):
                process.stdin.close()
        until(lambda: not any(alive(pid) for pid in found))


def children(pid: int) -> list[int]:
    """Processes that a process has started."""
    found = []
    for task in Path(f"/proc/{pid}/task").glob("*"):
        with suppress(OSError):
            found += [int(word) for word in (task / "children").read_text().split()]
    return found


def alive(pid: int) -> bool:
    """Whether a process runs still; one that waits for its parent to look does not."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def size(path: Path) -> int:
    """Bytes of a file; 0 where there is none."""
    try:
        return path.stat().st_size
    except OSError:
        return 0


def reached(process: Process, condition: Callable[[], object]) -> bool:
    """Wait for a condition; False where the process ended before."""
    until(lambda: condition() or process.poll() is not None)
    return process.poll() is None


class Killer:
    """References of every kind, made once, and kills."""

    def __init__(self, rng: random.Random, folder: Path) -> None:
        self.rng, self.folder, self.count = rng, folder, 0
        self.stream = b""
        self.right: dict[str, dict[str, bytes]] = {}
        self.names: dict[str, set[str]] = {}
        self.seconds: dict[str, float] = {}
        self.log_bytes = 0

    def prepare(self, kind: str) -> None:
        """Run the command of a kind to its end, once warm: its files are the right ones."""
        if kind in self.right:
            return
        place = self.place(kind)
        if kind == "follow":
            assert place.run("simulate", SCENARIO, "-o", "in.csv").returncode == 0
            self.stream = (place.work / "in.csv").read_bytes()
        arguments = {"follow": (*FOLLOW, "in.csv"), "study": STUDY, "worker": STUDY}.get(kind) or COMMANDS[kind]
        place.run(*arguments)
        for name in ("e.csv", "e.npz", "r.html", "s.nc", "o.csv", "k.npz"):
            (place.work / name).unlink(missing_ok=True)
        started = time.monotonic()
        process = place.start(*arguments)
        while process.poll() is None:
            self.log_bytes = max(self.log_bytes, size(place.work / "s.nc.runs"))
            time.sleep(0.001)
        assert process.returncode == 0, kind
        self.seconds[kind] = time.monotonic() - started
        self.names[kind] = place.names()
        self.right[kind] = contents(place)

    def place(self, kind: str) -> Place:
        self.count += 1
        place = Place(self.folder / str(self.count), own_cache=kind == "cache")
        if self.stream:
            (place.work / "in.csv").write_bytes(self.stream)
        return place

    def kill(self, kind: str, tally: Tally) -> None:
        """One kill, and the call after it."""
        self.prepare(kind)
        place = self.place(kind)
        tally.kills += 1
        steps = {"follow": self.follow, "study": self.study, "worker": self.worker}
        done, in_time = steps[kind](place) if kind in steps else self.command(kind, place)
        tally.late += not in_time
        if done.returncode:
            tally.wrong.append(f"exit status {done.returncode}: {done.stderr[-200:].decode()}")
            return
        for name, data in self.right[kind].items():
            path = place.work / name
            if not path.exists() or not same(path, data, self.folder):
                tally.wrong.append(f"{name} {'is not the same' if path.exists() else 'is missing'}")
        known = {name.partition("/")[2] for name in self.names[kind]} | {"in.csv"}
        tally.left += [name for name in sorted(place.names()) if name.partition("/")[2] not in known]

    def follow(self, place: Place) -> tuple[Done, bool]:
        """A tracker: killed between two lines, or with lines still to come."""
        lines = self.stream.splitlines(keepends=True)
        count = self.rng.randrange(1, len(lines))
        shown = b"\n".join(self.right["follow"]["o.csv"].split(b"\n")[:count])
        process = place.start(*FOLLOW, "-")
        assert process.stdin is not None
        with killed(process):
            process.stdin.write(b"".join(lines[:count] if self.rng.random() < 0.5 else lines))
            process.stdin.flush()
            in_time = reached(process, lambda: size(place.work / "o.csv") >= len(shown))
        return place.run(*FOLLOW, "in.csv"), in_time

    def study(self, place: Place) -> tuple[Done, bool]:
        """The process in front: killed when so much of the log is there, or while the store is written."""
        wanted, log, process = self.rng.randrange(1, self.log_bytes), place.work / "s.nc.runs", place.start(*STUDY)
        with killed(process):
            if self.rng.random() < 0.2:
                in_time = reached(process, lambda: any(place.work.glob(".*")) or (place.work / "s.nc").exists())
            else:
                in_time = reached(process, lambda: size(log) >= wanted)
        return place.run(*STUDY, "--resume"), in_time

    def worker(self, place: Place) -> tuple[Done, bool]:
        """A worker, of which the study has more: it goes on without being called again."""
        wanted, log, process = self.rng.randrange(1, self.log_bytes), place.work / "s.nc.runs", place.start(*STUDY)
        in_time = reached(process, lambda: size(log) >= wanted)
        found = children(process.pid) if in_time else []
        if found:
            os.kill(self.rng.choice(found), signal.SIGKILL)
        status = process.wait(timeout=HANGS)
        return Done(STUDY, status, b"", b""), bool(found)

    def command(self, kind: str, place: Place) -> tuple[Done, bool]:
        """Any other: killed when its temporary file or folder appears, or at any time."""
        process, started = place.start(*COMMANDS[kind]), time.monotonic()
        home = place.cache if kind == "cache" else place.work
        if self.rng.random() < 0.5:
            with killed(process):
                in_time = reached(process, lambda: any(home.glob(".*")))
        else:
            wanted = started + self.rng.random() * self.seconds[kind]
            with killed(process):
                in_time = reached(process, lambda: time.monotonic() >= wanted)
        return place.run(*COMMANDS[kind]), in_time


def contents(place: Place) -> dict[str, bytes]:
    """Results in the working folder."""
    return {p.name: p.read_bytes() for p in sorted(place.work.iterdir()) if p.suffix in (".csv", ".npz", ".html", ".nc")}


def same(path: Path, right: bytes, folder: Path) -> bool:
    """Whether a file is the right one: in every byte, pages and stores in everything but what the clock measured."""
    data = path.read_bytes()
    if data == right or path.suffix == ".html":
        return CLOCK.sub(b"", data) == CLOCK.sub(b"", right)
    if path.name != STUDY[-1]:
        return False
    from piazzi.study.store import same_results

    (folder / "right.nc").write_bytes(right)
    return not same_results(folder / "right.nc", path)


def run(kinds: tuple[str, ...], kills: int, seed: int) -> list[Tally]:
    """So many kills, one kind after the other."""
    tallies = {kind: Tally(kind) for kind in kinds}
    with tempfile.TemporaryDirectory(prefix="kills-") as folder:
        killer = Killer(random.Random(seed), Path(folder))
        for i in range(kills):
            kind = kinds[i % len(kinds)]
            killer.kill(kind, tallies[kind])
    return list(tallies.values())


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--kills", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", choices=KINDS, help="this kind alone")
    options = parser.parse_args()
    tallies = run((options.only,) if options.only else KINDS, options.kills, options.seed)
    print(f"{'command':10} {'kills':>6} {'too late':>9} {'wrong':>6} {'left behind':>12}")
    for tally in tallies:
        print(f"{tally.kind:10} {tally.kills:6} {tally.late:9} {len(tally.wrong):6} {len(tally.left):12}")
    for tally in tallies:
        for what in sorted({*tally.wrong, *tally.left}):
            print(f"  {tally.kind}: {what}")
    return 1 if any(tally.wrong or tally.left for tally in tallies) else 0


if __name__ == "__main__":
    sys.exit(main())
