"""Media: published values, physics written out in the test, and every formula as text that a model takes."""

import math
import pickle

import numpy as np
import pytest
from numpy.testing import assert_allclose

import piazzi as pz
from piazzi.earth import Epoch, media
from piazzi.expressions.parse import parse

FORMULAS = {name: value for name, value in vars(media).items() if isinstance(value, media.Formula)}


def d(degrees):
    return np.radians(degrees)


def test_gmf_gives_the_published_values():
    """Header of GMF, IERS Conventions 2010, chapter 9 (Green Bank)."""
    place = media.gmf_coefficients(0.6708665767, -1.393397187, Epoch.from_jd(2400000.5, 55055.0, "TT"))
    both = media.mapping(math.pi / 2 - 1.278564131, 844.715, **place)
    assert_allclose(both, (3.425245519339138678, 3.449589116182419257), rtol=1e-14)


def test_niell_gives_the_published_values():
    """Mercier and Perosanz, GNSS measurements (CNES): Le Mans, 48 N, 68 m, at 5 degrees, 1994-01-01: 10.16 and 10.75."""
    both = media.mapping(d(5.0), 68.0, **media.niell_coefficients(d(48.0), Epoch("1994-01-01 UTC")))
    assert_allclose(both, (10.16, 10.75), rtol=0, atol=5e-3)


def test_niell_between_and_beyond_its_latitudes():
    day = Epoch("2005-05-13 UTC")
    at = [media.niell_coefficients(d(x), day)["aw"] for x in (0.0, 10.0, 15.0, 22.5, 30.0, 75.0, 90.0, -22.5)]
    assert at[0] == at[1] == at[2] and at[5] == at[6] and at[3] == at[7] == pytest.approx((at[2] + at[4]) / 2, rel=1e-15)
    north = media.niell_coefficients(d(45.0), Epoch("2001-01-28 UTC"))["ah"]
    south = media.niell_coefficients(d(-45.0), Epoch("2001-07-29T15:00:00 UTC"))["ah"]
    assert north == pytest.approx(south, abs=1e-9)  # half a year apart
    assert north == pytest.approx(1.2465397e-3 - 2.6523662e-5, abs=1e-8)


@pytest.mark.parametrize("name", ["niell", "gmf"])
def test_mapping_is_one_at_the_zenith_and_the_cosecant_above_a_flat_earth(name):
    day = Epoch("2016-02-13 UTC")
    coefficients = media.niell_coefficients(0.7, day) if name == "niell" else media.gmf_coefficients(0.7, 0.2, day)
    for values in media.mapping(math.pi / 2, 1234.0, **coefficients):
        assert values == pytest.approx(1.0, abs=1e-14)
    elevation = d(np.linspace(30.0, 90.0, 20))
    for values in media.mapping(elevation, 0.0, **coefficients):
        assert_allclose(values, 1 / np.sin(elevation), rtol=5e-3)


def test_saastamoinen_is_the_weight_of_the_air():
    """Hydrostatic: 1e-6 k1 R P/(M g) with k1 = 77.604e-2 K/Pa, and g of the centre of the column (Davis et al. 1985)."""
    for latitude, height in ((0.0, 0.0), (0.8, 500.0), (-1.2, 3000.0)):
        gravity = 9.8062 * (1 - 0.00265 * math.cos(2 * latitude) - 0.00031e-3 * (0.9 * height + 7300.0))
        by_hand = 1e-6 * 0.77604 * 8.31434 / 0.0289644 * 85000.0 / gravity
        hydrostatic, wet = media.saastamoinen(latitude, height, 85000.0, 283.0, 800.0)
        assert hydrostatic == pytest.approx(by_hand, rel=3e-4)
        assert wet == pytest.approx(0.002277 * (1255 / 283.0 + 0.05) * 8.0, rel=1e-14)


MCDONALD = {"latitude": d(30.67166667), "pressure": 79841.88, "temperature": 300.15, "vapour": 1432.2, "wavelength": 0.532e-6}


def outputs(formula, *names):
    return media.Formula(formula.arguments, formula.definitions, names, formula.source)


def test_mendes_pavlis_gives_the_published_values():
    """Headers of FCUL_A and FCUL_ZD_HPA, IERS Conventions 2010.  The second gives 4 micrometres less than its own code does."""
    mapped = outputs(media.mendes_pavlis, "fcul")(elevation=d(15.0), height=2075.0, **MCDONALD)
    assert mapped == pytest.approx(3.800243667312344087, rel=1e-14)
    hydrostatic, wet = outputs(media.mendes_pavlis, "hydrostatic", "wet")(elevation=d(90.0), height=2010.344, **MCDONALD)
    assert hydrostatic == pytest.approx(1.932992176591644462, abs=4e-6)
    assert wet == pytest.approx(0.2233748255158703871e-2, abs=5e-9)


def test_marini_murray_gives_published_values():
    vapour = media.Weather(101325.0, 293.15, 0.5).vapour
    site = {"latitude": d(45.0), "height": 100.0, "pressure": 101325.0, "temperature": 293.15, "vapour": vapour}
    # the paper: 1 for ruby, 0.97966 for infrared lasers
    colour = outputs(media.marini_murray, "colour")
    assert colour(elevation=1.0, wavelength=694.3e-9, **site) == pytest.approx(1.0, abs=5e-6)
    assert colour(elevation=1.0, wavelength=1064e-9, **site) == pytest.approx(0.97966, abs=5e-6)
    # another program, Orekit, at 10 degrees and at the zenith
    both = media.marini_murray(elevation=d(np.array([10.0, 90.0])), wavelength=694.3e-9, **site)
    assert_allclose(both, (13.2611, 2.3883 + 0.001656), rtol=0, atol=1e-4)


def test_the_two_of_lasers_agree():
    vapour = media.Weather(101325.0, 293.15, 0.5).vapour
    for wavelength in (423e-9, 532e-9, 694.3e-9, 1064e-9):
        elevation = d(np.linspace(15.0, 90.0, 30))
        site = (elevation, d(45.0), 100.0, 101325.0, 293.15, vapour, wavelength)
        assert_allclose(media.mendes_pavlis(*site), media.marini_murray(*site), rtol=1.2e-3)


def test_vapour_and_standard_weather():
    # saturation over water: 611.2, 2338.8 and 4246 Pa at 0, 20 and 30 degrees; air at 1013 hPa adds 0.4 %
    for celsius, saturated in ((0.0, 611.2), (20.0, 2338.8), (30.0, 4246.0)):
        weather = media.Weather(101325.0, celsius + 273.15, 1.0)
        assert weather.vapour == pytest.approx(saturated * 1.0042, rel=1e-3)
    for height, pressure, temperature in ((0.0, 101325.0, 288.15), (1000.0, 89874.6, 281.65), (5000.0, 54019.9, 255.65)):
        weather = media.Weather.standard(height)  # the tables of 1976
        assert (weather.pressure, weather.temperature) == (pytest.approx(pressure, rel=2e-5), pytest.approx(temperature))
    assert media.Weather.standard(0.0).humidity == 0.5


@pytest.mark.parametrize(
    ("values", "hint"),
    [
        ((1013.25, 288.0, 0.5), "hPa or mbar times 100"),
        ((101325.0, 15.0, 0.5), "Celsius"),
        ((101325.0, 288.0, 60.0), "percent"),
    ],
)
def test_weather_in_other_units_is_refused(values, hint):
    with pytest.raises(ValueError, match=hint):
        media.Weather(*values)


KLOBUCHAR = dict(zip(
    ("alpha0", "alpha1", "alpha2", "alpha3", "beta0", "beta1", "beta2", "beta3"),
    (0.3820e-7, 0.1490e-7, -0.1790e-6, 0.0, 0.1430e6, 0.0, -0.3280e6, 0.1130e6), strict=True,
))  # fmt: skip


def test_klobuchar_gives_the_published_value():
    """Klobuchar 1996 in Parkinson and Spilker: 40 N, 100 W, elevation 20, azimuth 210, 20:45 UT: 77.6 ns and 23.784 m."""
    place = {"elevation": d(20.0), "azimuth": d(210.0), "latitude": d(40.0), "longitude": d(-100.0)}
    delay = media.klobuchar(**place, gps_seconds=74700.0, frequency=1575.42e6, **KLOBUCHAR)
    assert delay == pytest.approx(23.784, abs=5e-4)
    week = media.klobuchar(**place, gps_seconds=74700.0 + 3 * 86400.0, frequency=1575.42e6, **KLOBUCHAR)
    assert week == pytest.approx(delay, rel=1e-12)
    other = media.klobuchar(**place, gps_seconds=74700.0, frequency=1227.60e6, **KLOBUCHAR)
    assert other / delay == pytest.approx((77 / 60) ** 2, rel=1e-14)
    night = media.klobuchar(**place, gps_seconds=30000.0, frequency=1575.42e6, **KLOBUCHAR)
    assert night == pytest.approx(299792458 * 5e-9 * (1 + 16 * (0.53 - 20 / 180) ** 3), rel=1e-14)


def test_single_layer():
    charge, vacuum, mass = 1.602176634e-19, 8.8541878128e-12, 9.1093837015e-31
    strength = charge**2 / (8 * math.pi**2 * vacuum * mass)
    zenith = media.single_layer(math.pi / 2, 5e17, 1.57542e9, 450e3)
    assert zenith == pytest.approx(strength * 5e17 / 1.57542e9**2, rel=1e-5)
    # the layer is crossed at the angle that the triangle Earth's centre, station, point has
    elevation, R, H = 0.3, 6371e3, 450e3
    along = -R * math.sin(elevation) + math.sqrt((R * math.sin(elevation)) ** 2 + 2 * R * H + H * H)
    place = np.array([0.0, R]) + along * np.array([math.cos(elevation), math.sin(elevation)])
    slant = (place / np.linalg.norm(place)) @ np.array([math.cos(elevation), math.sin(elevation)])
    assert media.single_layer(elevation, 5e17, 1.57542e9, H) == pytest.approx(zenith / slant, rel=1e-12)
    assert media.ionosphere_sign("code") == 1.0 == -media.ionosphere_sign("phase") == -media.ionosphere_sign("doppler")
    with pytest.raises(ValueError, match="did you mean 'phase'"):
        media.ionosphere_sign("phases")


def test_optical_refraction_gives_the_published_value():
    """Meeus, Astronomical Algorithms, example 16.a: true altitude 33.246 minutes, refraction 24.618 minutes."""
    minutes = 60 * np.degrees(media.optical_refraction(d(33.246 / 60), 101000.0, 283.0)) - 0.0019279
    assert minutes == pytest.approx(24.618, abs=2e-3)
    assert media.optical_refraction(math.pi / 2, 101000.0, 283.0) == pytest.approx(0.0, abs=1e-8)


def test_optical_refraction_agrees_with_the_standards_of_astronomy():
    import erfa

    for celsius, hpa in ((-10.0, 1030.0), (10.0, 1010.0), (25.0, 700.0)):
        a, b = erfa.refco(hpa, celsius, 0.0, 0.6)
        apparent = d(np.linspace(20.0, 90.0, 50))
        zenith = math.pi / 2 - apparent
        bent = a * np.tan(zenith) + b * np.tan(zenith) ** 3
        assert_allclose(media.optical_refraction(apparent - bent, 100 * hpa, celsius + 273.15), bent, rtol=0, atol=d(0.15 / 60))


def bending(elevation: float, n0: float = 315e-6, scale: float = 7350.0, radius: float = 6371000.0) -> float:
    """Bending of a ray with apparent elevation, by Snell's law in spherical shells of exp(-h/scale)."""
    h = np.concatenate([np.linspace(0, 2000, 40001) ** 1, np.linspace(2000, 120000, 40001)[1:]])
    n = 1 + n0 * np.exp(-h / scale)
    sine = (1 + n0) * radius * math.cos(elevation) / (n * (radius + h))
    slope = n0 / scale * np.exp(-h / scale) / n * sine / np.sqrt(np.maximum(1 - sine**2, 1e-14))
    return float(np.sum((slope[1:] + slope[:-1]) / 2 * np.diff(h)))


def test_radio_refraction_is_that_of_rays_through_the_reference_atmosphere():
    for apparent in (0.5, 1.0, 2.0, 3.0, 5.0, 8.0, 10.0, 12.0, 15.0, 30.0, 60.0, 85.0):
        bent = bending(d(apparent))
        assert media.radio_refraction(d(apparent) - bent, 0.0, 315.0) == pytest.approx(bent, rel=0.075), apparent
    twice = media.radio_refraction(d(20.0), 500.0, 600.0)
    assert twice == pytest.approx(2 * media.radio_refraction(d(20.0), 500.0, 300.0), rel=1e-14)


def test_refractivity_of_the_reference_atmosphere():
    wet = media.vapour_pressure(101325.0, 288.15, 0.6)
    assert media.refractivity(101325.0, 288.15, wet) == pytest.approx(315.0, rel=0.02)
    assert media.refractivity(101325.0, 288.15, 0.0) == pytest.approx(77.6 * 1013.25 / 288.15, rel=1e-14)


@pytest.mark.parametrize("name", FORMULAS)
def test_every_formula_is_text_that_a_model_takes(name):
    formula = FORMULAS[name]
    assert formula.source and set(formula.outputs) <= formula.definitions.keys()
    for text in formula.definitions.values():
        parse(text)
    wanted = needed(formula)
    used = {name: text for name, text in formula.definitions.items() if name in wanted}
    assert used.keys() == formula.definitions.keys()
    sensor = pz.Sensor(name, {"value": " + ".join(formula.outputs)}, definitions=used)
    assert sensor.definitions
    assert pickle.loads(pickle.dumps(formula)).definitions == formula.definitions


def names_in(text):
    import re

    return set(re.findall(r"[A-Za-z_]\w*", text))


def needed(formula):
    wanted, open_ = set(), list(formula.outputs)
    while open_:
        name = open_.pop()
        if name in formula.definitions and name not in wanted:
            wanted.add(name)
            open_ += names_in(formula.definitions[name])
    return wanted


def test_arguments_are_checked():
    with pytest.raises(TypeError, match="arguments are elevation, electrons, frequency, layer"):
        media.single_layer(1.0, 2.0)
    with pytest.raises(TypeError, match="arguments are"):
        media.single_layer(1.0, 5e17, 1e9, 450e3, layer=3.0)
    with pytest.raises(TypeError, match="arguments are"):
        media.single_layer(1.0, 5e17, 1e9, hight=3.0)
    assert media.single_layer(np.ones(3), 5e17, 1e9, 450e3).shape == (3,)
