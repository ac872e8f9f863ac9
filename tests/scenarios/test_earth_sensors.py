"""Sensors of satellites in a scenario: kinds, sites of stations, and files that give them back."""

import numpy as np
import pytest

import piazzi as pz
from piazzi import earth
from piazzi.model.values import with_values
from piazzi.problem.truth import true_problem
from piazzi.scenarios import check, load_scenario
from piazzi.scenarios.write import problem_from_tables, problem_to_tables
from tests.references.drawn import same_problem

TEXT = """
epoch = "2016-02-13T16:00:00 UTC"
units = "km, deg"
[earth]
degree = 2
[sensors.look]
kind = "azimuth_elevation"
refraction = "radio"
visible = ["above"]
numbers = { mask = "10 deg" }
[sensors.sky]
kind = "right_ascension_declination"
angles = "astrometric"
[[stations]]
name = "a"
sensor = "look"
site = { latitude = 54.4, longitude = -0.7, height = 260.0, mask = 5.0 }
weather = { pressure = 97000.0, temperature = 280.0, humidity = 0.3 }
noise = { sigma = [0.01, 0.02] }
every = 20.0
[[stations]]
name = "b"
sensor = "look"
site = "7840"
tides = false
noise = { sigma = [0.01, 0.02] }
[[stations]]
name = "c"
sensor = "sky"
site = "7840"
noise = { sigma = 0.001 }
[prior]
mean = [7000.0, 0, 0, 0, 5.3, 5.3]
sigma = [1, 1, 1, 0.001, 0.001, 0.001]
[times]
step = 10.0
count = 11
"""


def written(tmp_path, text=TEXT):
    path = tmp_path / "mine.toml"
    path.write_text(text.replace("noise = { sigma = 0.001 }", "noise = { sigma = [0.001, 0.001] }"))
    return path


def test_a_kind_makes_the_sensor_and_a_site_its_numbers(tmp_path):
    problem = load_scenario(written(tmp_path)).problem
    a, b, c = problem.stations
    place = earth.Station.geodetic("a", *np.radians([54.4, -0.7]), 260.0)
    np.testing.assert_allclose(
        [a.numbers[n] for n in ("latitude", "longitude", "height", "mask", "pressure", "vapour")],
        [*place.place(problem.epoch), np.radians(5.0), 97000.0, earth.Weather(97000.0, 280.0, 0.3).vapour],
    )
    assert b.numbers["mask"] == np.radians(10.0) and not b.place.tides and b.place.station.name == "7840"
    assert a.schedule == pz.Schedule(every=20.0)
    assert np.sqrt(np.diag(a.noise)) == pytest.approx(np.radians([0.01, 0.02]))
    assert dict(problem.model.sensor("look").on_sky) == {"azimuth": "elevation"}
    assert "earth_velocity" in problem.functions and c.place is not None


def test_tables_give_the_problem_back_with_its_places(tmp_path):
    problem = load_scenario(written(tmp_path)).problem
    again = problem_from_tables(problem_to_tables(problem), problem.name, "here")
    assert same_problem(again, problem)
    assert again.model is problem.model and again.checksums == problem.checksums


def test_a_station_may_really_stand_elsewhere(tmp_path):
    moved = "[truth.stations.a]\nmoved = { up = 3.0, north = '-4 m', east = 0.012 }\nmask = 8.0\n"
    problem = load_scenario(written(tmp_path, TEXT + moved)).problem
    world = true_problem(problem)
    believed, there = (p.stations[0].place.station.position(problem.epoch) for p in (problem, world))
    up, north, east = earth.stations.up_north_east(believed)
    np.testing.assert_allclose(there - believed, 3.0 * up - 4.0 * north + 0.012 * east, atol=1e-8)
    assert world.stations[0].numbers["mask"] == np.radians(8.0)
    assert world.stations[1].place is problem.stations[1].place
    again = problem_from_tables(problem_to_tables(problem), problem.name, "here")
    assert true_problem(again).checksums == world.checksums != problem.checksums


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('kind = "azimuth_elevation"', 'kind = "azimuth"', "kind"),
        ('refraction = "radio"', 'refracted = "radio"', "is no option of azimuth_elevation; did you mean 'refraction'"),
        ('refraction = "radio"', 'refraction = "laser"', "refraction is 'laser'"),
        ('angles = "astrometric"', "", "angles"),
        ('site = "7840"\ntides', 'site = "7804X"\ntides', "no site of the ILRS"),
        ("latitude = 54.4, ", "", "latitude missing"),
        ("mask = 5.0 }", "mast = 5.0 }", "unknown key 'mast'"),
        ("humidity = 0.3", "humidity = 30.0", "percent"),
        ("[times]", "[truth.stations.a]\nmoved = { down = 3.0 }\n[times]", "truth.stations.a.moved.down"),
        ("[times]", "[truth.stations.a]\nmoved = { up = '3 kg' }\n[times]", "truth.stations.a.moved.up"),
        ("[times]", "[truth.stations.d]\nmoved = { up = 3.0 }\n[times]", "truth.stations.d: is no station"),
        ('numbers = { mask = "10 deg" }', 'numbers = { mast = "10 deg" }', "names 'mast', which no equation uses"),
        ("[earth]\ndegree = 2", "[earth]\ndegree = 2\nbodies = []\ntides = []", ""),
    ],
)
def test_what_is_wrong_is_said_with_its_place(tmp_path, old, new, said):
    assert old in TEXT
    faults = [str(fault) for fault in check(written(tmp_path, TEXT.replace(old, new)))]
    assert any(said in fault for fault in faults) if said else not faults


@pytest.mark.parametrize(("height", "said"), [("-100 km", "inside the Earth; is that meant"), ("500 km", "above any mountain")])
def test_unlikely_places_are_asked_about_and_not_refused(tmp_path, height, said):
    site = f'site = {{ latitude = 10.0, longitude = 20.0, height = "{height}" }}'
    with pytest.warns(earth.StationWarning, match=said):
        load_scenario(written(tmp_path, TEXT.replace('site = "7840"', site, 1)))


def test_a_check_at_the_door_takes_the_state_nearby_to_second_order():
    sensor = pz.Sensor("late", {"there": "there"}, definitions={"there, speed": "at(-2, order=2)"})
    model = pz.Model(["x", "v"], {"x": "v", "v": "-9.81"}, sensor)
    values = with_values({"x": 100.0, "v": 5.0, "t": 0.0}, sensor.definitions, model=model)
    assert (values["there"], values["speed"]) == pytest.approx((100.0 - 10.0 - 9.81 * 2.0, 5.0 + 2 * 9.81))
