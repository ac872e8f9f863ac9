"""Every TOML block of the documentation is TOML, and loads: whole scenarios as they are, fragments within one of their kind."""

import re
import shutil
import tomllib
from pathlib import Path

import numpy as np
import pytest

from piazzi import earth
from piazzi.scenarios.loader import load_scenario, read_scenario
from piazzi.scenarios.table import Faults

ROOT = Path(__file__).resolve().parents[2]
FENCE = re.compile(r"^```toml\n(.*?)^```$", re.MULTILINE | re.DOTALL)
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
BLOCKS = [
    pytest.param(m[1], id=f"{page.stem}-{page.read_text().count(chr(10), 0, m.start()) + 1}")
    for page in PAGES
    for m in FENCE.finditer(page.read_text(encoding="utf-8"))
]
X = [7e6, 0.0, 0.0, 0.0, 5.3e3, 5.3e3]
AXES = ("x", "y", "z")


def base(fragment):
    """A whole scenario of a satellite, but for what a fragment says."""
    out = {
        "epoch": "2016-02-13T16:00:00 UTC",
        "sensors": {"range": {"components": {"seen": "x"}}},
        "stations": [{"name": "a", "sensor": "range", "noise": {"sigma": 1.0}}],
        "prior": {"mean": X, "sigma": [10.0] * 3 + [0.1] * 3},
        "times": {"step": 60.0, "count": 3},
    }
    if "prior" in fragment:
        del out["prior"]
    if "mean" not in fragment.get("prior", {"mean": X}):  # of an orbit
        out["earth"] = {"degree": 2}
    elif "earth" not in fragment:
        out["states"] = [*AXES, *(f"v{a}" for a in AXES)]
        out["dynamics"] = {a: f"v{a}" for a in AXES} | {f"v{a}": f"-1e-6*{a}" for a in AXES}
    if "roots" in fragment.get("sensors", {}).get("range", {}):  # the light time of a field's and a body's scenario
        out["sensors"]["range"]["components"] = {"distance": "rho"}
        out["dynamics"] |= {"vy": "ay + 1e-30*(sx + sy + sz)", "vz": "az"}
        out["parameters"] = {"c": 299792458.0, "thrust": 1e-6, "phi": 0.1}
    return out


def merged(below, above):
    return above if not isinstance(above, dict) or not isinstance(below, dict) else below | {
        key: merged(below.get(key), value) for key, value in above.items()
    }  # fmt: skip


def data(folder):
    """Files that fragments name."""
    t = np.arange(-600.0, 4000.0, 60.0)
    (folder / "push.csv").write_text("".join(f"{a},{b}\n" for a, b in zip(t, np.sin(t / 900.0), strict=True)))
    (folder / "density.csv").write_text("".join(f"{a},{h},{-h}\n" for a in (0.0, 9e3) for h in (2.0, 3.0)))
    import astropy_iers_data

    shutil.copy(astropy_iers_data.IERS_A_FILE, folder / "finals2000A.all")


def load(text, folder):
    tables = tomllib.loads(text)
    (folder / "block.toml").write_text(text)
    if "states" in tables:
        load_scenario(folder / "block.toml")
    elif any(key in station for station in tables.get("stations", ()) for key in ("latitude", "position")):
        assert len(earth.read_stations(folder / "block.toml")) == len(tables["stations"])
    else:
        data(folder)
        faults = Faults()
        faults.folder = folder
        read_scenario(merged(base(tables), tables), "block", faults)
        if faults:
            raise ValueError("; ".join(map(str, faults)))


@pytest.mark.parametrize("text", BLOCKS)
def test_a_block_loads(text, tmp_path):
    load(text, tmp_path)


def test_there_are_blocks():
    assert len(BLOCKS) >= 7


def test_blocks_of_the_shared_pages_load(data_dir, tmp_path):
    """Their scenario has everything but the place of a station, which a scenario cannot say by itself."""
    found = [m[1] for page in sorted(data_dir.parent.glob("*.md")) for m in FENCE.finditer(page.read_text(encoding="utf-8"))]
    for text in found:
        if "station(" in text:
            with pytest.raises(ValueError, match=r"^[^;]*station 'a' has no place, which its sensor 'range' needs"):
                load(text, tmp_path)
        load(text.replace('"station(t)"', '"sun(t)"'), tmp_path)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[functions\n", "Expected"),
        ('[functions]\nf = { kind = "tabel" }\n', "tabel"),
        ('[dynamics]\nvx = "ax"\n', "unknown name 'ax'"),
        ("[flux]\na = 1\n", "flux"),
    ],
)
def test_a_wrong_block_is_noticed(text, message, tmp_path):
    with pytest.raises(ValueError, match=message):
        load(text, tmp_path)
