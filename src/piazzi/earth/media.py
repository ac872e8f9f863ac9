"""The media between station and satellite: formulas as text of the language, in SI units and radians, callable with arrays.

Each is a `Formula`: call it for values, take its `definitions` for a model.  Weather is pressure (Pa), temperature (K) and the
pressure of vapour (Pa); delays are in metres and one way.
"""

from piazzi.earth.formula import Formula
from piazzi.earth.ionosphere import ionosphere_sign, klobuchar, single_layer
from piazzi.earth.laser_delay import marini_murray, mendes_pavlis
from piazzi.earth.refraction import optical_refraction, radio_refraction, refractivity
from piazzi.earth.troposphere import gmf_coefficients, mapping, niell_coefficients, saastamoinen
from piazzi.earth.weather import Weather, standard_atmosphere, vapour_pressure

__all__ = [
    "Formula", "Weather", "gmf_coefficients", "ionosphere_sign", "klobuchar", "mapping", "marini_murray", "mendes_pavlis",
    "niell_coefficients", "optical_refraction", "radio_refraction", "refractivity", "saastamoinen", "single_layer",
    "standard_atmosphere", "vapour_pressure",
]  # fmt: skip
