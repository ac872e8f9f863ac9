"""Delay in the ionosphere, which goes with 1/f^2: codes and ranges are late, phases and Doppler early by as much."""

from __future__ import annotations

from piazzi.earth.formula import Formula
from piazzi.text import nearest

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


def ionosphere_sign(kind: str) -> float:
    """+1 for what the ionosphere delays (code, range), -1 for what it advances (phase, doppler)."""
    if kind not in SIGNS:
        raise ValueError(f"{kind!r} is neither delayed nor advanced by the ionosphere{nearest(kind, SIGNS)}")
    return SIGNS[kind]
