"""The floor for orbits in space: gravity of any degree, Sun, Moon, radiation, drag and the variational rows by hand in C.

``space.c`` and the tableau in ``dop853.h`` come from measurements that were made before Piazzi had functions from outside.  One
table of 16 columns (rotation by rows, Sun, Moon) is looked up once for every evaluation; a row of the derivative has 8 columns:
six of the first state, those of the coefficients of drag and of radiation.  Times are CPU seconds of the thread.  Needs gcc.
"""

from __future__ import annotations

import ctypes
import subprocess
import tempfile
from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path
from typing import Any

import numpy as np

from piazzi.kernels.multistep import rule

SOURCE = Path(__file__).with_name("space.c")
COLUMNS = 16
_real, _whole, _address = ctypes.c_double, ctypes.c_int, ctypes.c_void_p


class Table(ctypes.Structure):
    _fields_ = [("start", _real), ("piece", _real), ("pieces", _whole), ("terms", _whole), ("c", _address)]


class Model(ctypes.Structure):
    _fields_ = [
        ("table", Table),
        ("gravity", _address),
        *((name, _whole) for name in ("degree", "gradient_degree", "bodies", "drag", "radiation")),
        *((name, _real) for name in ("mu_sun", "mu_moon", "earth_radius", "flattening", "spin", "density", "height", "scale")),
        *((name, _real) for name in ("area_mass", "drag_coefficient", "reflectivity", "pressure", "au", "sun_radius")),
    ]


class Weights(ctypes.Structure):
    _fields_ = [("K", _whole), *((name, _address) for name in ("xp", "vp", "xc", "vc"))]


@dataclass(frozen=True, eq=False)
class SpaceFloor:
    """One orbit under one model of forces.

    Attributes
    ----------
    field : a gravity field (gm, radius, c, s)
    degree, gradient_degree : of the acceleration and of its gradient
    start, piece, coefficients : the table: first instant, seconds of a piece, (pieces, terms, 16), highest power first
    first : (6,), state at t = 0
    bodies, drag, radiation : whether there are Sun and Moon, air, sunlight
    numbers : the other numbers of the model, by their names in C
    """

    field: Any
    degree: int
    gradient_degree: int
    start: float
    piece: float
    coefficients: np.ndarray
    first: np.ndarray
    bodies: bool
    drag: bool
    radiation: bool
    numbers: dict[str, float]

    @cached_property
    def gravity(self) -> ctypes.c_void_p:
        """The field as C has it."""
        C, S = (np.ascontiguousarray(a[: self.degree + 1, : self.degree + 1]) for a in (self.field.c, self.field.s))
        scale = _real(self.field.gm), _real(self.field.radius)
        return _address(build().gravity_new(self.degree, *scale, pointer(C), pointer(S), self.degree + 1))

    @cached_property
    def model(self) -> Model:
        """Forces as C has them."""
        pieces, terms, columns = self.coefficients.shape
        assert columns == COLUMNS
        out = Model(Table(self.start, self.piece, pieces, terms, self.coefficients.ctypes.data), self.gravity)
        for name in ("degree", "gradient_degree", "bodies", "drag", "radiation"):
            setattr(out, name, int(getattr(self, name)))
        for name, value in self.numbers.items():
            setattr(out, name, value)
        return out

    def call_seconds(self, what: str, repeats: int) -> float:
        """CPU seconds of one call: "gravity", "gradient", "lanes" (of one state of eight), "forces" or "table"."""
        lib, place = build(), pointer(self.first)
        if what in ("gravity", "gradient"):
            return float(lib.time_gravity(self.gravity, self.degree, int(what == "gradient"), repeats, place))
        if what == "lanes":
            return float(lib.time_gravity_lanes(self.gravity, self.degree, max(repeats // 8, 1), place))
        if what == "forces":
            return float(lib.time_forces(ctypes.byref(self.model), 1, repeats, place))
        if what == "table":
            return float(lib.time_table(ctypes.byref(self.model.table), repeats))
        raise ValueError(f"unknown call {what!r}")

    def propagate(self, method: str, steps: int, seconds: float, order: int = 10) -> tuple[np.ndarray, np.ndarray, float]:
        """State and derivative (6, 8) at the end of equal steps of "rk4", "rk8" or "gauss-jackson", and CPU seconds."""
        lib, y, Phi, M = build(), self.first.copy(), np.zeros((6, 8)), ctypes.byref(self.model)
        span = _real(0.0), _real(seconds / steps), steps
        started = lib.cpu_seconds()
        if method == "gauss-jackson":
            lib.gauss_jackson(M, ctypes.byref(weights(order)), 1, *span, pointer(y), pointer(Phi))
        else:
            lib.fixed(M, int(method[2:]), *span, pointer(y), pointer(Phi))
        return y, Phi, lib.cpu_seconds() - started


def vector_table_seconds(start: float, piece: float, coefficients: np.ndarray, repeats: int) -> float:
    """CPU seconds of looking up a vector of three in its own table, (pieces, terms, 4)."""
    pieces, terms, _ = coefficients.shape
    table = Table(start, piece, pieces, terms, coefficients.ctypes.data)
    return float(build().time_table3(ctypes.byref(table), repeats))


@cache
def weights(order: int) -> Weights:
    """Those of Gauss and Jackson's method, newest rate first."""
    found = rule(order)
    arrays = [np.array([float(w) for w in row]) for pair in (found.predictor, found.corrector) for row in pair]
    out = Weights(order - 1, *(a.ctypes.data for a in arrays))
    out.kept = arrays
    return out


@cache
def build() -> ctypes.CDLL:
    """The library, compiled for this machine."""
    with tempfile.TemporaryDirectory(prefix="floor-") as folder:
        target = Path(folder) / "libspace.so"
        flags = ["-O3", "-march=native", "-ffp-contract=fast", "-w", "-shared", "-fPIC"]
        subprocess.run(["gcc", *flags, "-o", str(target), str(SOURCE), "-lm"], check=True)
        lib = ctypes.CDLL(str(target))
    lib.gravity_new.restype = _address
    for name in ("time_gravity", "time_gravity_lanes", "time_table", "time_table3", "time_forces", "cpu_seconds"):
        getattr(lib, name).restype = _real
    for name in ("fixed", "gauss_jackson"):
        getattr(lib, name).restype = ctypes.c_long
    return lib


def pointer(array: np.ndarray) -> ctypes.c_void_p:
    """Where an array's numbers are."""
    return array.ctypes.data_as(_address)
