"""What the air and the ionosphere do to a signal at one station, as text of the language."""

from __future__ import annotations

from piazzi.earth import media
from piazzi.earth.sensors.instrument import MAPPINGS, one_of
from piazzi.earth.sensors.text import AXES, difference, names, renamed
from piazzi.earth.weather import Weather

TROPOSPHERE = ("saastamoinen", "mendes-pavlis", "marini-murray")
IONOSPHERE = ("single-layer", "klobuchar")
WEATHER = {"pressure": 101325.0, "temperature": 288.15, "vapour": Weather().vapour}
PLACE = {"latitude": 0.0, "height": 0.0}
_COEFFICIENTS = {"ah": 1.2e-3, "bh": 2.9e-3, "ch": 6.3e-2, "aw": 5.8e-4, "bw": 1.4e-3, "cw": 4.4e-2}
_KLOBUCHAR = {f"{name}{i}": 0.0 for name in ("alpha", "beta") for i in range(4)}


class Air:
    """Definitions, and the numbers of the station that they use, as they come together; `prefix` is that of all names."""

    def __init__(self, prefix: str = "") -> None:
        self.prefix = prefix
        self.definitions: dict[str, str] = {}
        self.numbers: dict[str, float] = {}

    def look(self, instant: str, satellite: str, station: str) -> None:
        """East, north and up of the line to the satellite (`look_e`, `look_n`, `look_u`), and its `elevation`."""
        line = f"{self.prefix}line"
        self.definitions |= difference(line, satellite, station)
        self.turn(instant, tuple(f"{line}_{a}" for a in AXES))

    def turn(self, instant: str, line: tuple[str, ...]) -> None:
        """East, north and up of a line whose components are along the axes of the GCRF, and its `elevation`."""
        p = self.prefix
        self.numbers |= {"latitude": 0.0, "longitude": 0.0}
        self.definitions |= {
            names(f"{p}ground"): f"fixed({instant}, {', '.join(line)})",
            f"{p}look_out": f"cos(longitude)*{p}ground_x + sin(longitude)*{p}ground_y",
            f"{p}look_e": f"cos(longitude)*{p}ground_y - sin(longitude)*{p}ground_x",
            f"{p}look_n": f"cos(latitude)*{p}ground_z - sin(latitude)*{p}look_out",
            f"{p}look_u": f"cos(latitude)*{p}look_out + sin(latitude)*{p}ground_z",
            f"{p}elevation": f"atan2({p}look_u, sqrt({p}look_e**2 + {p}look_n**2))",
        }

    def add(self, name: str, formula: media.Formula, **given: str) -> str:
        """A formula at the elevation, its names with a prefix, which is returned."""
        prefix = f"{self.prefix}{name}"
        at = {"elevation": f"{self.prefix}elevation"} if "elevation" in formula.arguments else {}
        self.definitions |= renamed(formula.definitions, prefix, at | given)
        return prefix

    def troposphere(self, model: str) -> str:
        """One way through the neutral air at the elevation: the name of the delay (m)."""
        one_of(model, TROPOSPHERE, "troposphere")
        self.numbers |= WEATHER | PLACE
        if model == "saastamoinen":
            self.numbers |= {name: _COEFFICIENTS[name] for name in MAPPINGS}
            zenith, slant = self.add("zenith", media.saastamoinen), self.add("slant", media.mapping)
            text = f"{zenith}_hydrostatic*{slant}_map_hydrostatic + {zenith}_wet*{slant}_map_wet"
            self.definitions[f"{self.prefix}air_delay"] = text
            return f"{self.prefix}air_delay"
        self.numbers["wavelength"] = 532e-9
        return self.add("laser", media.mendes_pavlis if model == "mendes-pavlis" else media.marini_murray) + "_delay"

    def ionosphere(self, model: str, legs: int) -> str:
        """One way through the ionosphere at the elevation, the mean of the legs: the name of the delay of codes (m)."""
        one_of(model, IONOSPHERE, "ionosphere")
        self.numbers["frequency"] = 2e9
        if model == "single-layer":
            self.numbers |= {"electrons": 0.0, "layer": 450e3}
            delay = self.add("ion", media.single_layer) + "_delay"
        else:
            self.numbers |= {"gps_seconds": 0.0, "latitude": 0.0, "longitude": 0.0, **_KLOBUCHAR}
            there = f"{self.prefix}look_azimuth"
            self.definitions[there] = f"atan2({self.prefix}look_e, {self.prefix}look_n)"
            delay = self.add("ion", media.klobuchar, azimuth=there, gps_seconds="gps_seconds + t") + "_delay"
        if legs == 1:
            return delay
        self.numbers["uplink_frequency"] = 2e9
        self.definitions[f"{self.prefix}ion_mean"] = f"{delay}*(1 + (frequency/uplink_frequency)**2)/2"
        return f"{self.prefix}ion_mean"
