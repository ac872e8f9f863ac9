"""The Earth of the stations is oriented as that of the forces."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from piazzi import earth
from piazzi.determination.case import Case
from piazzi.determination.determining import read
from piazzi.determination.recorded import recorded
from piazzi.scenarios import Recording

SITE = earth.Station.geodetic("A", np.radians(50.0), np.radians(9.0), 100.0)
EOP = earth.EOP(ut1_utc=0.4, xp=0.3, yp=-0.2, dx=0.0, dy=0.0)  # 0.2 s off the tables, 60 m on the ground
ROWS = "time[UTC],station,range[km]\n" + "".join(f"2016-02-13T16:0{k}:00,A,{1000 + k}\n" for k in range(8))
SCENARIO = """
earth = { degree = 2, bodies = [], tides = [], relativity = false, eop = { ut1_utc = 0.4, xp = 0.3, yp = -0.2 } }
recording = { sigma = ["1m"] }
prior = { mean = [7e6, 0, 0, 0, 7500, 0], sigma = [1e3, 1e3, 1e3, 1, 1, 1] }
"""


@pytest.fixture
def rows(tmp_path):
    (tmp_path / "rows.csv").write_text(ROWS)
    return tmp_path / "rows.csv"


def check(station, epoch):
    """Where a station of a problem is at its time zero; tides within the metre."""
    there = earth.rotation("ITRF", "GCRF", epoch, EOP) @ np.asarray(SITE.position(epoch))
    usual = earth.rotation("ITRF", "GCRF", epoch) @ np.asarray(SITE.position(epoch))
    assert np.linalg.norm(there - usual) > 30.0
    station.place.block(0.0, 60.0)
    assert_allclose(station.place.value(0.0)[:3], there, rtol=0, atol=1.0)


def test_in_a_determination(rows):
    forces = earth.ForceChoice(earth.Forces(degree=2), "given", eop=EOP)
    case = Case(stations=[SITE], forces=forces, about="earth", answers={"range": "one-way", "sigma": ["1m"]})
    seen = read([rows], case)[0]
    check(seen.stations[0], seen.epoch)


def test_in_a_scenario_with_a_recording(rows, tmp_path):
    (tmp_path / "s.toml").write_text(SCENARIO)
    said = Recording(stations=(SITE,), answers={"range": "one-way"})
    problem, tracking = recorded(rows, tmp_path / "s.toml", said)
    check(problem.stations[0], tracking.epoch)
