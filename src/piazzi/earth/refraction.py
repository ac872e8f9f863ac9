"""Refraction of angles: what has to be added to the true elevation, without air, for the apparent one."""

from __future__ import annotations

from piazzi.earth.formula import Formula

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
