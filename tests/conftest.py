"""Surroundings of every test: a kernel cache of its own, and the recordings that the project does not contain."""

import os
import sys
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

ROOT = Path(__file__).resolve().parent.parent

# Set before anything imports piazzi, and inherited by the programs that tests start.  Kept between runs, because a kernel
# takes seconds to compile; safe to keep, because its hash covers all that it was made from.
CACHE = ROOT / ".cache" / "tests"
CACHE.mkdir(mode=0o700, parents=True, exist_ok=True)
os.environ["PIAZZI_CACHE"] = str(CACHE)
os.environ["MPLBACKEND"] = "Agg"

# Tests that are about these set them; where the caller has set them, tables would be cut and coloured, and errors longer.
for name in ("COLUMNS", "LINES", "FORCE_COLOR", "NO_COLOR", "PIAZZI_DEBUG", "PYTHONIOENCODING"):
    os.environ.pop(name, None)

# Neither a deadline nor a limit for drawing: a first call may compile, on a busy machine.  In CI the same commit draws the
# same examples.
settings.register_profile("piazzi", deadline=None, derandomize="CI" in os.environ, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("piazzi")


@pytest.fixture(scope="session", autouse=True)
def compiled_by_whoever_needs_them():
    """No processes that compile ahead: each imports for seconds before it begins, and tests keep all processors busy anyway."""
    from piazzi.kernels import ahead

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(ahead, "DEAR", sys.maxsize)
        yield


@pytest.fixture(scope="session")
def data_dir() -> Path:
    """Folder of the recordings: `PIAZZI_DATA`, else `../shared/data` from the repository root.

    Where there is none, tests of them are skipped; with ``PIAZZI_DATA_REQUIRED=1``, as in CI, they fail.
    """
    folder = Path(os.environ.get("PIAZZI_DATA") or ROOT.parent / "shared" / "data")
    if not folder.is_dir():
        absent = pytest.fail if os.environ.get("PIAZZI_DATA_REQUIRED") == "1" else pytest.skip
        absent(f"no recordings at {folder}: PIAZZI_DATA names their folder")
    return folder
