"""Generated modules: the same text everywhere, every function of the language also when loaded from disk, arrays checked."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

import piazzi as pz
from piazzi import kernels
from piazzi.expressions import FUNCTIONS
from piazzi.kernels import KernelSpec, cache
from piazzi.kernels.build import compile_entries

ROOT = Path(__file__).resolve().parents[2]

SOURCES = """
import hashlib, numpy as np, piazzi as pz
from piazzi.estimate.kalman import update_fragments
from tests.laws.problems import b612, network, satellite
from tests.model.test_definitions import NAMED, problem as with_definitions
for problem in (satellite(), satellite(pz.RungeKutta4(2)), b612(), network(np.random.default_rng(0)), with_definitions(NAMED)):
    for backend in ("plain", "compiled"):
        parts = ("transition", problem.noise_fragment, *update_fragments(problem, "auto"), "filter")
        print(hashlib.sha256(problem.spec(*parts).source(backend).encode()).hexdigest())
"""


def test_sources_are_the_same_in_every_process():
    """Whatever the order in which sets are walked: else the same seed would not give the same bytes on two machines."""
    printed = set()
    for seed in ("0", "1"):
        env = {**os.environ, "PYTHONHASHSEED": seed}
        run = subprocess.run([sys.executable, "-c", SOURCES], check=True, capture_output=True, text=True, cwd=ROOT, env=env)
        printed.add(run.stdout)
    assert len(printed) == 1
    assert len(set(printed.pop().split())) == 10


@pytest.mark.parametrize(
    ("features", "lanes"),
    [
        ({"avx512f": True, "avx": True, "sse2": True}, 8),
        ({"avx512f": False, "avx": True, "sse2": True}, 4),
        ({"avx": False, "sse2": True}, 2),
        ({"neon": True, "sve": False}, 2),
        ({}, 1),
    ],
)
def test_lanes_are_as_wide_as_the_machines_registers(features, lanes):
    from piazzi.kernels.spec import lanes_with

    assert lanes_with(features) == lanes


def test_lanes_are_part_of_the_key_of_a_kernel():
    problem = everything()
    assert len({problem.spec("transition", "filter", lanes=lanes).digest() for lanes in (1, 2, 4, 8)}) == 4


def everything() -> pz.Problem:
    """A model in whose rates and measurements every function of the language occurs."""
    one = [f"{name}(0.2 + x*x/9)" for name, arity in sorted(FUNCTIONS.items()) if arity == 1]
    two = [f"{name}(x, y + 2)" for name, arity in sorted(FUNCTIONS.items()) if arity == 2]
    rates = [" + ".join(one), " - ".join(two) + " + x**y + y**(1/3)"]
    model = pz.Model(["x", "y"], rates, [pz.Sensor("s", [f"x*({' + '.join(one)})"])])
    return pz.Problem(model, pz.Gaussian([0.7, 1.2], np.eye(2)), None, pz.Station("s", "s", 1.0), integrator=pz.Taylor(1))


def test_every_function_of_the_language_compiles_and_loads(monkeypatch):
    """Compiled, read back from disk into code without Numba, and uncompiled: the same numbers."""
    problem, x = everything(), np.array([[0.7, 1.2], [0.3, 0.9], [0.4, 2.0]])
    results = []
    for jit in ("1", "1", "0"):
        monkeypatch.setenv("PIAZZI_JIT", jit)
        monkeypatch.setattr(cache, "_loaded", {})
        results.append(
            [problem.dynamics(x), problem.dynamics_jacobian(x), problem.measure("s", x), problem.measurement_jacobian("s", x)]
        )
    for first, again, plain in zip(*results, strict=True):
        assert np.isfinite(first).all()
        assert_allclose(again, first, rtol=0, atol=0)
        assert_allclose(plain, first, rtol=1e-12, atol=1e-13)


def test_arrays_that_a_kernel_could_misread_are_refused():
    from piazzi.kernels.library import Entry
    from piazzi.kernels.members import FLOATS

    entry = Entry("run", 0, (FLOATS,), {}, None)
    for array in (
        np.zeros((4, 4))[:, ::2],
        np.zeros(3, dtype=np.float32),
        np.zeros(3, dtype=complex),
        np.zeros(3, dtype=bool),
        np.zeros(3, dtype=">f8"),
    ):
        with pytest.raises(TypeError, match="argument 0 of kernel run must be contiguous float64"):
            entry(array)


def test_only_the_entries_of_a_module_are_public():
    problem = everything()
    library = cache.load(problem.spec("transition", "rates"))
    assert set(vars(library)) == {"evaluate_dynamics", "evaluate_dynamics_jacobian"}


def test_first_compilation_is_told_in_one_line(monkeypatch, caplog, tmp_path):
    from piazzi.kernels import folder

    monkeypatch.setenv("PIAZZI_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(cache, "_loaded", {})
    monkeypatch.setattr(cache, "compile_entries", lambda source: ({}, {}))
    folder.private_folder.cache_clear()
    folder.writable_folder.cache_clear()
    try:
        with caplog.at_level("INFO", logger="piazzi.kernels"):
            cache.load(everything().spec("transition", "rates"))
            cache.load(everything().spec("transition", "rates"))
    finally:
        folder.private_folder.cache_clear()
        folder.writable_folder.cache_clear()
    assert len(caplog.messages) == 1
    assert "compiling rates for x, y, once" in caplog.messages[0]


OUTLINED = """
@outlined
def long_way(x):
    return sin(x)*exp(cos(x) - sin(2.0*x)) + log(1.0 + x*x)


@inline
def many_times(x):
    for _ in range(2):
        x = {calls}
    return x


@entry
def run_many(x: Array) -> None:
    x[0] = many_times(x[0])
"""


def test_a_helper_that_is_outlined_is_compiled_once_whatever_calls_it():
    """Numba lets what an inlined function calls be inlined too, unless that says otherwise."""
    sizes = []
    for count in (1, 40):
        calls = "long_way(" * count + "x" + ")" * count
        with kernels.fragment(f"called_{count}_times", OUTLINED.format(calls=calls)):
            spec = KernelSpec(pz.Model(["x"], ["0"], discrete=True), kernels.Discrete().scheme, (f"called_{count}_times",))
            objects, _ = compile_entries(spec.source("compiled"))
        sizes.append(len(objects["run_many"]))
    assert sizes[1] < 2 * sizes[0]
