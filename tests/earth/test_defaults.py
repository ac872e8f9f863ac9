"""Forces by height, as text and as files: what is chosen, and what is refused."""

import numpy as np
import pytest

from piazzi import earth
from piazzi.earth.defaults import default_forces, lowest_height, read_forces

GM = 3.98600435507e14


@pytest.mark.parametrize(
    ("height", "degree", "drag"),
    [(400e3, 70, True), (800e3, 70, True), (1400e3, 70, False), (5.7e6, 20, False), (2.02e7, 12, False), (3.6e7, 8, False)],
)
def test_forces_by_height(height, degree, drag):
    """The degree falls with height, and what is cut off there is below 1e-5 of the central term, or the degree the highest."""
    found = default_forces(height)
    assert found.forces.degree == degree
    assert degree == 70 or (6378136.6 / (6378136.6 + height)) ** degree < 1e-5
    assert bool(found.forces.drag) == drag
    assert set(found.values) == set(found.forces.parameters)
    assert found.assumed == ("cr_a_m = 0.013 m2/kg", *(["cd_a_m = 0.022 m2/kg"] if drag else []))
    assert f"default at {height / 1e3:,.0f} km" in str(found)


def test_the_height_is_that_of_the_pericentre():
    a, e = 8.0e6, 0.1
    r = np.array([a * (1 + e), 0.0, 0.0])
    v = np.array([0.0, np.sqrt(GM / a * (1 - e) / (1 + e)), 0.0])
    assert lowest_height(r, v) == pytest.approx(a * (1 - e) - 6378136.6, abs=1e-6)


def test_words():
    found = read_forces(
        "gravity=EGM2008 degree=40 bodies=sun,moon,venus tides=none relativity=no air_height=550km "
        "drag=exponential cd_a_m=0.02",
        5e5,
    )
    assert found.forces == earth.Forces(
        "EGM2008", 40, bodies=("sun", "moon", "venus"), tides=(), relativity=False, drag="exponential", air_height=550e3
    )
    assert found.values["cd_a_m"] == 0.02
    assert not found.assumed
    assert read_forces("default degree=10", 5e5).forces.drag
    assert not read_forces("degree=10", 5e5).forces.drag
    two = read_forces("none", 5e5).forces
    assert (two.degree, two.bodies, two.tides, two.relativity) == (0, (), (), False)


def test_a_file(tmp_path, data_dir):
    path = tmp_path / "mine.toml"
    kernel = data_dir / "earth" / "gravity" / "GGM05S.gfc"
    (tmp_path / "field.gfc").write_bytes(kernel.read_bytes())
    path.write_text(
        "[earth]\ngravity = 'field.gfc'\ndegree = 12\nradiation = 'cannonball'\neop = { ut1_utc = 0.1 }\n"
        "[parameters]\ncr_a_m = '0.02 m^2/kg'\nother = 3\n"
    )
    found = read_forces(str(path), 5e5)
    assert found.forces.field.name == earth.read_gravity(kernel).name
    assert found.values["cr_a_m"] == 0.02
    assert found.eop == earth.EOP(ut1_utc=0.1)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("defualt", "forces 'defualt': write default, none, a file"),
        ("gravity=EGM2008 degre=40", "forces: degre is not known; did you mean 'degree'"),
        ("degree=4 degree=5", "degree is given twice"),
        ("degree=forty bodies=sun", "degree is 'forty'; it must be a number"),
        ("degree=4 bodies=son", "bodies has 'son'.*did you mean 'sun'"),
        ("degree=4 drag", "'drag' is not NAME=VALUE"),
        ("degree=4 cd_a_m=0.02", "cd_a_m is not known"),
        ("degree=4 kernel=nowhere.bsp", "No such file|nowhere.bsp"),
    ],
)
def test_words_that_mean_nothing_are_refused(text, message):
    with pytest.raises((ValueError, OSError), match=message):
        read_forces(text, 5e5)


def test_files_without_forces_are_refused(tmp_path):
    path = tmp_path / "mine.toml"
    for content, message in (
        ("x = ", "no TOML"),
        ("[eart]\n", r"there is no table \[earth\]"),
        ("[earth]\ndegree = 500\n", "degree 500 is asked for of EGM2008"),
        ("[earth]\ncr_a_m = 1\nradiation = 'cannonball'\n", r"cr_a_m is not known: it belongs to \[parameters\]"),
        ("[earth]\neop = { ut1 = 1 }\n", "'ut1' is not known; did you mean 'ut1_utc'"),
        ("[earth]\nair_height = true\n", "air_height is True; it must be a number"),
    ):
        path.write_text(content)
        with pytest.raises(ValueError, match=f"mine.toml: .*{message}"):
            read_forces(str(path), 5e5)


def test_orbits_below_the_surface_are_refused():
    with pytest.raises(ValueError, match="it is below the surface"):
        default_forces(-1e3)
