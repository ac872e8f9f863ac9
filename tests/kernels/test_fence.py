"""What is private in Numba is named in two files, and Piazzi works without what only saves time."""

import ast
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

import piazzi
from tests.waiting import HANGS

KERNELS = Path(piazzi.__file__).parent / "kernels"
FENCE = {"compiler.py", "settings.py"}


def test_private_parts_of_numba_are_named_in_two_files():
    for file in sorted(KERNELS.parent.rglob("*.py")):
        if file.name in FENCE and file.parent == KERNELS:
            continue
        text = file.read_text(encoding="utf-8")
        for node in ast.walk(ast.parse(text)):
            names = [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            names += [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            wrong = [n for n in names if n.startswith("numba.") and n != "numba.extending"]
            assert not wrong, f"{file}:{node.lineno}: {wrong}"
        assert not re.search(r"callback\._[a-z]|numba\.core", text), file


FILTER = """
import piazzi as pz
model = pz.Model(["x"], ["-k*sin(x)"], [pz.Sensor("s", ["x**2"])], ["k"])
problem = pz.Problem(model, pz.Gaussian(1.0, 0.1), 0.01, pz.Station("s", "s", 0.1), {"k": 0.5}, pz.Taylor(1))
estimate = pz.ExtendedKalmanFilter().estimate(problem, pz.Tracking([0.0, 1.0, 2.0], [1.1, 0.4, 0.3]))
print(*estimate.mean.ravel())
"""
HIDING = {
    "nothing": "",
    "the library of code": "import numba.core.codegen as c; del c.JITCodeLibrary",
    "the compiler": "import numba.core.compiler as c; del c.CompilerBase",
    "its target machine": "import piazzi.kernels.compiler as c; del c._Object.object_code",
}


def run(folder: Path, hide: str) -> tuple[list[float], str]:
    folder.mkdir()
    environment = {**os.environ, "PIAZZI_CACHE": str(folder / "cache")}
    command = [sys.executable, "-c", f"{hide}\n{FILTER}"]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=HANGS, check=False)
    assert done.returncode == 0, done.stderr
    return [float(number) for number in done.stdout.split()], done.stderr


@pytest.mark.slow
def test_without_them_kernels_are_compiled_by_public_functions(tmp_path):
    """Slower, with one warning, and the same numbers; nothing is kept that could not be loaded."""
    expected, told = run(tmp_path / "whole", HIDING["nothing"])
    assert told == ""
    for name in list(HIDING)[1:]:
        found, told = run(tmp_path / name, HIDING[name])
        assert found == pytest.approx(expected, rel=1e-13), name
        assert told.count("Piazzi does not know Numba") == 1, name
        assert list((tmp_path / name / "cache").iterdir()) == [], name
