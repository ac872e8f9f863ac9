"""Weather at a station: pressure, temperature and humidity, measured or standard for its height."""

from __future__ import annotations

from dataclasses import dataclass

from piazzi.earth.formula import Formula

# Saturation pressure and enhancement factor: Davis 1992, Metrologia 29 (CIPM), as in the IERS Conventions 2010, 9.1
vapour_pressure = Formula(
    ("pressure", "temperature", "humidity"),
    {
        "saturation": "exp(1.2378847e-5*temperature**2 - 1.9121316e-2*temperature + 33.93711047 - 6.3431645e3/temperature)",
        "enhancement": "1.00062 + 3.14e-8*pressure + 5.6e-7*(temperature - 273.15)**2",
        "vapour": "humidity*saturation*enhancement",
    },
    ("vapour",),
    "Davis 1992, Metrologia 29, 67",
)
standard_atmosphere = Formula(
    ("height",),
    {
        "pressure": "101325*(1 - 2.25577e-5*height)**5.25588",
        "temperature": "288.15 - 0.0065*height",
        "humidity": "0.5*exp(-6.396e-4*height)",
    },
    ("pressure", "temperature", "humidity"),
    "US Standard Atmosphere 1976 to 11 km; humidity as in Berg 1948",
)
GROUND = -1000.0, 9000.0  # m, where stations may stand


@dataclass(frozen=True)
class Weather:
    """Weather at a station.

    Parameters
    ----------
    pressure : Pa, at the station, not reduced to the sea
    temperature : K
    humidity : relative, 0 to 1
    """

    pressure: float = 101325.0
    temperature: float = 288.15
    humidity: float = 0.5

    def __post_init__(self) -> None:
        for name, low, high, unit, hint in (
            ("pressure", 2e4, 1.2e5, "Pa", "hPa or mbar times 100"),
            ("temperature", 180.0, 340.0, "K", "degrees Celsius plus 273.15"),
            ("humidity", 0.0, 1.0, "", "percent by 100"),
        ):
            value = getattr(self, name)
            if not low <= value <= high:
                raise ValueError(f"{name} is {value!r}; it lies from {low:g} to {high:g} {unit}".rstrip() + f" ({hint})")

    @classmethod
    def standard(cls, height: float) -> Weather:
        """Standard weather at a height (m): 1013.25 hPa, 15 degrees Celsius and half of saturation at the sea.

        Of places below all ground or above it, that of the lowest or the highest: whether they are meant is asked elsewhere.
        """
        return cls(*(float(value) for value in standard_atmosphere(min(max(height, GROUND[0]), GROUND[1]))))

    @property
    def vapour(self) -> float:
        """Partial pressure of water vapour, Pa."""
        return float(vapour_pressure(self.pressure, self.temperature, self.humidity))
