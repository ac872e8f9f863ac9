"""`piazzi difference`: a table, JSON, a picture; bad input in one line."""

import pytest


@pytest.fixture
def gps(data_dir):
    return data_dir / "earth" / "sp3" / "gps_g01_g05_20150505.sp3"


def test_a_table_with_the_axes_and_how_rows_were_joined(call, gps):
    result = call("difference", gps, gps, "--object", "G01", "--step", "777")
    assert result.status == 0 and not result.said
    for words in ("minus", "[m]", "[sigma]", "R ", "T ", "N ", "3d", "Lagrange's polynomial of degree", "99.73 %"):
        assert words in result.out


def test_json_is_the_contract_and_nothing_else(call, gps, tmp_path):
    span = "2015-05-05T01:00:00 UTC .. 2015-05-05T03:00:00 UTC"
    result = call(
        "difference", gps, gps, "--object", "G05", "--json", "--axes", "TNW", "--span", span, "-o", tmp_path / "d.png"
    )
    found = result.document
    assert (found["schema"], found["axes"]) == ("piazzi.difference/1", "TNW")
    assert (found["first"], found["last"], found["count"]) == ("2015-05-05T01:04:44 UTC", "2015-05-05T02:59:44 UTC", 24)
    assert found["rms"] == {"T": 0.0, "N": 0.0, "W": 0.0, "3d": 0.0}
    assert (tmp_path / "d.png").read_bytes()[:4] == b"\x89PNG"


def test_names_of_files_cannot_reach_the_terminal_as_orders(call, gps, tmp_path):
    evil = tmp_path / "a\x1b[31m.sp3"
    evil.write_bytes(gps.read_bytes())
    result = call("difference", evil, gps, "--object", "G01", "--step", "777")
    assert result.status == 0
    assert "\x1b" not in result.out


@pytest.mark.parametrize(
    ("more", "message"),
    [
        ([], "holds G01, G05; say which object"),
        (["--object", "G02"], "holds G01, G05; not G02"),
        (["--object", "G01", "--axes", "LVLH"], "axes 'LVLH' are not known"),
        (["--object", "G01", "--span", "yesterday"], "must be two dates with .. between them"),
        (["--object", "G01", "--span", "2015-05-05T01:00:00 .. "], "time scale"),
        (["--object", "G01", "-o", "d.txt"], "the file must end in .png, .pdf, .svg"),
    ],
)
def test_bad_input_is_one_line(call, gps, more, message):
    assert message in call("difference", gps, gps, *more).refused()


def test_a_file_of_measurements_is_no_orbit(call, data_dir, gps):
    assert (
        "holds measurements, no orbit" in call("difference", gps, data_dir / "tdm/TDMExample8.txt", "--object", "G01").refused()
    )


@pytest.mark.slow  # the kernels of a scenario's truth
def test_the_truth_of_a_scenario_is_an_orbit(call, tmp_path):
    """It is within the sigma of the propagated prior, and a recording of the same run is the same orbit."""
    predicted = tmp_path / "predicted.oem"
    assert call("propagate", "sun-sync-day", "-o", predicted).status == 0
    found = call("difference", "sun-sync-day", predicted, "--seed", "3", "--json").document
    assert found["count"] == 289
    assert 0.01 < found["in_sigma"]["rms"]["T"] < 4.0
    assert call("difference", predicted, "sun-sync-day", "--seed", "3", "--json").document["rms"]["3d"] == pytest.approx(
        found["rms"]["3d"], rel=1e-3
    )
    assert call("simulate", "sun-sync-day", "--seed", "3", "-o", tmp_path / "run.nc").status == 0
    same = call("difference", "sun-sync-day", tmp_path / "run.nc", "--seed", "3", "--json").document
    assert same["rms"]["3d"] == 0.0


def test_a_scenario_in_the_plane_is_no_orbit_about_the_earth(call, gps):
    assert "b612-range is no orbit about the Earth" in call("difference", gps, "b612-range", "--object", "G01").refused()
