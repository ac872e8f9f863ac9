"""The floor that Piazzi is measured against: estimators written by hand in C for one problem, the bearing-only satellite.

Adopted from the measurements that came before Piazzi; ``floor.c`` is as it was then.  Dynamics: 15 substeps of 1 s of the
second-order Taylor step (`rk4`: 10 substeps of RK4); process noise Q dt per step; the first measurement is used.  Graph and
window linearise eight states at a time where the machine has AVX-512.  Times are CPU seconds of the thread.  Needs gcc.
"""

from __future__ import annotations

import ctypes
import os
import statistics
import subprocess
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

SOURCE = Path(__file__).with_name("floor.c")
PADDING = 32  # vector code reads and writes past the last state
WORKLOADS = ("ekf", "ekf_rk4", "graph", "window", "linearize", "solve", "marginals")
_PARTS = {"linearize": 1, "solve": 2, "marginals": 4}
_real = ctypes.c_double


class Floor:
    """The C estimators on one file in the founding layout (keys R, Q, dt, meas, x0, P0)."""

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self.lib = build()
        with np.load(path) as file:
            self.z, self.x0, self.P0 = (np.ascontiguousarray(file[key], dtype=float) for key in ("meas", "x0", "P0"))
            self.Q, self.R = np.ascontiguousarray(file["Q"] * file["dt"]), float(file["R"])
        self.K = self.z.size
        self.workspace = ctypes.c_void_p(self.lib.ws_new(self.K))

    def ekf(self, rk4: bool = False) -> tuple[np.ndarray, np.ndarray]:
        """Means (K, 4) and covariances (K, 4, 4) of the extended Kalman filter."""
        x, P = np.zeros((self.K, 4)), np.zeros((self.K, 4, 4))
        self.lib.ekf(self.K, *self._problem(), int(rk4), _pointer(x), _pointer(P))
        return x, P

    def graph(self, iterations: int = 4) -> tuple[np.ndarray, np.ndarray]:
        """Means and marginal covariances of the full graph from the EKF (covariances as P - P Lambda P, good to 1e-4)."""
        x, P, start = self._states(), np.zeros((self.K, 4, 4)), self._start()
        states = _pointer(start), _pointer(x)
        self.lib.bench_fg0(1, self.workspace, self.K, *states, *self._problem(), iterations, _pointer(P), 1)
        return x[: self.K], P

    def window(self, lag: int = 100, iterations: int = 1) -> tuple[np.ndarray, np.ndarray]:
        """Means (K, 4) of the newest and of the oldest state of the sliding window."""
        states, newest, oldest = self._states(), np.zeros((2 * (self.K + PADDING), 4)), np.zeros((self.K, 4))
        results = _pointer(states), _pointer(newest), None, _pointer(oldest)
        self.lib.fixedlag(self.workspace, self.K, *self._problem(), lag, iterations, 1, 0, *results, 0)
        return newest[: self.K], oldest

    def seconds(self, what: str, repeats: int = 7, *, lag: int = 100, iterations: int | None = None) -> float:
        """Median CPU seconds of one whole run of a workload, or of one part of a graph's iteration."""
        if what not in WORKLOADS:
            raise ValueError(f"unknown workload {what!r}; it must be one of {', '.join(WORKLOADS)}")
        return statistics.median(self._seconds_once(what, lag, iterations) for _ in range(repeats))

    def _seconds_once(self, what: str, lag: int, iterations: int | None) -> float:
        x, P, problem = self._states(), np.zeros((self.K, 4, 4)), self._problem()
        if what in ("ekf", "ekf_rk4"):
            return self.lib.bench_ekf(10, self.K, *problem, int(what == "ekf_rk4"), _pointer(x), _pointer(P)) * self.K * 1e-9
        if what == "window":
            newest, oldest = np.zeros((2 * (self.K + PADDING), 4)), np.zeros((self.K, 4))
            results = _pointer(x), _pointer(newest), _pointer(oldest)
            return self.lib.bench_fl(1, self.workspace, self.K, *problem, lag, iterations or 1, 1, 0, *results) * self.K * 1e-6
        start = self._start()
        if what == "graph":  # the EKF start, the iterations, and the marginal covariances
            ekf, states = self._seconds_once("ekf", lag, None), (_pointer(start), _pointer(x))
            return ekf + 1e-3 * self.lib.bench_fg0(
                3, self.workspace, self.K, *states, *problem, iterations or 4, _pointer(P), 1
            )
        self.graph()  # leaves the workspace linearised and solved
        run = self.workspace, self.K, _pointer(start), *problem, _pointer(P), _pointer(x)
        return 1e-6 * self.lib.bench_part(_PARTS[what], 10, *run)

    def monte_carlo_runs_per_second(self, rng: np.random.Generator, runs: int = 1000, threads: int = 1) -> float:
        """Whole EKF runs per second of wall-clock time, eight runs to a vector."""
        arguments, _keep = self._monte_carlo(rng, runs, threads)
        return statistics.median(self.lib.mc(*arguments) for _ in range(3))

    def monte_carlo_runs_per_cpu_second(self, rng: np.random.Generator, runs: int = 1000) -> float:
        """The same per CPU second of one thread."""
        arguments, _keep = self._monte_carlo(rng, runs, 1)
        started = time.thread_time()
        self.lib.mc(*arguments)
        return runs / (time.thread_time() - started)

    def _monte_carlo(self, rng: np.random.Generator, runs: int, threads: int) -> tuple[tuple[Any, ...], Any]:
        z = np.ascontiguousarray(((self.z + rng.normal(size=(runs, self.K)) * 1e-4 + np.pi) % (2 * np.pi) - np.pi).T)
        x0 = np.ascontiguousarray(self.x0 + rng.normal(size=(runs, 4)) * [1e5, 1e5, 50, 50])
        out, noise = np.zeros((runs, 4)), (_pointer(self.P0), _pointer(self.Q), _real(self.R))
        return (runs, self.K, _pointer(z), _pointer(x0), *noise, _pointer(out), 1, threads), (z, x0, out)

    def _problem(self) -> tuple[Any, ...]:
        return _pointer(self.z), _pointer(self.x0), _pointer(self.P0), _pointer(self.Q), _real(self.R)

    def _states(self) -> np.ndarray:
        return np.zeros((self.K + PADDING, 4))

    def _start(self) -> np.ndarray:
        start = self._states()
        start[: self.K] = self.ekf()[0]
        start[self.K :] = start[self.K - 1]
        return start


def build() -> ctypes.CDLL:
    """The library, compiled for this machine; with the vector maths library where there is one."""
    with tempfile.TemporaryDirectory(prefix="floor-") as folder:
        target = Path(folder) / "libfloor.so"
        command = ["gcc", "-O3", "-march=native", "-shared", "-fPIC", "-o", str(target), str(SOURCE)]
        if subprocess.run([*command, "-lmvec", "-lm", "-lpthread"], capture_output=True).returncode:
            subprocess.run([*command, "-lm", "-lpthread"], check=True)
        lib = ctypes.CDLL(str(target))
    lib.ws_new.restype = ctypes.c_void_p
    for name in ("bench_ekf", "bench_fl", "bench_part", "bench_fg0", "mc"):
        getattr(lib, name).restype = _real
    return lib


def _pointer(array: np.ndarray) -> ctypes.c_void_p:
    return array.ctypes.data_as(ctypes.c_void_p)
