"""Memory of long runs and live sessions stays flat; `python tests/fuzz/memory.py` runs longer."""

import subprocess
import sys
from pathlib import Path

import pytest

MEMORY = Path(__file__).with_name("memory.py")


@pytest.mark.slow
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="memory is read as Linux tells it")
def test_memory_stays_flat():
    done = subprocess.run([sys.executable, MEMORY, "--epochs", "200000", "--updates", "180000"], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
