"""What is compiled depends on no setting of Numba's, neither of the environment nor of a file in the working directory."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.waiting import HANGS

pytestmark = pytest.mark.slow  # each of these compiles

FILTER = """
import piazzi as pz
model = pz.Model(["x"], ["-k*x"], [pz.Sensor("s", ["x**2"])], ["k"])
problem = pz.Problem(model, pz.Gaussian(1.0, 0.1), 0.01, pz.Station("s", "s", 0.1), {"k": 0.5}, pz.Taylor(1))
estimate = pz.ExtendedKalmanFilter().estimate(problem, pz.Tracking([0.0, 1.0], [1.1, 0.4]))
print(estimate.mean.tobytes().hex())
"""


def run(folder: Path, code: str = FILTER, **settings: str) -> str:
    environment = {k: v for k, v in os.environ.items() if not k.startswith("NUMBA_")}
    environment |= {"PIAZZI_CACHE": str(folder / "cache"), **settings}
    command = [sys.executable, "-P", "-W", "error", "-c", code]
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, timeout=HANGS, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    return done.stdout


def instructions(folder: Path) -> list[str]:
    """Machine code of the one kernel, without the names in it."""
    code = (
        "import sys, llvmlite.binding as llvm\n"
        "for section in llvm.ObjectFileRef.from_path(sys.argv[1]).sections():\n"
        "    print(section.name(), section.data().hex()) if section.is_text() else None\n"
    )
    (file,) = (folder / "cache").glob("*/*.o")
    return subprocess.run([sys.executable, "-c", code, file], capture_output=True, text=True, check=True).stdout.splitlines()


@pytest.fixture(scope="module")
def plain(tmp_path_factory):
    """Result and code without settings."""
    folder = tmp_path_factory.mktemp("plain")
    return run(folder), instructions(folder)


SETTINGS = {
    "no optimisation": {"NUMBA_OPT": "0"},
    "another processor": {"NUMBA_CPU_NAME": "generic", "NUMBA_CPU_FEATURES": ""},
    "no compilation": {"NUMBA_DISABLE_JIT": "1"},
    "nonsense": {"NUMBA_OPT": "a lot"},
    "checks of bounds": {"NUMBA_BOUNDSCHECK": "1", "NUMBA_DEBUGINFO": "1"},
}


@pytest.mark.parametrize("name", SETTINGS)
def test_the_environment_changes_nothing(plain, tmp_path, name):
    assert (run(tmp_path, **SETTINGS[name]), instructions(tmp_path)) == plain


FILES = {
    "no compilation": "disable_jit: 1\n",
    "no optimisation": "opt: 0\n",
    "no YAML": "]: {\n",
    "a list": "- 1\n- 2\n",
    "no text": "\\xff",
}


@pytest.mark.parametrize("name", FILES)
def test_a_file_of_the_working_directory_changes_nothing(plain, tmp_path, name):
    pytest.importorskip("yaml", reason="without it, Numba reads no such file")
    (tmp_path / ".numba_config.yaml").write_text(FILES[name])
    assert (run(tmp_path), instructions(tmp_path)) == plain


def test_such_a_file_that_comes_later_changes_nothing(plain, tmp_path):
    """Numba looks for it at every compilation."""
    code = "from piazzi.kernels.settings import own_settings\nwith own_settings(): pass\n"
    code += "import pathlib\npathlib.Path('.numba_config.yaml').write_text(']: {')\n"
    assert (run(tmp_path, code + FILTER), instructions(tmp_path)) == plain


def test_settings_stay_what_they_are_for_others(tmp_path):
    """Who compiles functions of his own in the same process has his settings for them, before and after."""
    code = "import numba\nassert numba.config.OPT == 1, numba.config.OPT\nassert numba.config.DISABLE_JIT == 1\n"
    for program in (code + FILTER + code, FILTER + code):
        run(tmp_path, program, NUMBA_OPT="1", NUMBA_DISABLE_JIT="1")


def test_code_of_a_process_that_set_numba_up_otherwise_is_not_kept(plain, tmp_path):
    """There, Numba has looked at its settings already: the result is right, and gone with the process."""
    code = "import numba\nnumba.njit(lambda x: x + 1)(1)\n"
    assert run(tmp_path, code + FILTER, NUMBA_CPU_NAME="generic", NUMBA_CPU_FEATURES="") != ""
    assert list((tmp_path / "cache").iterdir()) == []
    assert run(tmp_path, code + FILTER, NUMBA_NUM_THREADS="1") == plain[0]
    assert instructions(tmp_path) == plain[1]
