"""``piazzi determine`` on a simulated day of low orbit, three radars, 2000 ranges: iterations beside C, whole processes."""

from __future__ import annotations

import ctypes
import os
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import orbits
from figures import Figure, UnavailableError
from floor.space import build, pointer, weights

import piazzi as pz
from piazzi import earth
from piazzi.determination import Guess
from piazzi.determination.approach import _place
from piazzi.determination.determining import prepared, ready
from piazzi.determination.setup import Setup, follow
from piazzi.evaluate.information import predicted
from piazzi.formats import Correction, Observations, Segment
from piazzi.formats.write_csv import csv_text
from piazzi.problem.inputs import prepare
from sections.space import _beside, _timed
from sections.start_up import _cpu

ROWS, EVERY, SIGMA, STEP = 2000, 2.0, 5.0, 30.0
SITES = {"NORTH": (78.2, 15.4), "WEST": (34.0, -118.0), "SOUTH": (-33.9, 18.4)}
FORCES = "gravity=EGM2008 degree=20 drag=harris-priester radiation=cannonball"
FIXED = f"{FORCES} cd_a_m=0.022 cr_a_m=0.013"
ROUNDS, BOUND, WHOLE = 7, 1.5, 1.0


def figures() -> Iterator[Figure]:
    try:
        build()
    except FileNotFoundError as error:
        raise UnavailableError(f"the floor needs gcc ({error})") from None
    rows, given = _simulated()
    yield from _iterations(ready(given), _Rows.of(rows))
    with tempfile.TemporaryDirectory(prefix="piazzi-bench-") as folder:
        words = _files(Path(folder), rows, given)
        command = [sys.executable, "-m", "piazzi", "determine", *words, "--json", "--forces"]
        for name, forces, bound in (("fixed coefficients", FIXED, WHOLE), ("density estimated", FORCES, WHOLE)):
            cache = Path(folder) / forces[-3:]
            cache.mkdir(mode=0o700)
            once = {"PIAZZI_CACHE": str(cache)}
            cold = _cpu([*command, forces], once, repeats=1)
            many = sum(1 for found in os.scandir(cache) if found.is_dir())
            yield Figure(f"determine, {name}, cold", cold, "s CPU", note=f"{many} kernels compiled")
            yield Figure(f"determine, {name}, warm", _cpu([*command, forces], once, repeats=3), "s CPU", bound=bound)


def _iterations(given: Setup, rows: _Rows) -> Iterator[Figure]:
    """An iteration of each way to the answer, beside one of batch least squares in C."""
    floor, here = orbits.floor(20, True), given.states

    def theirs() -> float:
        started = build().cpu_seconds()
        rows.batch(floor)
        return float(build().cpu_seconds() - started)

    def graph() -> Any:
        return pz.FactorGraph(start=here).estimate(given.problem, given.tracking)

    def batch() -> Any:
        return pz.BatchLeastSquares(start=here[0], tolerance=1e-4).estimate(given.problem, given.tracking)

    begun = float(given.tracking.times[0])
    ways = {
        "trial": (lambda: _place(given, begun, here[0]), 1, None),
        "graph": (graph, graph().iterations, BOUND),
        "batch": (batch, batch().iterations, BOUND),
    }
    for name, (run, count, bound) in ways.items():
        value, ratio = _beside(_timed(run, count), theirs, ROUNDS)
        note = f"{given.problem.model.n} unknowns; C has 8"
        yield Figure(f"iteration of the {name}", value * 1e3, "ms", ratio=ratio, to="C floor", bound=bound, note=note)


@dataclass(frozen=True, eq=False)
class _Rows:
    """The same rows as C has them: times, stations by number, ranges and their rates, places in axes of the Earth."""

    t: np.ndarray
    z: np.ndarray
    station: np.ndarray
    places: np.ndarray
    sigma: np.ndarray

    class C(ctypes.Structure):
        _fields_ = [("count", ctypes.c_int), *((name, ctypes.c_void_p) for name in ("t", "z", "station", "place", "sigma"))]

    @classmethod
    def of(cls, rows: Observations) -> _Rows:
        """The rates are zero: what is done with them costs the same."""
        z = np.stack([rows.value, np.zeros(len(rows.value))], axis=1)
        places = np.array([site.position([earth.Epoch(orbits.EPOCH)])[0] for site in _stations()])
        return cls(rows.t.copy(), z, rows.station.astype(np.int32), places, np.array([SIGMA, 1.0]))

    def batch(self, floor: Any) -> None:
        """One iteration over the day by Gauss-Jackson in steps of half a minute."""
        arrays = (self.t, self.z, self.station, self.places, self.sigma)
        given = self.C(len(self.t), *(a.ctypes.data for a in arrays))
        N, b, cost = np.zeros((8, 8)), np.zeros(8), ctypes.c_double()
        step = ctypes.c_double(STEP), round(orbits.DAY / STEP)
        first = pointer(floor.first), pointer(N), pointer(b), ctypes.byref(cost)
        build().batch(ctypes.byref(floor.model), ctypes.byref(weights(10)), ctypes.byref(given), *step, *first)


def _stations() -> list[earth.Station]:
    return [earth.Station.geodetic(name, *np.radians(place), 100.0) for name, place in SITES.items()]


def _simulated() -> tuple[Observations, Setup]:
    """Ranges above ten degrees over a day, from a truth that is a little off the guess; and the problem that they make."""
    epoch, first = earth.Epoch(orbits.EPOCH), orbits.first_state()
    t = np.arange(0.0, orbits.DAY, EVERY)
    r, _ = pz.propagate_kepler(first[:3], first[3:], earth.constants.GM["earth"], t)
    turn = earth.rotation("GCRF", "ITRF", [epoch + s for s in t.tolist()])
    body = (turn @ r[:, :, None])[..., 0]
    seen = []
    for k, site in enumerate(_stations()):
        place = site.position([epoch])[0]
        d = body - place
        up = d @ place / np.linalg.norm(d, axis=1) / np.linalg.norm(place)
        seen += [(s, k) for s in t[up > np.sin(np.radians(10.0))].tolist()]
    seen.sort()
    seen = [seen[i] for i in np.linspace(0, len(seen) - 1, ROWS).astype(int)]
    segment = Segment(
        "UTC", way="two-way", range_is="half", tag="receive", corrections=(Correction("troposphere", applied=True),)
    )
    rows = Observations(
        epoch=epoch, t=np.array([s for s, _ in seen]), value=np.full(ROWS, 1e6), kinds=("range",),
        kind=np.zeros(ROWS, dtype=int), participants=(*SITES, "SAT"), station=np.array([k for _, k in seen]),
        object=len(SITES), segments=(segment,), sigma=SIGMA,
    )  # fmt: skip
    guess = Guess(epoch, first[:3], first[3:], "the orbit")

    def posed(rows: Observations, forces: str) -> Setup:
        return prepared(rows, guess=guess, stations=_stations(), forces=forces)

    made = posed(rows, FIXED)
    begun = made.states[0].copy()
    begun[:6] += [10.0, 20.0, -15.0, 0.01, -0.02, 0.01]
    states = follow(made.problem, made.tracking.times, begun, made.chosen.max_step)[0]
    z = predicted(made.problem, prepare(made.problem, made.tracking), states)[:, 0]
    value = np.empty(ROWS)
    value[made.rows[:, 0]] = z + SIGMA * np.random.default_rng(3).standard_normal(ROWS)
    rows = replace(rows, value=value)
    return rows, posed(rows, FIXED)


def _files(folder: Path, rows: Observations, given: Setup) -> list[str]:
    """Tracking and stations as files, and the words of the command."""
    (folder / "day.csv").write_text(csv_text(rows))
    text = "".join(
        f'[[stations]]\nname = "{name}"\nlatitude = {lat}\nlongitude = {lon}\nheight = 100.0\n'
        for name, (lat, lon) in SITES.items()
    )
    (folder / "radars.toml").write_text(text)
    units = ("m", "m", "m", "m/s", "m/s", "m/s")
    first = zip(("x", "y", "z", "vx", "vy", "vz"), given.guess.state, units, strict=True)
    guess = " ".join(f"{name}={value:.6f}{unit}" for name, value, unit in first)
    epoch = str(given.guess.epoch).replace(" UTC", "Z")
    return [
        str(folder / "day.csv"), "--stations", str(folder / "radars.toml"), "--corrections", "applied",
        "--guess", f"{guess} epoch={epoch} frame=GCRF",
    ]  # fmt: skip
