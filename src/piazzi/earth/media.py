"""The media between station and satellite: formulas as text of the language, in SI units and radians, callable with arrays.

Each is a `Formula`: call it for values, take its `definitions` for a model.  Weather is pressure (Pa), temperature (K) and the
pressure of vapour (Pa); delays are in metres and one way.
"""

from __future__ import annotations

from piazzi.earth.formula import Formula
from piazzi.earth.troposphere import gmf_coefficients, mapping, niell_coefficients, saastamoinen
from piazzi.earth.weather import Weather, standard_atmosphere, vapour_pressure
from piazzi.text import nearest

__all__ = [
    "Formula", "Weather", "gmf_coefficients", "ionosphere_sign", "klobuchar", "mapping", "marini_murray", "mendes_pavlis",
    "niell_coefficients", "optical_refraction", "radio_refraction", "refractivity", "saastamoinen", "single_layer",
    "standard_atmosphere", "vapour_pressure",
]  # fmt: skip

# the ionosphere goes with 1/f^2: codes and ranges are late, phases and Doppler early by as much
SIGNS = {"code": 1.0, "range": 1.0, "phase": -1.0, "doppler": -1.0}

klobuchar = Formula(
    (
        "elevation", "azimuth", "latitude", "longitude", "gps_seconds", "frequency",
        "alpha0", "alpha1", "alpha2", "alpha3", "beta0", "beta1", "beta2", "beta3",
    ),
    {  # semicircles, as the message has them
        "psi": "0.0137/(elevation/pi + 0.11) - 0.022",
        "phi": "min(max(latitude/pi + psi*cos(azimuth), -0.416), 0.416)",
        "lam": "longitude/pi + psi*sin(azimuth)/cos(pi*phi)",
        "geomagnetic": "phi + 0.064*cos(pi*(lam - 1.617))",
        "clock": "pi*(lam + (gps_seconds - 50400)/43200)",  # local time from 14h, as an angle
        "period": "max(beta0 + geomagnetic*(beta1 + geomagnetic*(beta2 + geomagnetic*beta3)), 72000)",
        "x": "86400/period*atan2(sin(clock), cos(clock))",
        "amplitude": "max(alpha0 + geomagnetic*(alpha1 + geomagnetic*(alpha2 + geomagnetic*alpha3)), 0)",
        "day": "(1 + sign(1.57 - abs(x)))/2*amplitude*(1 - x**2/2 + x**4/24)",
        "delay": "299792458*(1 + 16*(0.53 - elevation/pi)**3)*(5e-9 + day)*(1575.42e6/frequency)**2",
    },
    ("delay",),
    "Klobuchar 1987, IEEE Trans. AES 23, 325; IS-GPS-200, 20.3.3.5.2.5",
)  # fmt: skip
single_layer = Formula(
    ("elevation", "electrons", "frequency", "layer"),
    {"delay": "40.308*electrons/frequency**2/sqrt(1 - (6371000*cos(elevation)/(6371000 + layer))**2)"},
    ("delay",),
    "electrons of the vertical per m^2 (1e16 is one TEC unit), in a thin layer at a height in m, such as 450e3",
)


# laser pulses in the atmosphere, one way, from station to satellite
LASER = ("elevation", "latitude", "height", "pressure", "temperature", "vapour", "wavelength")

# IERS Conventions 2010, 9.1: eqs. 9.3 to 9.7 for the zenith, 9.9 and 9.10 with table 9.1 for the mapping (FCULa)
mendes_pavlis = Formula(
    LASER,
    {
        "site": "1 - 0.00266*cos(2*latitude) - 2.8e-7*height",
        "k2": "1e-12/wavelength**2",  # square of the wave number in 1/micrometre
        "fh": "0.01*(1 + 0.534e-6*(375 - 450))*(19990.975*(238.0185 + k2)/(238.0185 - k2)**2"
        " + 579.55174*(57.362 + k2)/(57.362 - k2)**2)",
        "fnh": "0.003101*(295.235 + 3*2.6422*k2 - 5*0.032380*k2**2 + 7*0.004028*k2**3)",
        "hydrostatic": "2.416579e-5*fh*pressure/site",
        "wet": "1e-6*(5.316*fnh - 3.759*fh)*vapour/site",
        "celsius": "temperature - 273.15",
        "a1": "0.121008e-2 + 0.17295e-5*celsius + 0.3191e-4*cos(latitude) - 0.18478e-7*height",
        "a2": "0.304965e-2 + 0.2346e-5*celsius - 0.1035e-3*cos(latitude) - 0.1856e-7*height",
        "a3": "0.68777e-1 + 0.1972e-4*celsius - 0.3458e-2*cos(latitude) + 0.1060e-6*height",
        "s": "sin(elevation)",
        "fcul": "(1 + a1/(1 + a2/(1 + a3)))/(s + a1/(s + a2/(s + a3)))",
        "delay": "(hydrostatic + wet)*fcul",
    },
    ("delay",),
    "Mendes and Pavlis 2004, GRL 31, L14602; Mendes et al. 2002, GRL 29, 1414",
)

marini_murray = Formula(
    LASER,
    {
        "site": "1 - 0.0026*cos(2*latitude) - 3.1e-7*height",
        "k2": "1e-12/wavelength**2",
        "colour": "0.9650 + 0.0164*k2 + 0.000228*k2**2",
        "kk": "1.163 - 0.00968*cos(2*latitude) - 0.00104*temperature + 1.435e-7*pressure",
        "a": "2.357e-5*pressure + 1.41e-6*vapour",
        "b": "1.084e-10*pressure*temperature*kk + 4.734e-12*pressure**2/temperature*2/(3 - 1/kk)",
        "s": "sin(elevation)",
        "delay": "colour/site*(a + b)/(s + b/(a + b)/(s + 0.01))",
    },
    ("delay",),
    "Marini and Murray 1973, NASA X-591-73-351; above 10 degrees",
)

# refraction: what has to be added to the true elevation, without air, for the apparent one
optical_refraction = Formula(
    ("elevation", "pressure", "temperature"),
    {
        "degrees": "180/pi*elevation",
        "refraction": "pi/10800*(1.02/tan(pi/180*(degrees + 10.3/(degrees + 5.11))) + 0.0019279)"
        "*pressure/101000*283/temperature",
    },
    ("refraction",),
    "Saemundsson 1986, Sky and Telescope 72, 70, with weather as in Meeus 1998, 16.4; to 0.1 arcminute above the horizon",
)
refractivity = Formula(
    ("pressure", "temperature", "vapour"),
    {"refractivity": "0.776*(pressure - vapour)/temperature + 0.72*vapour/temperature + 3.75e3*vapour/temperature**2"},
    ("refractivity",),
    "ITU-R P.453-14, eq. 1, in units of 1e-6",
)
radio_refraction = Formula(
    ("elevation", "height", "refractivity"),
    {
        "e": "180/pi*elevation",
        "km": "1e-3*height",
        "low": "pi/180/(1.728 + 0.5411*e + 0.03723*e**2 + km*(0.1815 + 0.06272*e + 0.01380*e**2)"
        " + km**2*(0.01727 + 0.008288*e))",  # of the reference atmosphere
        "cot": "1/tan(max(elevation, 0.09))",
        "high": "315e-6*exp(-km/7.35)*cot*(1 - 0.00115*(1 + cot**2))",  # two terms in cot, scale height over radius
        "share": "1/(1 + exp(10 - e))",  # the first holds to 10 degrees, the second from there
        "refraction": "refractivity/(315*exp(-km/7.35))*((1 - share)*low + share*high)",
    },
    ("refraction",),
    "ITU-R P.834-9, eq. 12, to 10 degrees, the cotangent above; in proportion to the refractivity at the ground",
)


def ionosphere_sign(kind: str) -> float:
    """+1 for what the ionosphere delays (code, range), -1 for what it advances (phase, doppler)."""
    if kind not in SIGNS:
        raise ValueError(f"{kind!r} is neither delayed nor advanced by the ionosphere{nearest(kind, SIGNS)}")
    return SIGNS[kind]
