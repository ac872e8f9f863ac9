"""Runs every command of the installed Piazzi once, on a small problem: `python tests/smoke/commands.py`.

Needs nothing but Piazzi and what it requires; where Dask is there, a study runs on a cluster too.  Ends with 0 where every
exit status is 0 and everything written can be read again; what a command says on stderr is shown.
"""

import ast
import csv
import importlib
import importlib.util
import json
import os
import subprocess
import sys
import tempfile
import time
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

SCENARIO = """
title = "Smoke"
states = { x = "m", y = "m", vx = "m/s", vy = "m/s" }
groups = { position = ["x", "y"] }
dynamics = { x = "vx", y = "vy", vx = "-g*x", vy = "-g*y" }
parameters = { g = 1.0 }
sensors.radar.components = { range = "hypot(x - 3, y)", bearing = { equation = "atan2(y, x - 3)", unit = "rad" } }
stations = [{ name = "west", sensor = "radar", noise = { sigma = [0.01, 0.01] } }]
prior = { mean = [1, 0, 0, 1], sigma = [0.1, 0.1, 0.1, 0.1] }
process_noise = { variance = [1e-6, 1e-6, 1e-6, 1e-6] }
times = { step = 0.1, count = 30 }
truth = { state = "drawn" }
"""
ORBIT = """
epoch = "2016-02-13T16:00:00 UTC"
earth = { degree = 0, bodies = [], tides = [], relativity = false }
sensors.fix.components = { x = "bx", y = "by", z = "bz" }
stations = [{ name = "receiver", sensor = "fix", noise = { sigma = [1.0, 1.0, 1.0] } }]
prior = { mean = [7e6, 0, 0, 0, 5e3, 5.5e3], sigma = [10, 10, 10, 0.01, 0.01, 0.01] }
times = { step = 60.0, count = 100 }
"""
COMMANDS = """
--version
--help
demo -o demo
determine lageos-2 --report lageos.html --json
tracking ceres-1801
scenarios list --json
scenarios show
scenarios check own.toml
simulate own.toml -o own.nc
simulate own.toml -o own.csv
simulate satellite-bearing -o founding.npz
estimate founding.npz
estimate own.nc --json
estimate own.csv --scenario own.toml --with graph -o graph.csv
estimate own.nc --with window:5 -o window.nc
estimate own.nc --with ukf --predict 1s -o ukf.npz
estimate own.toml --follow own.csv --checkpoint state.npz -o live.csv
compare own.nc --with ekf --with srekf --with smoother --with batch -o compare.json --report compare.html
windows own.nc --lags 1,5 -o windows.csv
observability own.nc --no-twins -o seen.json
report own.nc --with ekf --with graph --windows 5 -o report.html
study own.toml --runs 6 --with ekf --workers 2 -o study.nc --report study.html --figures figures
study own.toml --runs 6 --with ekf -o study.nc --resume --json
data --json
propagate orbit.toml -o orbit.oem
propagate orbit.oem --forces none --step 10min --to 2h -o later.csv
tracking orbit.oem
determine orbit.oem --sigma 10m --forces none --json
difference orbit.oem orbit.oem
""".strip().splitlines()
CLUSTER = "study own.toml --runs 6 --with ekf --scheduler local --workers 1 -o cluster.nc"
USAGE = ("", "estimate", "estimate nowhere.nc", "estimate own.nc --seed x", "simulate own.toml --tolerance x")
OPTIONAL = {"IPython", "bokeh", "dask", "distributed"}
PACKAGES = (
    *("click", "h5netcdf", "h5py", "llvmlite", "matplotlib", "numba", "numpy", "pandas", "rich", "sympy", "xarray"),
    *("pyerfa", "astropy-iers-data", "dask", "distributed", "bokeh"),
)


def run(words: str, folder: Path) -> tuple[int, str, list[str]]:
    """Exit status, stdout, and the lines of stderr that are not about compiling."""
    done = subprocess.run([sys.executable, "-P", "-m", "piazzi", *words.split()], cwd=folder, capture_output=True, text=True)
    return done.returncode, done.stdout, [e for e in done.stderr.splitlines() if not e.startswith("piazzi: compiling")]


def imports() -> int:
    """Number of packages that a module of Piazzi imports, somewhere, and that cannot be imported."""
    import piazzi

    found = {}
    for file in sorted(Path(piazzi.__path__[0]).rglob("*.py")):
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            names = [node.module] if isinstance(node, ast.ImportFrom) and not node.level else []
            names += [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            found |= {name: file.name for name in names if name.partition(".")[0] not in {"piazzi", *sys.stdlib_module_names}}
    failures = 0
    for name, file in found.items():
        try:
            importlib.import_module(name)
        except Exception as error:
            if name.partition(".")[0] not in OPTIONAL or not isinstance(error, ModuleNotFoundError):
                failures += 1
                print(f"FAILED  {name}, of {file}: {type(error).__name__}: {str(error).splitlines()[0]}")
    return failures


def same_bits(folder: Path) -> int:
    """1 if numbers of a large table, which pandas reads, are not those that were written; else 0."""
    import numpy as np

    import piazzi as pz
    from piazzi.io.csv import read_csv, write_csv

    rng = np.random.default_rng(0)
    problem = pz.load(folder / "own.toml")[0]
    written = pz.Tracking(np.cumsum(1.0 + rng.random(30_000)) * 1e5, rng.standard_normal((30_000, 2)) * 1e8)
    write_csv(folder / "large.csv", problem, written)
    read = read_csv(folder / "large.csv", problem)
    wrong = int((read.values != written.values).sum() + (read.times != written.times).sum())
    if wrong:
        print(f"FAILED  {wrong} of {3 * len(read.times)} numbers of a large .csv file are not as they were written")
    return bool(wrong)


def readable(path: Path) -> None:
    """Return where the file holds what its ending says; raises if not."""
    import numpy as np

    import piazzi as pz

    match path.suffix:
        case ".json":
            json.loads(path.read_text())
        case ".csv":
            with path.open(newline="") as file:
                widths = {len(row) for row in csv.reader(line for line in file if not line.startswith("#"))}
            assert len(widths) == 1, f"rows of {widths} cells"
        case ".npz":
            with np.load(path) as arrays:
                assert all(arrays[name].size for name in arrays)
        case ".nc" if path.stem == "own":
            assert pz.load(path)[1].values.shape == (30, 2)
        case ".nc" if path.stem == "window":
            from piazzi.io import load_estimate

            assert load_estimate(path).to_dataset().sizes["time"] == 30
        case ".nc":
            from piazzi.study.store import read_store

            assert read_store(path).summary.success
        case ".oem":
            assert len(pz.read_ephemeris(path).arcs[0].t) == 100
        case ".html":
            assert path.read_text(encoding="utf-8").rstrip().endswith("</html>")
        case ".png":
            assert path.read_bytes().startswith(b"\x89PNG")


def smoke(folder: Path) -> int:
    """Number of failures."""
    failures = imports()
    (folder / "own.toml").write_text(SCENARIO)
    (folder / "orbit.toml").write_text(ORBIT)
    for words in [*COMMANDS, *([CLUSTER] if importlib.util.find_spec("distributed") else [])]:
        started = time.monotonic()
        status, out, said = run(words, folder)
        what = "" if status == 0 else f"exit status {status}"
        try:
            if not what and "--json" in words:
                json.loads(out)
        except ValueError as error:
            what = f"stdout is not JSON: {error}"
        failures += bool(what)
        print(f"{'FAILED' if what else 'ok':6} {time.monotonic() - started:5.1f} s  piazzi {words}  {what}", flush=True)
        for line in said:
            print(f"           {line}")
    failures += same_bits(folder)
    for words in USAGE:
        status, _, said = run(words, folder)
        if status != 2 or not said[-1].startswith("piazzi: ") or any("Traceback" in line for line in said):
            failures += 1
            print(f"FAILED  piazzi {words}: exit status {status} where 2 was due: {said[-1:]}")
    for path in sorted(folder.rglob("*.*")):
        try:
            readable(path)
        except Exception as error:
            failures += 1
            print(f"FAILED  {path.name} cannot be read: {type(error).__name__}: {error}")
    return failures


def main() -> int:
    def of(name: str) -> str:
        try:
            return f"{name} {version(name)}"
        except PackageNotFoundError:
            return ""

    print(f"Python {sys.version.split()[0]}:", ", ".join(filter(None, map(of, PACKAGES))), flush=True)
    with tempfile.TemporaryDirectory(prefix="smoke-") as name:
        os.environ.setdefault("PIAZZI_CACHE", str(Path(name) / "cache"))
        (folder := Path(name) / "work").mkdir()
        failures = smoke(folder)
    print(f"{failures} failures" if failures else "Every command works")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
