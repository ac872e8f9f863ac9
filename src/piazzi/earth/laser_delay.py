"""Delay of laser pulses in the atmosphere, one way, from station to satellite."""

from __future__ import annotations

from piazzi.earth.formula import Formula

ARGUMENTS = ("elevation", "latitude", "height", "pressure", "temperature", "vapour", "wavelength")

# IERS Conventions 2010, 9.1: eqs. 9.3 to 9.7 for the zenith, 9.9 and 9.10 with table 9.1 for the mapping (FCULa)
mendes_pavlis = Formula(
    ARGUMENTS,
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
    ARGUMENTS,
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
