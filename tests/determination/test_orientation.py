"""The Earth of the stations is oriented as that of the forces."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from piazzi import earth
from piazzi.determination.case import Case
from piazzi.determination.determining import read
from piazzi.determination.orbit import Orbit
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


def fixes_of(tmp_path, forces):
    """A fix 7000 km along x of the ITRF, as the problem has it; and its date."""
    (tmp_path / "fixes.csv").write_text("time[UTC],x[m],y[m],z[m]\n2016-02-13T16:00:00,7000000,0,0\n")
    case = Case(forces=forces, about="earth", answers={"frame": "ITRF", "sigma": ["1m"]})
    seen = read([tmp_path / "fixes.csv"], case)[0]
    return seen.tracking.values[0], seen.epoch + float(seen.tracking.times[0])


@pytest.mark.parametrize(
    ("forces", "eop"),
    [
        (earth.ForceChoice(earth.Forces(degree=2), "given", eop=EOP), EOP),
        ("default", earth.SubdailyEOP()),
        ("gravity=EGM2008 degree=4", earth.SubdailyEOP()),
        (earth.Forces(degree=2), earth.SubdailyEOP()),
        ("default eop=daily", None),
    ],
)
def test_positions_that_turn_with_the_earth_are_turned_as_the_forces_say(tmp_path, forces, eop):
    fix, date = fixes_of(tmp_path, forces)
    assert_allclose(fix, earth.rotation("ITRF", "GCRF", date, eop) @ [7e6, 0.0, 0.0], rtol=0, atol=1e-6)


def test_an_orbit_is_told_in_the_axes_that_fixes_are_turned_from(tmp_path):
    fix, date = fixes_of(tmp_path, "default")
    belief = np.concatenate([fix, [0.0, 7500.0, 0.0]])[None], np.eye(6)[None]
    orbit = Orbit(date, "GCRF", lambda epochs: belief)
    assert_allclose(orbit.to("ITRF").at()[:3], [7e6, 0.0, 0.0], rtol=0, atol=1e-6)
