"""What a user's type checker sees: mypy --strict on code that uses the wheel, installed into an environment of its own."""

import re
import subprocess
import sys
import sysconfig
import venv
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
pytestmark = pytest.mark.slow

USER = """

# ---- the other rows of the README's table ----

from collections.abc import Mapping

from piazzi.estimate import Estimator
from piazzi import Comparison, Estimate, Forecast, Observability, Problem, Tracking, WindowTrade

loaded: tuple[Problem, Tracking] = pz.load("b612-range", seed=3)
problem, tracking = loaded
estimators: Mapping[str, Estimator] = {"ekf": pz.ExtendedKalmanFilter(), "graph": pz.FactorGraph()}
camera = pz.Sensor("camera", {"bearing": "atan2(x, d)"}, angles=["bearing"], units={"bearing": "rad"})
spring = pz.Model(("x", "v"), {"x": "v", "v": "-k*x"}, camera, [pz.Parameter("k", "estimated")], units={"x": "m"})
by_mapping: Comparison = pz.compare(problem, tracking, estimators)
by_name: Comparison = pz.compare(problem, tracking, ["ekf", "window:20"])
results: list[Estimate] = [
    pz.UnscentedKalmanFilter().estimate(problem, tracking),
    pz.SquareRootKalmanFilter().estimate(problem, tracking),
    pz.Smoother().estimate(problem, tracking),
    pz.SlidingWindow(lag=100, iterations=1).estimate(problem, tracking),
    pz.FactorGraph(loss="huber").estimate(problem, tracking),
    pz.FactorGraph(start="bank").estimate(problem, tracking),
    pz.BatchLeastSquares().estimate(problem, tracking),
]
ahead: Forecast = results[0].predict([10.0, 20.0])
trade: WindowTrade = pz.windows(problem, tracking, [1, 10])
seen: Observability = pz.observability(problem, tracking)
live = pz.ExtendedKalmanFilter().start(problem)
live.update("radar", 9.0, 0.0)
moved: Problem = pz.with_prior_at(problem, -1.0)
text: str = by_name.to_json()
study = pz.Study(problem, tracking.times, {"ekf": pz.ExtendedKalmanFilter()}, runs=10)
"""

WRONG = """
from piazzi import ExtendedKalmanFilter, Problem

def run(problem: Problem) -> int:
    return ExtendedKalmanFilter().estimate(problem, "rows.csv")
"""


@pytest.fixture(scope="module")
def python(tmp_path_factory) -> Path:
    """The interpreter of a new environment with the wheel in it; what the package depends on comes from this one."""
    folder = tmp_path_factory.mktemp("user")
    build = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", folder]
    subprocess.run(build, cwd=ROOT, check=True, capture_output=True)
    venv.create(folder / "env", with_pip=False)
    place = sysconfig.get_path("purelib", "venv", {"base": str(folder / "env"), "platbase": str(folder / "env")})
    with zipfile.ZipFile(*folder.glob("*.whl")) as wheel:
        assert "piazzi/py.typed" in wheel.namelist()
        wheel.extractall(place)
    (Path(place) / "dependencies.pth").write_text(sysconfig.get_path("purelib") + "\n")
    found = folder / "env" / ("Scripts" if sys.platform == "win32" else "bin") / "python"
    where = subprocess.run([found, "-c", "import piazzi; print(piazzi.__file__)"], check=True, capture_output=True, text=True)
    assert Path(where.stdout.strip()).is_relative_to(place)
    return found


def checked(python: Path, folder: Path, code: str) -> subprocess.CompletedProcess[str]:
    """mypy --strict on the code, without any configuration."""
    (folder / "mine.py").write_text(code, encoding="utf-8")
    command = [sys.executable, "-m", "mypy", "--strict", "--config-file=", "--python-executable", python, "mine.py"]
    return subprocess.run([*command, "--cache-dir", folder / "cache"], cwd=folder, capture_output=True, text=True, check=False)


def test_the_readme_and_its_table_check_strictly(python, tmp_path):
    (code,) = re.findall(r"```python\n(.*?)```", (ROOT / "README.md").read_text(encoding="utf-8"), re.DOTALL)
    found = checked(python, tmp_path, code + USER)
    assert found.returncode == 0, found.stdout + found.stderr


def test_wrong_types_are_found(python, tmp_path):
    """So that the code above was not taken for untyped."""
    said = checked(python, tmp_path, WRONG).stdout
    assert re.search(
        r'Argument 2 to "estimate" of "ExtendedKalmanFilter" has incompatible type "str"; expected "Tracking"', said
    )
    assert re.search(r'Incompatible return value type \(got "Estimate", expected "int"\)', said)
