"""Damaged files, many, through the readers alone: `python tests/fuzz/readers.py [FORMAT ...] [--inputs 200000] [--seed 0]`.

`fuzz.py` gives damaged inputs to whole commands, each in a process of its own.  Here they go to `read_tracking`,
`read_ephemeris`, the summary and the writers within one process, which is some ten times as many in the same time.
What cannot be read must be a ValueError of one line.
"""

import argparse
import random
import signal
import sys
import tempfile
import time
import traceback
import warnings
from collections import Counter
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path[0] = str(ROOT)

from tests.fuzz import mutate  # noqa: E402
from tests.fuzz.formats import FORMATS  # noqa: E402
from tests.fuzz.tracked import WORDS, Tracked, gently  # noqa: E402

NAMES = [name for name, kind in FORMATS.items() if issubclass(kind, Tracked)]
ANSWERS = {"range": "two-way", "tag": "transmit", "sigma": ["10m", "1mm/s", "1mrad"], "interval": 1, "angles": "apparent"}
LONGEST = 20  # seconds that one input may take
BLOCK = 2000  # inputs of a format before the next one has its turn
MOST = 400  # inputs that led somewhere new and are damaged further


def read(path: Path, way: int) -> str:
    """What became of a file: a word, or the message of its refusal."""
    import piazzi as pz
    from piazzi import formats

    try:
        if way % 4 == 3:
            found = pz.read_ephemeris(path)
            if found.arcs:
                formats.oem_text(found, created="2020-01-01T00:00:00")
            return "orbits"
        rows = pz.read_tracking(path, **(ANSWERS if way % 2 else {}))
        formats.summary(rows)
        if way % 4 == 0:
            formats.csv_text(rows)
        elif way % 4 == 2:
            formats.tdm_text(rows)
        return "rows"
    except ValueError as error:
        return str(error)


def fault(path: Path, said: str) -> str:
    """What is wrong with a message, "" for nothing."""
    if said in ("rows", "orbits"):
        return ""
    if "\n" in said or not said.isprintable():
        return "the message is not one printable line"
    return "the message is long" if len(said) > 2000 else ""


class Reader:
    """Damaged files of one format, and what became of them."""

    def __init__(self, name: str, seed: int, keep: Path) -> None:
        texts = FORMATS[name].texts(object.__new__(FORMATS[name]))
        self.name, self.keep, self.rng = name, keep, random.Random(f"{seed} {name}")
        self.good, self.found = [text.encode() for text in texts], list[bytes]()
        self.counts, self.kinds = Counter[str](), Counter[str]()
        self.inputs, self.seconds = 0, 0.0

    def read(self, inputs: int, path: Path) -> None:
        """Read so many more."""
        started = time.monotonic()
        for _ in range(inputs):
            self.once(path)
        self.seconds += time.monotonic() - started

    def once(self, path: Path) -> None:
        """One more."""
        rng, self.inputs = self.rng, self.inputs + 1
        data = rng.choice(self.found if self.found and rng.random() < 0.4 else self.good)
        data = gently(data, rng) if rng.random() < 0.6 else mutate.bytewise(data, rng, WORDS, self.good, 2**16)
        path.write_bytes(data)
        signal.alarm(LONGEST)
        try:
            said = read(path, self.inputs)
            wrong = fault(path, said)
        except Exception:  # what is looked for
            said, wrong = traceback.format_exc(), "a traceback"
        signal.alarm(0)
        self.counts["read" if said in ("rows", "orbits") else "refused"] += 1
        shape = "".join(c for c in said.split("\n")[0] if not c.isdigit())[:60]
        self.kinds[shape] += 1
        if self.kinds[shape] == 1 and len(self.found) < MOST and len(data) < 2**14:
            self.found.append(data)
        if wrong:
            self.counts[wrong] += 1
            kind = said.strip().split("\n")[-1][:100]
            self.kinds[kind] += 1
            if self.kinds[kind] <= 2:
                (self.keep / f"{self.name}-{self.inputs}").write_bytes(data)
                (self.keep / f"{self.name}-{self.inputs}.txt").write_text(f"{wrong}\nway {self.inputs % 4}\n{said}")

    @property
    def bad(self) -> int:
        return sum(n for what, n in self.counts.items() if what not in ("read", "refused"))

    def __str__(self) -> str:
        return f"{self.name}: {self.inputs} inputs, {dict(self.counts)}, {self.seconds:.0f} s"


def _slow(number: int, frame: object) -> None:
    raise RuntimeError(f"it took more than {LONGEST} s")


def main() -> int:
    """Fuzz; 1 where something was found."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("formats", nargs="*", default=[], help=f"of {', '.join(NAMES)}")
    parser.add_argument("--inputs", type=int, default=200_000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--keep", type=Path, default=Path("fuzz-findings"))
    told = parser.parse_args()
    told.keep.mkdir(parents=True, exist_ok=True)
    signal.signal(signal.SIGALRM, _slow)
    warnings.simplefilter("ignore")
    readers = [Reader(name, told.seed, told.keep) for name in told.formats or NAMES]
    with tempfile.TemporaryDirectory(prefix="readers-") as folder:
        while readers[-1].inputs < told.inputs:
            for reader in readers:
                reader.read(min(BLOCK, told.inputs - reader.inputs), Path(folder) / "a")
            print(*readers, sep="\n", end="\n\n", flush=True)
    return 1 if any(reader.bad for reader in readers) else 0


if __name__ == "__main__":
    sys.exit(main())
