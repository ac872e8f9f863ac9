"""Functions from outside called as kernels call them: compiled for one state and for lanes, and uncompiled."""

from collections.abc import Iterator
from contextlib import contextmanager
from hashlib import sha256
from typing import Any

import numpy as np

from piazzi import kernels
from piazzi.kernels.spec import KernelSpec
from piazzi.kernels.tables import table_source
from piazzi.model import Model
from piazzi.model.functions import Signature

ENTRIES = """
@entry
def run_one(K: int, x: Array, data: Array, at: int, out: Array) -> None:
    for k in range(K):
        v = {name}({numbers}, data, at)
        {store}


@entry
def run_lanes(K: int, x: Array, data: Array, at: int, out: Array) -> None:
    for k in range(K):
        a = load_packs(x, k * {A} * LANES, {A}, LANES)
        v = {name}({packs}, data, at)
        store_packs(out, k * {R} * LANES, vector({results}), LANES)
"""


class Called:
    """A function of a signature: `one` and `lanes` take rows of arguments and give rows of results."""

    def __init__(self, entries: Any, arguments: int, results: int, lanes: int) -> None:
        self.entries, self.A, self.R, self.w = entries, arguments, results, lanes

    def one(self, x: np.ndarray, data: np.ndarray, at: int = 0) -> np.ndarray:
        out = np.empty((len(x), self.R))
        self.entries.run_one(len(x), np.ascontiguousarray(x, dtype=float), data, at, out)
        return out

    def lanes(self, x: np.ndarray, data: np.ndarray, at: int = 0) -> np.ndarray:
        groups = len(x) // self.w
        given = np.ascontiguousarray(x.reshape(groups, self.w, self.A).transpose(0, 2, 1), dtype=float)
        out = np.empty((groups, self.R, self.w))
        self.entries.run_lanes(groups, given, data, at, out)
        return out.transpose(0, 2, 1).reshape(-1, self.R)


@contextmanager
def called(signature: Signature, *, partials: bool, lanes: int = 8, single: tuple[int, ...] = ()) -> Iterator[Called]:
    """The function, or the one with partials; in lanes, `single` arguments are numbers: those of the first lane."""
    A = signature.arguments
    R = signature.outputs + (len(signature.partials) if partials else 0)
    name = signature.function + ("_partials" if partials else "")
    results = [f"v[{i}]" for i in range(R)]
    text = ENTRIES.format(
        name=name,
        A=A,
        R=R,
        numbers=", ".join(f"x[k * {A} + {i}]" for i in range(A)),
        packs=", ".join(f"x[k * {A} * LANES + {i} * LANES]" if i in single else f"a[{i}]" for i in range(A)),
        store="; ".join(f"out[k * {R} + {i}] = {r}" for i, r in enumerate(results)),
        results=", ".join(results),
    )
    own = table_source(signature.outputs, signature.terms) if signature.terms else signature.code
    shared = () if own else (signature.fragment,)
    lent = f"tried_{sha256((own + text).encode()).hexdigest()[:12]}"
    with kernels.fragment(lent, own + text):
        spec = KernelSpec(Model(["x"], ["0"], [], discrete=True), kernels.Discrete().scheme, (*shared, lent), lanes)
        yield Called(kernels.load(spec), A, R, lanes)
