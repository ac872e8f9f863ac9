"""The formats that somebody may hand to Piazzi: good files of each, and damaged ones with the command that reads them."""

import json
import math
import random
import re
import shutil
import struct
import sys
from collections.abc import Callable
from hashlib import sha256
from pathlib import Path
from typing import Any

from tests.fuzz import columns, mutate, tracked
from tests.fuzz.case import Case
from tests.fuzz.child import End, call

LINE = """
states = ["x", "v"]
dynamics = { x = "v", v = "0" }
groups = { all = ["x", "v"] }
sensors.radar.components = { range = "x", rate = "v" }
sensors.camera.components = { bearing = { equation = "x", unit = "rad" } }
stations = [
  { name = "west", sensor = "radar", noise = { sigma = [1, 1] } },
  { name = "n", sensor = "camera", noise = { sigma = 1 } },
]
prior = { mean = [1, 0], sigma = [1, 1] }
process_noise = { variance = [1e-4, 1e-4] }
times = { step = 1, count = 6 }
truth = { state = "drawn" }
"""
CUBE = """
states = { x = "m" }
dynamics = { x = "x**3" }
sensors.radar.components = { range = "x" }
stations = [{ name = "west", sensor = "radar", noise = { sigma = 1 } }]
prior = { mean = [1], sigma = [1] }
times = { step = 0.01, count = 6 }
truth = { state = [1] }
"""
LIVE = ("ekf", "ukf", "srekf", "window:3", "window:3:huber")
SCENARIO_WORDS = r"""
[ ] [[ ]] { } = , " ' # . x vx length length/time units km sigma variance covariance state truth role mean estimated ** atan2(
__import__('os') é \u0000 1979-05-27 9**9**9**9 max_step list method adaptive runge-kutta kepler delta_v time_constant study
[truth] [step] [memory] [[manoeuvres]] [gauss_markov]
"""
SCENARIO_TOKENS = (*SCENARIO_WORDS.split(), '"""', "\n", "\0", "\n[truth]\n", "a." * 50, "[" * 2000, "(" * 2000)
CSV_TOKENS = (
    *('"', ",", ",,", "#", "time", "station", "west", "truth:x", "[deg]", "[", "é", "epoch"),
    *("\n", "\r", "\r\n", "\0", "\ufeff", " ", "\t", "# epoch = x\n", *mutate.HOSTILE),
)
EQUATION_TOKENS = (
    *(
        "(",
        ")",
        "+",
        "-",
        "*",
        "/",
        "**",
        ",",
        ";",
        ".",
        "pi",
        "e",
        "sin",
        "cos",
        "exp(",
        "log",
        "sqrt(",
        "abs(",
        "sign(",
        "hypot(",
    ),
    *("1e400", "9**9**9", "(1/3)"),
)
EQUATIONS = """
({a} + {b}) | {a} - {b} | {a}*{b} | ({a})/({b}) | ({a})**2 | ({a})**(1/3) | -{a} | ({a} + pi)**(1/3)
| sin({a}) | cos({a}) | tanh({a}) | sqrt({a}) | exp({a}) | log({a}) | abs({a}) | sign({a})
| atan2({a}, {b}) | hypot({a}, {b}) | min({a}, {b}) | max({a}, {b})
"""
HDF5_TOKENS = ("SNOD", "TREE", "HEAP", "OHDR", "FRHP", "BTHD", "problem", "about", "value", "\x89HDF\r\n\x1a\n")


def command(arguments: list[str]) -> Callable[[], int]:
    """The command line with these arguments."""

    def run() -> int:
        from piazzi.cli.main import main

        return main(arguments)

    return run


class Format:
    """Good inputs, and cases made from them; `learn` is told of inputs that led somewhere new."""

    compiled = True

    def __init__(self, folder: Path) -> None:
        """Make the good inputs, in a folder of its own."""
        self.good: list[bytes] = []
        self.found: list[bytes] = []
        self.last = b""
        folder.mkdir()
        self.prepare(folder)
        for arguments in self.ahead(folder):
            assert command(arguments)() == 0, arguments

    def prepare(self, folder: Path) -> None:
        raise NotImplementedError

    def ahead(self, folder: Path) -> list[list[str]]:
        """Commands whose kernels and imports children find in memory."""
        (folder / "ahead.toml").write_text(LINE)
        return [
            ["estimate", f"{folder}/ahead.toml"],
            ["observability", f"{folder}/ahead.toml", "--no-twins", "--add", "b=sin(x):sigma=1"],
        ]

    def case(self, rng: random.Random) -> Case:
        raise NotImplementedError

    def learn(self) -> None:
        """Mutate the last input further, too."""
        if len(self.last) < 2**18:
            self.found.append(self.last)

    def damaged(
        self, rng: random.Random, tokens: Any, worse: Callable[[bytes], bytes] | None = None, often: float = 0.7
    ) -> bytes:
        """One of the inputs, changed: by `worse` as often as that, else byte by byte."""
        data = rng.choice(self.found if self.found and rng.random() < 0.4 else self.good)
        try:
            self.last = worse(data) if worse and rng.random() < often else mutate.bytewise(data, rng, tokens, self.good)
        except Exception:  # an input that is damaged already
            self.last = mutate.bytewise(data, rng, tokens, self.good)
        return self.last


class Scenario(Format):
    """Scenario files, uncompiled: every one may be a model of its own."""

    compiled = False

    def prepare(self, folder: Path) -> None:
        from piazzi.scenarios import names, show

        for text in (*(show(name) for name in [*names(), "template"]), LINE, CUBE):
            self.good.append(re.sub(r"(?m)^(count|runs|substeps) = \d+", r"\1 = 5", text).encode())

    def case(self, rng: random.Random) -> Case:
        data = self.damaged(rng, [*SCENARIO_TOKENS, *map(json.dumps, mutate.HOSTILE)])
        way = rng.randrange(10)
        if way < 5:
            return Case({"a.toml": data}, ["scenarios", "check", "a.toml"], says=True)
        ways = [
            ["estimate", "a.toml", "--json"],
            ["compare", "a.toml", "--with", "ekf", "--with", "graph", "-o", "out.csv"],
            ["simulate", "a.toml", "-o", "out.csv"],
            ["observability", "a.toml", "--no-twins", "-o", "out.csv"],
            ["estimate", "-"],
        ]
        piped = ways[way - 5][1] == "-"
        return Case({} if piped else {"a.toml": data}, ways[way - 5], data if piped else b"", makes=frozenset(["out.csv"]))


class Csv(Format):
    """Tables of measurements."""

    def prepare(self, folder: Path) -> None:
        import piazzi as pz
        from piazzi.io import save

        self.scenario = LINE.encode()
        (folder / "a.toml").write_bytes(self.scenario)
        save(folder / "a.csv", *pz.load(folder / "a.toml"))
        text = (folder / "a.csv").read_bytes()
        few = b"time [min],station,bearing [deg]\n0,n,1\n1,n,\n"
        self.good += [text, text.replace(b"\n", b"\r\n"), b"# epoch = 2025\n" + text, few]

    def ahead(self, folder: Path) -> list[list[str]]:
        return [["compare", f"{folder}/a.csv", "--scenario", f"{folder}/a.toml", "--with", "ekf", "--with", "graph"]]

    def case(self, rng: random.Random) -> Case:
        data = self.damaged(rng, CSV_TOKENS)
        small = rng.choice([0, 2**19])  # the quick way or the careful one
        words = rng.choice(
            [["estimate", "a.csv", "--json"], ["compare", "a.csv", "--with", "ekf", "--with", "graph"], ["estimate", "-"]]
        )
        piped = "-" in words
        arguments = [*words, "--scenario", "a.toml"]

        def run() -> int:
            from piazzi.tables import cells

            cells.SMALL = small
            return command(arguments)()

        files = {"a.toml": self.scenario} | ({} if piped else {"a.csv": data})
        return Case(files, arguments, data if piped else b"", call=run)


class Npz(Format):
    """Recordings in the founding layout."""

    def prepare(self, folder: Path) -> None:
        import numpy as np

        import piazzi as pz
        from piazzi.io import save

        problem, tracking = pz.load("satellite-bearing")
        tracking = pz.Tracking(tracking.times[:9], tracking.values[:9], truth=tracking.truth[:9])
        save(folder / "a.npz", problem, tracking)
        with np.load(folder / "a.npz") as arrays:
            np.savez_compressed(folder / "b.npz", **arrays)
        self.good += [(folder / "a.npz").read_bytes(), (folder / "b.npz").read_bytes()]

    def ahead(self, folder: Path) -> list[list[str]]:
        return [["compare", f"{folder}/a.npz", "--with", "ekf", "--with", "graph"], ["simulate", f"{folder}/a.npz"]]

    def case(self, rng: random.Random) -> Case:
        data = self.damaged(rng, ["descr", "PK\x03\x04", "\x93NUMPY"], lambda data: mutate.archive(data, rng, self.good))
        ways = (
            ["estimate", "a.npz", "--json"],
            ["compare", "a.npz", "--with", "ekf", "--with", "graph"],
            ["simulate", "a.npz"],
        )
        return Case({"a.npz": data}, rng.choice(ways))


class NetCdf(Format):
    """Recordings and estimates in NetCDF-4, uncompiled: the model is in the file."""

    compiled = False

    def prepare(self, folder: Path) -> None:
        import piazzi as pz
        from piazzi.io import save, save_estimate

        (folder / "a.toml").write_text(LINE)
        problem, tracking = pz.load(folder / "a.toml")
        save(folder / "a.nc", problem, tracking)
        save_estimate(folder / "b.nc", pz.ExtendedKalmanFilter().estimate(problem, tracking))
        self.good += [(folder / "a.nc").read_bytes(), (folder / "b.nc").read_bytes()]

    def case(self, rng: random.Random) -> Case:
        data = self.damaged(rng, HDF5_TOKENS, lambda data: mutate.hdf5(data, rng), 0.6)
        ways = (["estimate", "a.nc", "--json"], ["simulate", "a.nc"], ["load_estimate"])
        arguments = rng.choice(ways)

        def read() -> int:
            from piazzi.io import load_estimate

            try:
                load_estimate("a.nc")
            except (ValueError, OSError) as error:
                print("piazzi:", str(error), file=sys.stderr)
                return 2
            return 0

        return Case({"a.nc": data}, arguments, call=read if arguments == ["load_estimate"] else None)


def _numbers(text: str) -> list[float]:
    return [float(cell) for cell in re.split(r"[,\n]", text) if cell and not re.match(r"[a-z]", cell.removeprefix("-")[:1])]


def _all_finite(end: End, folder: Path) -> list[str]:
    """A session that ends well has said nothing but numbers."""
    out = end.out + ((folder / "o.csv").read_text() if (folder / "o.csv").exists() else "")
    unusable = re.search(r"(?m)(^|,|\[|: )(-?nan|-?inf|null)\b", out)
    return [f"ends well with {unusable[2]} in its output"] if unusable and end.status == 0 else []


class Follow(Format):
    """Streams of measurements."""

    def prepare(self, folder: Path) -> None:
        import piazzi as pz
        from piazzi.io import save

        self.scenarios = {"line": LINE.encode(), "cube": CUBE.encode()}
        for name, text in self.scenarios.items():
            (folder / f"{name}.toml").write_bytes(text)
            save(folder / f"{name}.csv", *pz.load(folder / f"{name}.toml"))
            self.good.append((folder / f"{name}.csv").read_bytes())
        self.good.append(b"time,range\n0,1\n1,2\n2,3\n3,4\n")
        self.good.append(b"time,station,bearing\n0,n,1\n1,n,1\n1e3,n,2\n0.5,n,1\n")

    def ahead(self, folder: Path) -> list[list[str]]:
        return [
            ["estimate", f"{folder}/{name}.toml", "--with", estimator, "--follow", f"{folder}/{name}.csv"]
            for name in self.scenarios
            for estimator in LIVE
        ]

    def case(self, rng: random.Random) -> Case:
        data = self.damaged(rng, CSV_TOKENS)
        name = rng.choice(list(self.scenarios))
        piped, as_json = rng.random() < 0.5, rng.random() < 0.3
        arguments = ["estimate", "a.toml", "--with", rng.choice(LIVE), "--follow", "-" if piped else "a.csv"]
        makes = []
        if as_json:
            arguments.append("--json")
        elif rng.random() < 0.5:
            arguments += ["-o", "o.csv"]
            makes.append("o.csv")
        if rng.random() < 0.4:
            arguments += ["--checkpoint", "k.npz"]
            makes.append("k.npz")
        files = {"a.toml": self.scenarios[name]} | ({} if piped else {"a.csv": data})

        def holds(end: End, folder: Path) -> list[str]:
            return _all_finite(end, folder) or (self._resumes(arguments, data, folder) if "k.npz" in makes else [])

        return Case(files, arguments, data if piped else b"", makes=frozenset(makes), keeps=True, holds=holds)

    @staticmethod
    def _resumes(arguments: list[str], data: bytes, folder: Path) -> list[str]:
        """The checkpoint that was left can be gone on from, to the same output."""
        if not (folder / "k.npz").exists():
            return []
        output = (folder / "o.csv").read_bytes() if (folder / "o.csv").exists() else None
        end = call(command(arguments), folder, data)
        if end.status == 2 and "k.npz" in end.err:
            return [f"its checkpoint cannot be read again: {end.err[-200:]!r}"]
        if output is not None and (folder / "o.csv").read_bytes() != output:
            return ["resumed at its end, it changes its output"]
        return []


class Checkpoint(Format):
    """Checkpoints of live sessions, beside a stream and an output that are as they were."""

    def prepare(self, folder: Path) -> None:
        import piazzi as pz
        from piazzi.io import save

        self.scenario = LINE.encode()
        (folder / "a.toml").write_bytes(self.scenario)
        save(folder / "a.csv", *pz.load(folder / "a.toml"))
        lines = (folder / "a.csv").read_bytes().splitlines(keepends=True)
        (folder / "half.csv").write_bytes(b"".join(lines[: len(lines) // 2 + 1]))
        self.stream, self.outputs = b"".join(lines), []
        for name in LIVE:
            state, out = folder / "k.npz", folder / "o.csv"
            arguments = ["estimate", f"{folder}/a.toml", "--with", name, "--checkpoint", f"{state}", "-o", f"{out}", "--follow"]
            assert command([*arguments, f"{folder}/half.csv"])() == 0
            self.good.append(state.read_bytes())
            self.outputs.append((name, self.good[-1], out.read_bytes()))
            state.unlink()
            out.unlink()

    def ahead(self, folder: Path) -> list[list[str]]:
        """Nothing: all that is called was called."""
        return []

    def case(self, rng: random.Random) -> Case:
        name, self_made, out = rng.choice(self.outputs)
        kept, self.good = self.good, [self_made] if rng.random() < 0.9 else self.good
        data = self.damaged(rng, ["session_mean", "PK\x03\x04"], lambda data: mutate.archive(data, rng, self.good), 0.8)
        self.good = kept
        arguments = ["estimate", "a.toml", "--with", name, "--checkpoint", "k.npz", "-o", "o.csv", "--follow", "a.csv"]
        files = {"a.toml": self.scenario, "a.csv": self.stream, "o.csv": out, "k.npz": data}
        return Case(files, arguments, changes=frozenset(["o.csv", "k.npz"]), holds=_all_finite)


AT = {"x": 0.7, "v": -1.3}


class Expression(Format):
    """Equations, in a scenario and on the command line; those that are read have the value that Python gives them."""

    compiled = False

    def prepare(self, folder: Path) -> None:
        self.good += [e.encode() for e in ("x", "sqrt(x**2 + v**2)", "-x/(1 + v**2)**3", "atan2(v, x - 10)", "min(x, v, 2)*pi")]

    def case(self, rng: random.Random) -> Case:
        if rng.random() < 0.4:
            text = self.last = self._grown(rng, rng.randrange(1, 7)).encode()
        else:
            text = self.damaged(rng, EQUATION_TOKENS)
        said = text[:12000].decode("utf-8", "replace")
        if rng.random() < 0.5:
            arguments = ["observability", "a.toml", "--no-twins", "--json", "--add", f"b={said}:sigma=1"]
            if "\0" in said:
                arguments[-1] = "b=x"
            return Case({"a.toml": LINE.encode()}, arguments)
        scenario = LINE.replace('range = "x"', f"range = {json.dumps(said)}")
        return Case({"a.toml": scenario.encode()}, ["scenarios", "check", "a.toml"], says=True, holds=self._value(said))

    def _grown(self, rng: random.Random, depth: int) -> str:
        """An expression by the grammar."""
        if depth <= 0 or rng.random() < 0.1:
            return rng.choice(["x", "v", "pi", "2", "0.5", "1e-3", "3", "1/3"])
        a, b = self._grown(rng, depth - 1), self._grown(rng, depth - rng.randrange(1, 4))
        pattern = rng.choice(EQUATIONS.split("|")).strip()
        return pattern.format(a=a, b=b)

    def _value(self, text: str) -> Callable[[End, Path], list[str]]:
        def holds(end: End, folder: Path) -> list[str]:
            from piazzi.expressions import evaluate

            if end.status:
                return []
            functions = {n: getattr(math, n) for n in dir(math) if not n.startswith("_")}
            functions |= {"abs": abs, "min": min, "max": max, "sign": lambda x: math.copysign(1.0, x) if x else 0.0}
            try:
                expected = float(eval(text, {"__builtins__": {}}, functions | AT))
            except Exception:  # no value there, or words that Python does not read as we do
                return []
            got = evaluate(text, AT)
            if math.isnan(got) or math.isclose(got, expected, rel_tol=1e-9, abs_tol=1e-9) or not abs(expected) < 1e15:
                return []
            return [f"{text!r} is {expected} for Python and {got} here"]

        return holds


class Study(Format):
    """Shared by the two files of a study: the scenario, its finished store and the log of its runs."""

    WORDS = ("study", "a.toml", "--runs", "8", "--with", "ekf", "--chunk", "2", "--workers", "0", "-o", "s.nc", "--resume")

    def ahead(self, folder: Path) -> list[list[str]]:
        """Nothing: the study that was run is enough."""
        return []

    def prepare(self, folder: Path) -> None:
        from piazzi.study.log import Log

        self.scenario = LINE.encode()
        (folder / "a.toml").write_bytes(self.scenario)
        arguments = [f"{folder}/{a}" if "." in a else a for a in self.WORDS[:-1]]
        remove, Log.remove = Log.remove, Log.close  # type: ignore[method-assign]
        try:
            assert command(arguments)() == 0
        finally:
            Log.remove = remove  # type: ignore[method-assign]
        self.store, self.log = (folder / "s.nc").read_bytes(), (folder / "s.nc.runs").read_bytes()
        shutil.copy(folder / "s.nc", folder / "right.nc")
        self.right = folder / "right.nc"


class StudyStore(Study):
    """Finished studies."""

    def prepare(self, folder: Path) -> None:
        super().prepare(folder)
        self.good.append(self.store)

    def case(self, rng: random.Random) -> Case:
        data = self.damaged(rng, HDF5_TOKENS, lambda data: mutate.hdf5(data, rng), 0.8)
        arguments = [*self.WORDS, *(["--json"] if rng.random() < 0.5 else [])]
        return Case({"a.toml": self.scenario, "s.nc": data}, arguments)


class StudyLog(Study):
    """Studies that were interrupted."""

    HEAD = struct.Struct("<8sQ32s")

    def prepare(self, folder: Path) -> None:
        super().prepare(folder)
        self.good.append(self.log)
        self.magic = self.log[:8]

    def case(self, rng: random.Random) -> Case:
        forged = rng.random() < 0.6
        if forged:
            data = self.last = mutate.record_log(self.good[0], rng, self._split, self._join)
        else:
            data = self.last = mutate.bytewise(self.log, rng, ["PZRUNS1\n"], [self.log], 2**22)

        def holds(end: End, folder: Path) -> list[str]:
            from piazzi.study.store import same_results

            if end.status == 2 or forged:
                return []
            wrong = [name for name in same_results(self.right, folder / "s.nc") if name != "about"]
            return [f"results are not the same: {', '.join(wrong)}"] if wrong else []

        changes, made = frozenset(["s.nc.runs"]), frozenset(["s.nc", "s.nc.runs.damaged"])
        return Case({"a.toml": self.scenario, "s.nc.runs": data}, [*self.WORDS], changes=changes, makes=made, holds=holds)

    def learn(self) -> None:
        """Records are always taken from the good log."""

    def _split(self, data: bytes) -> list[tuple[dict, bytes]]:
        out, at = [], 0
        while at < len(data):
            _, length, _ = self.HEAD.unpack_from(data, at)
            payload = data[at + self.HEAD.size : at + self.HEAD.size + length]
            (size,) = struct.unpack_from("<Q", payload)
            out.append((json.loads(payload[8 : 8 + size]), payload[8 + size :]))
            at += self.HEAD.size + length
        return out

    def _join(self, header: Any, body: bytes) -> bytes:
        text = json.dumps(header).encode()
        payload = struct.pack("<Q", len(text)) + text + body
        return self.HEAD.pack(self.magic, len(payload), sha256(payload).digest()) + payload


class TdmFormat(tracked.Tdm, Format):
    """Tracking Data Messages."""


class OemFormat(tracked.Oem, Format):
    """Orbit Ephemeris Messages."""


class OpmFormat(tracked.Opm, Format):
    """Orbit Parameter and Mean Elements Messages."""


class LaserFormat(columns.Laser, Format):
    """Laser ranges and predictions."""


class Sp3Format(columns.Sp3, Format):
    """Precise orbits."""


class AstrometryFormat(columns.Astrometry, Format):
    """Astrometry in columns, separated values and XML."""


class SurveillanceFormat(columns.Surveillance, Format):
    """Observations of space surveillance."""


class TableFormat(columns.Table, Format):
    """Tables of measurements."""


FORMATS: dict[str, type[Format]] = {
    "scenario": Scenario, "csv": Csv, "npz": Npz, "nc": NetCdf, "checkpoint": Checkpoint, "follow": Follow,
    "log": StudyLog, "store": StudyStore, "expression": Expression,
    "tdm": TdmFormat, "oem": OemFormat, "opm": OpmFormat,
    "laser": LaserFormat, "sp3": Sp3Format, "astrometry": AstrometryFormat, "surveillance": SurveillanceFormat,
    "table": TableFormat,
}  # fmt: skip
