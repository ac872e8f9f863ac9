"""The public face: everything it names exists, and nothing heavy is imported before it is needed."""

import importlib
import os
import pkgutil
import subprocess
import sys
from pathlib import Path

import pytest

import piazzi
from piazzi.faces import homes

ROOT = Path(__file__).resolve().parent.parent
HEAVY = {
    "numpy",
    "sympy",
    "numba",
    "llvmlite",
    "matplotlib",
    "xarray",
    "scipy",
    "pandas",
    "h5py",
    "h5netcdf",
    "rich",
    "dask",
}


def loaded_after(code: str, **env: str) -> set[str]:
    """Heavy modules that a fresh process has imported after the code."""
    run = subprocess.run(
        [sys.executable, "-c", f"{code}\nimport sys\nprint('LOADED', *sorted({HEAVY!r} & set(sys.modules)))"],
        check=True, capture_output=True, text=True, cwd=ROOT, env={**os.environ, **env},
    )  # fmt: skip
    return set(run.stdout.splitlines()[-1].split()[1:])


def test_every_public_name_is_there():
    for name in piazzi.__all__:
        assert getattr(piazzi, name) is not None, name
    assert dir(piazzi) == sorted(piazzi.__all__)
    assert len(set(piazzi.__all__)) == len(piazzi.__all__)


@pytest.mark.parametrize("name", ["", ".earth", ".earth.sensors", ".evaluate", ".formats", ".orbit", ".scenarios"])
def test_packages_say_where_each_of_their_names_is(name):
    package = importlib.import_module(f"piazzi{name}")
    told = homes(package.__file__).keys() | ({"scenarios"} if not name else set())  # which answers when it is called
    assert told == set(package.__all__)
    assert all(getattr(package, one) is not None for one in package.__all__)
    assert dir(package) == sorted(package.__all__)


def test_function_with_the_name_of_its_module_is_the_function_whoever_imports_the_module_first():
    code = "import piazzi.orbit.lambert, piazzi.orbit\nassert callable(piazzi.orbit.lambert)\nfrom piazzi.earth import rotation"
    loaded_after(f"{code}\nassert callable(rotation)")


def test_unknown_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="module 'piazzi' has no attribute 'Kalman'"):
        _ = piazzi.Kalman


def test_importing_piazzi_imports_nothing_heavy():
    assert loaded_after("import piazzi; piazzi.__version__, dir(piazzi)") == set()


def test_models_need_no_numbers_and_problems_no_compiler():
    assert loaded_after("import piazzi; piazzi.Model(['x'], ['-x**2'], [piazzi.Sensor('s', ['sin(x)'])])") <= {"numpy"}
    code = "import piazzi as pz; pz.Problem(pz.Model(['x'], ['-x**2']), pz.Gaussian(1.0, 1.0))"
    assert loaded_after(code) == {"numpy"}


WARM = """
import numpy as np, piazzi as pz
from tests.laws.problems import satellite
problem = satellite()
tracking = pz.simulate(problem, np.arange(20) * 15.0, np.random.default_rng(0))
assert pz.ExtendedKalmanFilter().estimate(problem, tracking).success
"""


def test_warm_simulation_and_filter_load_llvm_alone():
    loaded_after(WARM)  # compiles what is not in the tests' cache yet
    assert loaded_after(WARM) == {"numpy", "llvmlite"}


def test_every_module_can_be_imported_by_itself():
    names = [m.name for m in pkgutil.walk_packages(piazzi.__path__, "piazzi.")]
    generated = "piazzi.kernels.fragments."  # pieces of a module, whose other names come with it
    for name in names:
        if not name.startswith(generated) and not name.endswith("__main__"):
            importlib.import_module(name)
