"""Damaged inputs of every format, the same ones every time; `python tests/fuzz/fuzz.py all` tries for minutes."""

import subprocess
import sys
from pathlib import Path

import pytest

FUZZ = Path(__file__).with_name("fuzz.py")
FORMATS = ["scenario", "csv", "npz", "nc", "checkpoint", "follow", "log", "store", "expression", "tdm", "oem", "opm"]
FORMATS += ["laser", "sp3", "astrometry", "surveillance", "table"]
DEAR = ("checkpoint", "follow")  # a few take ten seconds, as their seeds are runs of many estimators
CASES = [pytest.param(name, 15) for name in FORMATS if name not in DEAR]
CASES += [pytest.param(name, 100, marks=pytest.mark.slow) for name in FORMATS]

pytestmark = pytest.mark.skipif(
    not sys.platform.startswith("linux"), reason="children with limits are made as Linux makes them"
)


@pytest.mark.parametrize(("name", "count"), CASES)
def test_damaged_inputs_end_in_one_clear_line(name, count, tmp_path):
    options = ["--inputs", str(count), "--minutes", "60", "--seed", "1", "--keep", str(tmp_path)]
    done = subprocess.run([sys.executable, FUZZ, name, *options], capture_output=True, text=True)
    found = "\n\n".join(path.read_text()[:1000] for path in sorted(tmp_path.glob("*/finding.txt"))[:5])
    assert done.returncode == 0, f"{done.stdout}\n{done.stderr[-2000:]}\n{found}"
