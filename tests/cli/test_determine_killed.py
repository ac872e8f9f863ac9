"""A determination that is killed while it writes leaves every product whole, or as it was."""

import json
import signal
import subprocess
import sys
import time
import tomllib
from pathlib import Path

import numpy as np
import pytest

import piazzi as pz
from tests.determination.fixing import observations, truth

pytestmark = pytest.mark.slow
NAMES = ("x.oem", "x.opm", "x.ocm", "x.nc", "x.csv", "x.json", "x.toml", "x.tle", "case.toml")
WRITES = """
import pickle, sys
from piazzi.determination.case_text import write_case
found = pickle.load(open("found.pickle", "rb"))
while True:
    for name in {names!r}:
        print("begins", flush=True)
        if name == "case.toml":
            write_case(name, found.case, found.setup)
        else:
            found.write(name, span="first .. last+6h", step=900.0)
"""


def whole(path):
    """Whether a file is what a writer that was left alone makes; raises where it cannot be read."""
    text = path.read_text() if path.suffix != ".nc" else ""
    match path.suffix:
        case ".oem" | ".opm":
            return len(pz.read_ephemeris(path).arcs) == 1 and text.endswith("\n")
        case ".ocm":
            return text.endswith("OD_STOP\n")
        case ".nc":
            import xarray

            with xarray.open_dataset(path, engine="h5netcdf") as data:
                return data.sizes["measurement"] > 0
        case ".csv":
            return len({line.count(",") for line in text.splitlines()}) == 1 and text.endswith("\n")
        case ".json":
            return json.loads(text)["schema"] == "piazzi.determine/1"
        case ".toml":
            return bool(tomllib.loads(text)["determine"])
    return len(text.splitlines()) in (2, 3)


def test_killed_at_any_moment(tmp_path):
    import pickle

    t = np.arange(0.0, 43200.0, 1200.0)
    path = truth(t)[:, :3] + 5.0 * np.random.default_rng(0).standard_normal((len(t), 3))
    (tmp_path / "found.pickle").write_bytes(pickle.dumps(pz.determine(observations(path, t, 5.0))))
    rng = np.random.default_rng(1)
    for k in range(8):  # while the first product is written, the second, ...
        writer = subprocess.Popen(
            [sys.executable, "-c", WRITES.format(names=NAMES[k:] + NAMES[:k])], cwd=tmp_path, stdout=subprocess.PIPE, text=True
        )
        assert [writer.stdout.readline() for _ in range(k + 1)] == ["begins\n"] * (k + 1)
        time.sleep(float(rng.uniform(0.0, 0.3)))
        writer.send_signal(signal.SIGKILL)
        writer.wait()
        writer.stdout.close()
        for name in NAMES:
            if (tmp_path / name).exists():
                assert whole(tmp_path / name), name
    assert sum((tmp_path / name).exists() for name in NAMES) >= 5  # it was killed while it wrote, not before
    left = [entry.name for entry in Path(tmp_path).iterdir() if entry.name not in (*NAMES, "found.pickle")]
    assert all(".piazzi-" in name and name.startswith(".") for name in left)  # nothing that anybody takes for a product
