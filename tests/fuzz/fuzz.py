"""Feeds damaged and invented files to the readers: `python tests/fuzz/fuzz.py scenario|csv|npz|nc [--minutes 10] [--seed 0]`.

Mutates good files byte by byte, token by token and line by line; inside archives the members too, with their checksums made
good again.  Inputs that are refused by a line that had refused none join the files to mutate, which leads the search deeper.
A reader may return or raise ValueError or OSError with one printable line, within seconds and a bounded memory; whatever else
happens is kept under --keep, with the input.  NetCDF files are read in a child process each.  Not part of the test suite.
"""

import argparse
import io
import os
import random
import re
import resource
import signal
import sys
import tempfile
import time
import traceback
import warnings
import zipfile
from collections import Counter
from pathlib import Path

import numpy as np

import piazzi as pz
from piazzi.io import cells, save, save_estimate
from piazzi.scenarios import check, load_scenario, names, show

SECONDS, MEMORY = 10, 3 * 2**30
WORDS = {
    "numbers": "0 -0.0 1e999 -1e308 nan inf 1e-320 0x10 1_0 true 1e --1 . -1 111111111111111111111111111",
    "scenario": '[ ] [[ ]] { } = , " """ \' # . x vx length length/time units km sigma variance covariance state truth '
    "role mean estimated ** atan2( __import__('os') é \\u0000 1979-05-27 9**9**9**9 max_step list method adaptive runge-kutta "
    "kepler delta_v time_constant study",
    "csv": '" , ,, # time station west truth:x [deg] [ é epoch',
    "npz": "descr fortran_order shape <f8 |O >f4 <U9 ( ) True .npy",
    "nc": "SNOD TREE HEAP OHDR FRHP BTHD problem about value",
}
MORE = {
    "numbers": ["9" * 400],
    "scenario": [
        "\n",
        "\0",
        "[truth]\n",
        "[step]\n",
        "[memory]\n",
        "[[manoeuvres]]\n",
        "[gauss_markov]\n",
        "a." * 50,
        "[" * 2000,
        "(" * 2000,
    ],
    "csv": ["\n", "\r", "\r\n", "\0", "\ufeff", " ", "\t", "# epoch = x\n"],
    "npz": ["PK\x03\x04", "PK\x05\x06", "\x93NUMPY"],
    "nc": ["\x89HDF\r\n\x1a\n"],
}
TOKENS = {name: words.split() + MORE[name] for name, words in WORDS.items()}
NUMBERS = TOKENS.pop("numbers")
CSV = """
states = ["x", "v"]
dynamics = { x = "v", v = "0" }
sensors.radar.components = { range = "x", rate = "v" }
sensors.camera.components = { bearing = { equation = "x", unit = "rad" } }
stations = [
  { name = "west", sensor = "radar", noise = { sigma = [1, 1] } },
  { name = "n", sensor = "camera", noise = { sigma = 1 } },
]
prior = { mean = [1, 0], sigma = [1, 1] }
times = { step = 1, count = 5 }
"""


class Hung(BaseException):
    """An input took too long."""


def seeds(target: str, folder: Path) -> list[bytes]:
    """Good files."""
    if target == "scenario":
        return [show(name).encode() for name in [*names(), "template"]] + [CSV.encode()]
    (folder / "csv.toml").write_text(CSV)
    if target == "csv":
        problem, tracking = pz.load(folder / "csv.toml")
        save(folder / "seed.csv", problem, tracking)
        text = (folder / "seed.csv").read_bytes()
        return [
            text,
            text.replace(b"\n", b"\r\n"),
            b"# epoch = 2025\n" + text,
            b"time [min],station,bearing [deg]\n0,n,1\n1,n,\n",
        ]
    problem, tracking = pz.load("b612-range" if target == "nc" else "satellite-bearing")
    problem = pz.Problem(
        problem.model, problem.prior, problem.process_noise, problem.stations, problem.parameters, problem.integrator
    )
    tracking = pz.Tracking(tracking.times[:9], tracking.values[:9], truth=tracking.truth[:9])
    save(folder / f"seed.{target}", problem, tracking)
    out = [(folder / f"seed.{target}").read_bytes()]
    if target == "nc":
        save_estimate(folder / "seed.nc", pz.ExtendedKalmanFilter().estimate(problem, tracking))
        out.append((folder / "seed.nc").read_bytes())
    else:
        with np.load(folder / "seed.npz") as arrays:
            np.savez_compressed(folder / "packed.npz", **arrays)
        out.append((folder / "packed.npz").read_bytes())
    return out


def mutate(data: bytes, rng: random.Random, target: str, others: list[bytes]) -> bytes:
    """One to a few changes."""
    if target == "npz" and rng.random() < 0.7:
        return repacked(data, rng, others)
    for _ in range(1 + int(rng.expovariate(0.7))):
        data = changed(bytearray(data), rng, target, others)
    return data[: 2**20]


def changed(data: bytearray, rng: random.Random, target: str, others: list[bytes]) -> bytes:
    at = rng.randrange(len(data) + 1)
    end = min(len(data), at + int(rng.expovariate(1 / 20)) + 1)
    token = rng.choice(NUMBERS + TOKENS[target]).encode("utf-8" if target in ("scenario", "csv") else "latin-1")
    match rng.randrange(9):
        case 0 if data and at < len(data):
            data[at] ^= 1 << rng.randrange(8)
        case 1:
            data[at:at] = token
        case 2:
            del data[at:end]
        case 3:
            data[at:at] = data[at:end] * rng.choice([1, 2, 50])
        case 4:
            data[at:end] = rng.randbytes(end - at)
        case 5:
            numbers = list(re.finditer(rb"\d+(\.\d+)?(e-?\d+)?", data)) or [None]
            found = rng.choice(numbers)
            if found is not None:
                data[slice(*found.span())] = rng.choice(NUMBERS).encode()
        case 6:
            lines = data.split(b"\n")
            a, b = rng.randrange(len(lines)), rng.randrange(len(lines))
            lines[a], lines[b] = lines[b], lines[rng.choice([a, b])]
            data = bytearray(b"\n".join(lines))
        case 7:
            other = rng.choice(others)
            data[at:] = other[rng.randrange(len(other) + 1) :]
        case _:
            words = list(re.finditer(rb"\w+", data)) or [None]
            found = rng.choice(words)
            if found is not None:
                data[slice(*found.span())] = token
    return bytes(data)


def repacked(data: bytes, rng: random.Random, others: list[bytes]) -> bytes:
    """The archive with some members changed and everything else as it should be."""
    out = io.BytesIO()
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as old:
            members = {info.filename: old.read(info) for info in old.infolist() if info.file_size < 2**20}
    except Exception:
        return changed(bytearray(data), rng, "npz", others)
    with warnings.catch_warnings(), zipfile.ZipFile(out, "w", rng.choice([zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED])) as new:
        warnings.simplefilter("ignore")
        for name, content in members.items():
            if rng.random() < 0.4:
                other = invented(rng) if rng.random() < 0.6 else changed(bytearray(content), rng, "npz", [content])
            else:
                other = content
            if rng.random() > 0.03:
                new.writestr(name, other)
    return out.getvalue()


def invented(rng: random.Random) -> bytes:
    """An array that does not belong there."""
    out = io.BytesIO()
    shape = rng.choice([(), (0,), (1,), (3,), (4,), (9,), (4, 4), (9, 4), (4, 9), (1, 1), (2, 2, 2)])
    kind = rng.choice(["f8", "f4", "i4", "u1", "?", "c16", "U3", "S2", "m8[s]", "f2", "g"])
    numbers = np.random.default_rng(rng.randrange(2**32))
    values = numbers.choice([0.0, 1.0, -1.0, 1e-300, 1e300, np.nan, np.inf, 1e6, 15.0], size=shape)
    with np.errstate(all="ignore"), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        array = values.astype(kind) if kind[0] not in "USm" else np.zeros(shape, dtype=kind)
    np.lib.format.write_array(out, np.asarray(array), allow_pickle=False)
    return out.getvalue()


def attempt(target: str, path: Path, problem: pz.Problem | None) -> str:
    """Read one file: the shape of what happened."""
    try:
        if target == "scenario":
            faults = check(path)
            if any(not str(f).isprintable() or len(str(f)) > 1000 for f in faults):
                raise AssertionError(f"fault that is no line: {faults}")
            load_scenario(path)
        elif target == "csv":
            from piazzi.io.csv import read_csv

            read_csv(path, problem)
        else:
            pz.load(path)
    except (ValueError, OSError) as error:
        text = str(error)
        if not text.isprintable() or not text or len(text) > 2000:
            raise AssertionError(f"message that is no line: {text!r}") from error
        if not isinstance(error, ValueError | OSError) or type(error) is UnicodeDecodeError:
            raise
        return where(error)
    return "good"


def where(error: BaseException) -> str:
    """The line that first raised, and the start of what it said."""
    said = re.sub(r"'[^']*'|\d+", "", str(getattr(error, "faults", [error])[0]))
    first: BaseException = error
    while first.__context__ is not None:
        first = first.__context__
    last = traceback.extract_tb(first.__traceback__)[-1]
    place = f"{Path(last.filename).name}:{last.lineno}"
    return f"{place} {said.split(': ')[-1][:40]}" if place.startswith(("faults", "loader", "checks")) else place


def attempt_in_child(target: str, path: Path, problem: pz.Problem | None) -> str:
    """The same in a process of its own: the HDF5 library itself may hang or crash, which is counted but not ours to mend."""
    reader, writer = os.pipe()
    child = os.fork()
    if not child:
        signal.signal(signal.SIGALRM, signal.SIG_DFL)
        signal.alarm(SECONDS)
        try:
            os.write(writer, attempt(target, path, problem).encode())
        except BaseException:
            os.write(writer, b"BAD " + traceback.format_exc().encode()[-2000:])
        os._exit(0)
    os.close(writer)
    with os.fdopen(reader, "rb") as pipe:
        said = pipe.read().decode()
    _, status = os.waitpid(child, 0)
    if os.WIFSIGNALED(status):
        return f"HDF5 ended with {signal.Signals(os.WTERMSIG(status)).name}"
    if said.startswith("BAD"):
        raise AssertionError(said)
    return said


def run(target: str, minutes: float, seed: int, keep: Path) -> int:
    rng, shapes, bad = random.Random(seed), Counter[str](), 0
    signal.signal(signal.SIGALRM, lambda *_: (_ for _ in ()).throw(Hung()))
    warnings.simplefilter("error")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        good = seeds(target, folder)
        corpus = list(good)
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
        problem = load_scenario(folder / "csv.toml").problem if target == "csv" else None
        path = folder / f"input.{'toml' if target == 'scenario' else target}"
        slowest, count, end = 0.0, 0, time.monotonic() + 60 * minutes
        while time.monotonic() < end:
            data = mutate(rng.choice(corpus if rng.random() < 0.5 else good), rng, target, corpus)
            path.write_bytes(data)
            (keep / f"last-{target}").write_bytes(data)  # what is left behind by a crash
            if target == "csv":
                cells.SMALL = rng.choice([0, 2**19])
            started = time.process_time()
            signal.setitimer(signal.ITIMER_REAL, 6 * SECONDS)
            try:
                shape = (attempt_in_child if target == "nc" else attempt)(target, path, problem)
            except BaseException as error:
                if isinstance(error, KeyboardInterrupt):
                    break
                bad += 1
                shape = f"BAD {type(error).__name__}"
                (keep / f"{target}-{bad}").write_bytes(data)
                (keep / f"{target}-{bad}.txt").write_text(traceback.format_exc())
            finally:
                signal.setitimer(signal.ITIMER_REAL, 0)
            spent = time.process_time() - started
            if spent > SECONDS:
                bad += 1
                (keep / f"{target}-{bad}-slow").write_bytes(data)
            slowest, count = max(slowest, spent), count + 1
            shapes[shape] += 1
            if shape.startswith("HDF5"):
                (keep / f"{target}-{count}-{shape[-7:]}").write_bytes(data)
            if shapes[shape] == 1 and len(data) < 2**18:
                corpus.append(data)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(
        f"{target}: {count} inputs in {minutes:g} minutes, {len(shapes)} different outcomes, "
        f"{shapes['good']} read as good, {bad} bad; "
        f"slowest {slowest:.2f} s CPU, peak memory {peak:.0f} MB"
    )
    for shape, times in shapes.most_common(12):
        print(f"  {times:8d}  {shape}")
    return 1 if bad else 0


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("target", choices=list(TOKENS))
    parser.add_argument("--minutes", type=float, default=10)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--keep", type=Path, default=Path(".cache/fuzz"))
    options = parser.parse_args()
    options.keep.mkdir(parents=True, exist_ok=True)
    return run(options.target, options.minutes, options.seed, options.keep)


if __name__ == "__main__":
    sys.exit(main())
