"""Cases that come with the package: each has its tracking, and is what its first line says."""

import numpy as np
import pytest
import xarray

import piazzi as pz
from piazzi.determination.case_file import CASES, names, split
from piazzi.determination.plotting import PICTURES


def test_every_case_has_its_tracking_and_says_how_it_is_run():
    assert names() == ["ceres-1801", "lageos-2"]
    for name in names():
        files, case = split([name])
        assert len(files) == 1 and len(pz.read_tracking(files[0], sigma=case.answers.get("sigma"))) > 30
        assert f"`piazzi determine {name}` runs it." in (CASES / f"{name}.toml").read_text(encoding="utf-8")


@pytest.mark.parametrize(("typed", "meant"), [("ceres", "ceres-1801"), ("lageos2", "lageos-2"), ("LAGEOS-2", "lageos-2")])
def test_the_name_of_a_case_that_is_nearly_right_is_told_the_right_one(typed, meant):
    with pytest.raises(FileNotFoundError, match=f"did you mean '{meant}'"):
        split([typed])
    assert split(["pass.tdm"])[0] == ["pass.tdm"]  # which may not be there: whoever reads it says so


@pytest.mark.slow
def test_lasers_determine_lageos_2(tmp_path):
    """Half a metre from the state that another laboratory published for 16:00 on 13 February (EME2000, here to 0.7 m)."""
    found = pz.determine("lageos-2")
    assert found.determined and found.keep.all() and len(found.keep) == 95
    assert found.weighted_rms < 1.0
    state = found.orbit.to("EME2000").at(pz.Epoch("2016-02-13T16:00:00 UTC"))
    assert np.linalg.norm(state[:3] - [7526994.072, -9646309.832, 1464110.239]) < 0.7
    drawn = {what: found.plot(what=what) for what in PICTURES}
    assert drawn["residuals"].get_ylabel() == "O-C of range [m]"
    assert sum(len(line.get_xdata()) for line in drawn["residuals"].lines[:-1]) == 95
    assert drawn["sky"].name == "polar" and drawn["ground-track"].get_xlim() == (-180, 180)
    with pytest.raises(ValueError, match="unknown picture 'globe'; known: residuals, sigma"):
        found.plot(what="globe")
    with pytest.raises(ValueError, match="unknown kind 'rang'; did you mean 'range'"):
        found.plot(which="rang")
    with pytest.raises(ValueError, match="unknown station '7091'"):
        found.plot(what="sky", which="7091")
    found.write(tmp_path / "found.nc")
    with xarray.open_dataset(tmp_path / "found.nc") as data:
        assert not [name for name in data.variables if hasattr(xarray.Dataset, name)]
        np.testing.assert_array_equal(data["state_mean"], found.to_dict()["mean"])
