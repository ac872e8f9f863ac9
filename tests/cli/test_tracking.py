"""`piazzi tracking`: what is in files, never asking; bad files in one line."""

import gzip
import json
import os

import numpy as np
import pytest

import piazzi as pz
from piazzi import earth


@pytest.fixture
def tdm(data_dir):
    return data_dir / "tdm/TDMExample8.txt"


def test_everything_that_is_in_a_file_is_shown(call, tdm):
    result = call("tracking", tdm)
    assert result.status == 0 and not result.said
    for words in (
        "21 rows over 8.00 h, 2007-08-29T06:00:02 UTC to 2007-08-29T14:00:02 UTC", "HBSTK", "WHM1", "x south",
        "path WHM1 to SAT to WHM1", "correction range of 5.99585e+08 applied", "quality raw", "times of reception",
        "Longest gap: 5.00 h", "1 row out of order", "Assumed: times are those of reception", "--range two-way", "--sigma",
    ):  # fmt: skip
        assert words in result.out


def test_tracking_in_the_package_is_shown_by_its_name_with_what_its_case_answers(call):
    for name, count in (("lageos-2", 95), ("ceres-1801", 40)):
        found = json.loads(call("tracking", name, "--json").out)
        assert found["rows"] == count and not found["open"], name


def test_json_has_counts_passes_conventions_and_what_is_open(call, tdm):
    found = call("tracking", tdm, "--json").document
    assert found["schema"] == "piazzi.tracking/1"
    assert (found["rows"], found["measurements"], found["scales"], found["objects"]) == (21, 21, ["UTC"], ["SAT"])
    assert (found["first"], found["last"]) == ("2007-08-29T06:00:02 UTC", "2007-08-29T14:00:02 UTC")
    (range_,) = [kind for kind in found["kinds"] if kind["kind"] == "range"]
    assert range_["unit"] == "m" and range_["rows"] == 3 and range_["stations"] == ["WHM1"]
    assert [(one["station"], one["rows"]) for one in found["passes"]] == [("WHM1", 8), ("HBSTK", 6), ("WHM1", 4), ("HBSTK", 3)]
    assert [told["rows"] for told in found["conventions"]] == [9, 12]
    assert found["conventions"][1]["corrections"] == [{"name": "range", "value": 2.0 * 299792458.0, "applied": True}]
    assert found["conventions"][1]["range_modulus"] == 1e7 * 299792458.0
    assert found["gaps"][0]["seconds"] == 5 * 3600.0
    assert any("--range" in text for text in found["open"])


def test_answers_leave_nothing_open(call, tdm):
    sigmas = ["--sigma", "1mrad", "--sigma", "range=10m", "--sigma", "range_rate_averaged=1mm/s"]
    found = call("tracking", tdm, "--json", "--range", "round-trip", *sigmas).document
    assert found["open"] == []
    assert found["kinds"][0]["median_sigma"] == 1e-3
    assert {told["range_is"] for told in found["conventions"]} == {"sum"}


def test_pictures_and_conversions_are_written(call, tdm, tmp_path, data_dir):
    packed = tmp_path / "a.gz"
    packed.write_bytes(gzip.compress(tdm.read_bytes()))
    result = call("tracking", packed, tdm, "-o", tmp_path / "p.png", "--to", tmp_path / "b.tdm")
    assert result.status == 0 and result.out.count("Wrote") == 2
    assert (tmp_path / "p.png").read_bytes()[:4] == b"\x89PNG"
    assert len(pz.read_tracking(tmp_path / "b.tdm")) == 42
    assert call("tracking", tdm, "--to", tmp_path / "c.csv").status == 0
    lines = [line for line in (tmp_path / "c.csv").read_text().splitlines() if not line.startswith("#")]
    assert lines[0].split(",")[:3] == ["time[UTC]", "station", "object"] and len(lines) == 7
    assert lines[4].startswith("2007-08-29T06:00:02.000000000,WHM1,SAT,-885.640091,,,1199665235")
    ephemeris = data_dir / "ccsds/odm/oem/OEMExample3.txt"
    assert call("tracking", ephemeris, "--to", tmp_path / "d.oem").status == 0
    assert len(pz.read_ephemeris(tmp_path / "d.oem").arcs) == 3
    assert "write an .oem" in call("tracking", ephemeris, "--to", tmp_path / "e.opm").refused()
    assert call("tracking", data_dir / "ccsds/odm/opm/OPMExample1.txt", "--to", tmp_path / "f.opm").status == 0
    assert call("tracking", data_dir / "ccsds/odm/oem/OEMExample5.txt", "--to", tmp_path / "g.ocm").status == 0
    assert "TRAJ_TYPE = CARTPV" in (tmp_path / "g.ocm").read_text()


def test_mean_elements_are_fitted_and_read_by_another_package(call, tmp_path, data_dir):
    from sgp4 import omm
    from sgp4.api import Satrec

    cpf = data_dir / "earth/lageos2/lageos2_cpf_160213_5441.sgf"
    for ending in ("tle", "omm"):
        assert call("tracking", cpf, "--to", tmp_path / f"a.{ending}").status == 0
    one, two = (tmp_path / "a.tle").read_text().splitlines()[-2:]
    (mean,) = pz.read_ephemeris(tmp_path / "a.omm").mean
    lines = [line.split(" = ") for line in (tmp_path / "a.omm").read_text().splitlines() if " = " in line]
    by_omm = Satrec()
    omm.initialize(by_omm, {"EPHEMERIS_TYPE": 0, **{key: value.split(" [")[0] for key, value in lines}})
    by_lines = Satrec.twoline2rv(one, two)
    (arc,) = pz.read_ephemeris(cpf).arcs
    for k in (0, 150, 287):
        when = arc.epoch + float(arc.t[k])
        there = earth.transform(arc.position[k], None, "ITRF", "TEME", when)[0]
        for elements in (by_lines, by_omm):
            failed, r, _ = elements.sgp4(*when.jd("UTC"))
            assert not failed and np.linalg.norm(1e3 * np.array(r) - there) < 3e3, mean.name


@pytest.mark.parametrize("name", ["ilrs/lageos2_201802.npt.v2C", "ccsds/odm/oem/OEMExample5.txt", "tdm/TDMExample15.xml"])
def test_every_format_is_shown(call, data_dir, name):
    assert call("tracking", data_dir / name).status == 0
    json.dumps(call("tracking", data_dir / name, "--json").document)


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["--to", "a.xyz"], "must end in .tdm, .csv, .oem, .opm, .ocm, .omm, .tle"),
        (["-o", "a.txt"], "must end in .png, .pdf, .svg"),
        (["--to", "no/such/folder/a.csv"], "there is no folder"),
        (["--to", "a.oem"], "the file holds measurements, no orbit"),
        (["--range", "twoway"], "did you mean 'two-way'"),
        (["--interval", "long"], "--interval is 'long'; write a length of time"),
        (["--sigma", "range=1s"], "sigma 'range=1s'"),
        (["--time", "SAT=GPS"], "TIME_SYSTEM is UTC, and GPS was said for SAT"),
        (["--with", "ekf"], "--with"),
    ],
)
def test_bad_options_are_refused_in_one_line(call, tdm, tmp_path, monkeypatch, arguments, says):
    monkeypatch.chdir(tmp_path)
    assert says in call("tracking", tdm, *arguments).refused()
    assert os.listdir(tmp_path) == []


def test_a_file_is_not_written_over_itself(call, tdm, tmp_path):
    path = tmp_path / "a.tdm"
    path.write_bytes(tdm.read_bytes())
    assert "are the same file" in call("tracking", path, "--to", path).refused()
    assert path.read_bytes() == tdm.read_bytes()


def test_broken_files_are_refused_in_one_line(call, data_dir):
    for path in sorted((data_dir / "tdm").iterdir()):
        result = call("tracking", path)
        if path.name.startswith(("TDMExample", "TDM-Custom")):
            assert result.status == 0, path
        else:
            line = result.refused()
            assert f"{path}: line " in line or path.name == "NOTES.txt"
    assert "No such file" in call("tracking", data_dir / "none.tdm").refused()
