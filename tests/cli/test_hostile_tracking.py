"""Broken and odd files of tracking, and bad ways to call, through the whole program: one clear line, nothing half written."""

import numpy as np
import pytest

STATIONS = '[[stations]]\nname = "7090"\nlatitude = -29.0\nlongitude = 115.3\nheight = "240 m"\n'
CRD = """H1 CRD  1 2016 02 14 01
H2 YARAGADE   7090  5 13  4
H3 lageos2    9207002 5986    22195 0 1
H4  1 2016 02 13 13 43 02 2016 02 13 14 06 29  0 0 0 0 1 0 2 0
C0 0    532.000 std
11 49382.4005626000     0.0472345678901 std 2  120.0    50      80.0  -0.100   0.000     -1.0  10.0 0
11 49502.4005626000     0.0462345678901 std 2  120.0    50      80.0  -0.100   0.000     -1.0  10.0 0
11 49622.4005626000     0.0452345678901 std 2  120.0    50      80.0  -0.100   0.000     -1.0  10.0 0
20 49382.400  985.00 300.00  40 0
H8
H9
"""
TDM = """CCSDS_TDM_VERS = 2.0
CREATION_DATE = 2026-01-01T00:00:00
ORIGINATOR = TEST
META_START
TIME_SYSTEM = UTC
PARTICIPANT_1 = 7090
PARTICIPANT_2 = SAT
MODE = SEQUENTIAL
PATH = 1,2,1
ANGLE_TYPE = AZEL
META_STOP
DATA_START
ANGLE_1 = 2026-01-01T00:00:00 10.0
ANGLE_2 = 2026-01-01T00:00:00 20.0
DATA_STOP
"""
FILES = {
    "cut.npt": CRD[:500],
    "nines.npt": "".join("9" if c.isdigit() else c for c in CRD),
    "empty.npt": "",
    "old.npt": CRD.replace("2016", "1816"),
    "unended.npt": CRD.replace("H8\nH9\n", ""),
    "short.npt": CRD,
    "nan.npt": CRD.replace("0.0472345678901", "nan"),
    "huge.npt": CRD.replace("0.0472345678901", "1e300"),
    "stranger.npt": CRD.replace("7090", "1234"),
    "one.tdm": TDM,
    "unclosed.tdm": TDM.replace("DATA_STOP\n", ""),
    "value.tdm": TDM.replace("20.0", "twenty"),
    "scale.tdm": TDM.replace("UTC", "MRT"),
    "date.tdm": TDM.replace("2026-01-01T00:00:00 10.0", "2026-13-01T00:00:00 10.0"),
    "path.tdm": TDM.replace("1,2,1", "1,2,3"),
    "keyword.tdm": TDM.replace("ANGLE_1", "ANGEL_1"),
    "columns.csv": "time,azimuth\nnow,north\n",
    "text.txt": "this is no tracking at all\n",
}
CALLS = {
    "unwritable": ["short.npt", "-o", "/proc/out.oem"],
    "estimator": ["short.npt", "--with", "grpah"],
    "scale": ["short.npt", "--epoch", "2016-02-13T16:00:00"],
    "stations": ["short.npt", "--stations", "nowhere.snx"],
    "guess": ["short.npt", "--guess", "a=-7 km e=0.1"],
    "missing": ["missing.npt"],
    "folder": ["folder.npt"],
    "hold": ["short.npt", "--hold", "3/2"],
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    here = tmp_path_factory.mktemp("hostile")
    for name, text in FILES.items():
        (here / name).write_text(text)
    (here / "noise.tdm").write_bytes(np.random.default_rng(0).bytes(20000))
    (here / "folder.npt").mkdir()
    (here / "sites.toml").write_text(STATIONS)
    return here


@pytest.mark.slow
@pytest.mark.parametrize("arguments", [*([name] for name in [*FILES, "noise.tdm"]), *CALLS.values()], ids=" ".join)
def test_it_ends_with_one_line_and_leaves_nothing(folder, call, monkeypatch, arguments):
    monkeypatch.chdir(folder)
    sites = [] if "--stations" in arguments else ["--stations", "sites.toml"]
    output = [] if "-o" in arguments else ["-o", "out.oem"]
    (folder / "out.oem").unlink(missing_ok=True)
    done = call("determine", *arguments, *sites, *output)
    assert done.status in (2, 3), done.err
    assert "Traceback" not in done.err and "Traceback" not in done.out
    if done.status == 2:
        assert len(done.said) == 1, done.said
    assert not (folder / "out.oem").exists() and not list(folder.glob("*.tmp*"))
