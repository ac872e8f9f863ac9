"""Laser spheres: by every name that files use, and figures that belong together."""

import math
from collections import Counter

import pytest

from piazzi import earth


@pytest.mark.parametrize("identity", ["LAGEOS-2", "lageos2", "Lageos 2", "1992-070B", "9207002", 22195])
def test_every_name_of_one(identity):
    sphere = earth.laser_sphere(identity)
    assert (sphere.name, sphere.centre_of_mass, sphere.sic) == ("LAGEOS-2", 0.251, 5986)


def test_the_names_that_files_of_the_data_have(data_dir):
    header = (data_dir / "earth/lageos2/lageos2_20160214.npt").read_text().upper().splitlines()
    satellite = next(line.split() for line in header if line.startswith("H3"))  # name, ILRS number, SIC, NORAD
    sphere = earth.laser_sphere(satellite[1])
    assert [sphere.ilrs, f"{sphere.sic:04d}", str(sphere.norad)] == satellite[2:5]


def test_names_and_numbers_are_of_one_satellite_each():
    for names in zip(*((s.name, s.cospar, s.norad, s.sic, s.ilrs) for s in earth.LASER_SPHERES), strict=True):
        assert max(Counter(names).values()) == 1


def test_figures_belong_together():
    for sphere in earth.LASER_SPHERES:
        assert 0.4 * sphere.diameter / 2 < sphere.centre_of_mass < sphere.diameter / 2
        assert sphere.area == pytest.approx(math.pi / 4 * sphere.diameter**2)
        density = sphere.mass / (math.pi / 6 * sphere.diameter**3)
        assert 100.0 < density < 20000.0  # Ajisai is hollow, LARES is tungsten
    assert earth.laser_sphere("LAGEOS-2").area_to_mass == pytest.approx(6.97e-4, rel=1e-3)  # as the literature has it


def test_an_unknown_one_is_met_with_the_nearest():
    with pytest.raises(KeyError, match="did you mean 'Starlette'"):
        earth.laser_sphere("starlete")
    with pytest.raises(KeyError, match="there are LAGEOS-1"):
        earth.laser_sphere("XQZ")
