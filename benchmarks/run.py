"""Figures of Piazzi beside hand-written C and other libraries: ``make bench``, or ``make bench ARGS='--only ekf,graph'``.

Times are CPU seconds of the process unless a figure says otherwise, medians of runs that alternate with what they are compared
with.  A ratio is to something measured in the same run, so it means the same on another machine; the numbers do not.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import sys
import time
from collections.abc import Iterator
from dataclasses import asdict
from datetime import UTC, datetime
from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from figures import Figure, UnavailableError
from sections import SECTIONS

SCHEMA = "piazzi.bench/1"
PACKAGES = ("piazzi", "numpy", "numba", "llvmlite", "sympy", "gtsam", "filterpy")
MARKS = {True: "ok", False: "MISSED", None: ""}


def main() -> int:
    wanted = _arguments()
    machine = _machine()
    print("{processor}, {cores} cores, load {load:.1f}; Python {python}, NumPy {numpy}".format(**machine))
    figures: dict[str, list[Figure]] = {}
    for name in wanted.only:
        print(f"\n{name}: {SECTIONS[name]}", flush=True)
        figures[name] = []
        for figure in _figures(name):
            figures[name].append(figure)
            print(_line(figure), flush=True)
    every = [f for section in figures.values() for f in section]
    missed = [f.name.strip() for f in every if f.within is False]
    kept = sum(f.within is True for f in every)
    print(f"\n{kept} bounds kept, {len(missed)} missed" + "".join(f"\n  missed: {name}" for name in missed))
    if wanted.json:
        _write(wanted.json, machine, figures)
        print(f"Wrote {wanted.json}")
    return int(bool(missed) and wanted.strict)


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="benchmarks/run.py", description=__doc__.splitlines()[0])
    sections = "; ".join(f"{name}: {what}" for name, what in SECTIONS.items())
    only = f"run these sections alone ({sections})"
    parser.add_argument("--only", type=_section_names, default=list(SECTIONS), metavar="A,B", help=only)
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the figures too, say benchmarks/results/today.json")
    parser.add_argument("--strict", action="store_true", help="exit 1 where a bound is missed")
    return parser.parse_args()


def _section_names(text: str) -> list[str]:
    names = [name.strip() for name in text.split(",")]
    for name in names:
        if name not in SECTIONS:
            raise argparse.ArgumentTypeError(f"unknown section {name!r}; there are {', '.join(SECTIONS)}")
    return names


def _figures(name: str) -> Iterator[Figure]:
    """Figures of a section; where something it needs is not there, a line that says so."""
    started = time.perf_counter()
    try:
        yield from import_module(f"sections.{name}").figures()
    except (ImportError, UnavailableError) as error:
        print(f"  not available: {error}")
    else:
        print(f"  ({time.perf_counter() - started:.0f} s)")


def _line(f: Figure) -> str:
    arrow, sign = {"lower": ("v", "<="), "higher": ("^", ">=")}[f.better]
    ratio, x = (f"{f.ratio:.2f}x of {f.to}", "x") if f.ratio is not None else ("", "")
    limit = "" if f.bound is None else f"{sign} {f.bound:g}{x}"
    number = f"{f.value:10.4g} {f.unit:6s} {arrow} +-{f.tolerance:.0%}"
    return f"  {f.name:40s} {number} {ratio:>20s} {limit:8s} {MARKS[f.within]:6s} {f.note}".rstrip()


def _machine() -> dict[str, str | int | float]:
    out: dict[str, str | int | float] = {"date": datetime.now(UTC).isoformat(timespec="seconds"), "system": platform.platform()}
    out |= {
        "processor": _processor(),
        "cores": os.cpu_count() or 0,
        "load": os.getloadavg()[0],
        "python": platform.python_version(),
    }
    for package in PACKAGES:
        try:
            out[package] = version(package)
        except PackageNotFoundError:
            out[package] = "none"
    return out


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return platform.processor()
    return next((line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")), platform.machine())


def _write(path: Path, machine: dict[str, str | int | float], figures: dict[str, list[Figure]]) -> None:
    rows = [{"section": section, **asdict(f), "within": f.within} for section, found in figures.items() for f in found]
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps({"schema": SCHEMA, "machine": machine, "figures": rows}, indent=1) + "\n")


if __name__ == "__main__":
    sys.exit(main())
