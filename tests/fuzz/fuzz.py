"""Feeds damaged and invented inputs to whole commands: `python tests/fuzz/fuzz.py FORMAT|all [--minutes 10] [--seed 0]`.

Good inputs are mutated: bits, bytes, tokens, numbers, lines, cuts, splices, hostile names; members of archives, variables of
HDF5 files and records of logs with their checksums made good again.  Every input goes to a whole command in a forked child
with bounded memory, processor time and file size.  It must end with 0, 2 or 3; say what was wrong in one printable line; leave
its inputs as they were and nothing behind; and what the format promises must hold (`formats.py`).  What does not hold is
kept under --keep with its input.  Inputs that end in a way not seen before are mutated further.
"""

import argparse
import contextlib
import json
import os
import random
import shutil
import sys
import tempfile
import time
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path[0] = str(ROOT)
for variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):
    os.environ[variable] = "1"  # a child has no threads but its own
os.environ.setdefault("PIAZZI_CACHE", str(ROOT / ".cache" / "tests"))

from tests.fuzz import child  # noqa: E402
from tests.fuzz.case import Case, faults, files_in, shape  # noqa: E402
from tests.fuzz.formats import FORMATS, Format, command  # noqa: E402

MOST_FINDINGS = 200
COLUMNS = ("format", "inputs", "per s", "outcomes", "exit 0", "exit 2", "exit 3", "slowest s", "peak MB", "findings", "kinds")


@dataclass
class Tally:
    """What became of the inputs of one format.

    Attributes
    ----------
    seconds : by the clock
    slowest : seconds of processor time
    megabytes : peak memory beyond that of a child that does nothing
    shapes : kinds of outcomes
    kinds : kinds of findings
    """

    format: str
    inputs: int = 0
    seconds: float = 0.0
    slowest: float = 0.0
    megabytes: float = 0.0
    statuses: Counter[int] = field(default_factory=Counter)
    shapes: Counter[str] = field(default_factory=Counter)
    kinds: Counter[str] = field(default_factory=Counter)

    @property
    def bad(self) -> int:
        return sum(self.kinds.values())

    def row(self) -> list[str]:
        exits = [str(self.statuses[status]) for status in (0, 2, 3)]
        numbers = [f"{self.slowest:.1f}", f"{self.megabytes:.0f}", str(self.bad), str(len(self.kinds))]
        rate = f"{self.inputs / max(self.seconds, 1e-9):.0f}"
        return [self.format, str(self.inputs), rate, str(len(self.shapes)), *exits, *numbers]


def run(name: str, minutes: float, most: int | None, seed: int, keep: Path) -> Tally:
    """Fuzz one format for so long, or with so many inputs."""
    rng, tally = random.Random(f"{seed} {name}"), Tally(name)
    with tempfile.TemporaryDirectory(prefix="fuzz-") as folder, open(os.devnull, "w") as quiet:
        place = Path(folder)
        kind = FORMATS[name]
        os.environ["PIAZZI_JIT"] = "1" if kind.compiled else "0"
        with contextlib.redirect_stdout(quiet), contextlib.redirect_stderr(quiet):
            inputs = kind(place / "good")
        child.warm()
        idle = child.call(lambda: 0, place).megabytes
        started = time.monotonic()
        while time.monotonic() - started < 60 * minutes and tally.inputs != most and tally.bad < MOST_FINDINGS:
            once(inputs, inputs.case(rng), place, tally, keep)
        tally.seconds = time.monotonic() - started
        tally.megabytes = max(0.0, tally.megabytes - idle)
    return tally


def once(inputs: Format, case: Case, place: Path, tally: Tally, keep: Path) -> None:
    """One input: run, judge, count, keep."""
    for name in ("work", "tmp"):
        shutil.rmtree(place / name, ignore_errors=True)
        (place / name).mkdir()
    for name, data in case.files.items():
        (place / "work" / name).write_bytes(data)
    before = files_in(place / "work")
    environment = {"TMPDIR": str(place / "tmp")}
    end = child.call(case.call or command(case.arguments), place / "work", case.stdin, environment)
    wrong = faults(case, end, place, before)
    tally.inputs += 1
    tally.statuses[end.status] += 1
    tally.slowest, tally.megabytes = max(tally.slowest, end.seconds), max(tally.megabytes, end.megabytes)
    what = shape(case, end)
    tally.shapes[what] += 1
    if tally.shapes[what] == 1:
        inputs.learn()
    if wrong:
        label = f"{what} | {wrong[0].split(':')[0][:80]}"
        tally.kinds[label] += 1
        if tally.kinds[label] <= 3:
            _keep(keep / f"{tally.format}-{tally.inputs}", case, end, wrong)


def _keep(folder: Path, case: Case, end: child.End, wrong: list[str]) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    for name, data in {**case.files, "stdin": case.stdin}.items():
        (folder / name).write_bytes(data)
    told = [
        "piazzi " + json.dumps(case.arguments),
        *wrong,
        f"exit status {end.status}",
        "",
        end.err[-5000:],
        "",
        end.out[-2000:],
    ]
    (folder / "finding.txt").write_text("\n".join(told), errors="backslashreplace")


def table(tallies: list[Tally]) -> str:
    """All formats, one line each, and under them what was found."""
    rows = [list(COLUMNS), *(tally.row() for tally in tallies)]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    lines = ["  ".join(f"{cell:>{width}}" for cell, width in zip(row, widths, strict=True)) for row in rows]
    for tally in tallies:
        lines += [
            f"  {tally.format}: {times} x {kind.encode('unicode_escape').decode()}" for kind, times in tally.kinds.most_common()
        ]
    return "\n".join(lines)


def every(options: argparse.Namespace) -> list[Tally]:
    """All formats, each in a process of its own, so many at a time."""
    import subprocess

    def one(name: str) -> Tally:
        words = ["--minutes", options.minutes, "--seed", options.seed, "--keep", options.keep, "--as-json"]
        words += ["--inputs", options.inputs] if options.inputs else []
        done = subprocess.run([sys.executable, __file__, name, *map(str, words)], capture_output=True, text=True)
        if not done.stdout:
            return Tally(name, kinds=Counter({f"the fuzzer itself ended with {done.returncode}: {done.stderr[-300:]}": 1}))
        found = json.loads(done.stdout)
        for counted in ("statuses", "shapes", "kinds"):
            found[counted] = Counter({int(k) if counted == "statuses" else k: v for k, v in found[counted].items()})
        print(table([Tally(**found)]), file=sys.stderr, flush=True)
        return Tally(**found)

    with ThreadPoolExecutor(options.jobs) as pool:
        return list(pool.map(one, FORMATS))


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("format", choices=[*FORMATS, "all"])
    parser.add_argument("--minutes", type=float, default=10, help="for each format")
    parser.add_argument("--inputs", type=int, help="for each format, where that comes first")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--jobs", type=int, default=1, help="formats at a time, of all")
    parser.add_argument(
        "--keep", type=Path, default=Path(".cache/fuzz"), help="folder for inputs that were not dealt with properly"
    )
    parser.add_argument("--as-json", action="store_true", help="the counts as JSON in place of a table")
    options = parser.parse_args()
    options.keep = options.keep.absolute()
    if options.format == "all":
        tallies = every(options)
    else:
        tallies = [run(options.format, options.minutes, options.inputs, options.seed, options.keep)]
    print(json.dumps(vars(tallies[0])) if options.as_json else table(tallies))
    return 1 if any(tally.bad for tally in tallies) else 0


if __name__ == "__main__":
    sys.exit(main())
