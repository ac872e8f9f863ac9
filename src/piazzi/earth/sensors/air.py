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
    """Definitions, and the numbers of the station that they use, as they come together."""

    def __init__(self) -> None:
        self.definitions: dict[str, str] = {}
        self.numbers: dict[str, float] = {}

    def look(self, instant: str, satellite: str, station: str) -> None:
        """East, north and up of the line to the satellite (`look_e`, `look_n`, `look_u`), and its `elevation`."""
        self.definitions |= difference("line", satellite, station)
        self.turn(instant, tuple(f"line_{a}" for a in AXES))
        self.definitions["elevation"] = "atan2(look_u, sqrt(look_e**2 + look_n**2))"

    def turn(self, instant: str, line: tuple[str, ...]) -> None:
        """East, north and up of a line whose components are along the axes of the GCRF."""
        self.numbers |= PLACE | {"longitude": 0.0}
        self.numbers.pop("height")
        self.definitions |= {
            names("ground"): f"fixed({instant}, {', '.join(line)})",
            "look_out": "cos(longitude)*ground_x + sin(longitude)*ground_y",
            "look_e": "cos(longitude)*ground_y - sin(longitude)*ground_x",
            "look_n": "cos(latitude)*ground_z - sin(latitude)*look_out",
            "look_u": "cos(latitude)*look_out + sin(latitude)*ground_z",
        }

    def add(self, prefix: str, formula: media.Formula, **given: str) -> None:
        """A formula, its names with a prefix."""
        self.definitions |= renamed(formula.definitions, prefix, given)

    def troposphere(self, model: str) -> str:
        """One way through the neutral air at the elevation: the name of the delay (m)."""
        one_of(model, TROPOSPHERE, "troposphere")
        self.numbers |= WEATHER | PLACE
        if model == "saastamoinen":
            self.numbers |= {name: _COEFFICIENTS[name] for name in MAPPINGS}
            self.add("zenith", media.saastamoinen)
            self.add("slant", media.mapping)
            self.definitions["air"] = "zenith_hydrostatic*slant_map_hydrostatic + zenith_wet*slant_map_wet"
            return "air"
        self.numbers["wavelength"] = 532e-9
        self.add("laser", media.mendes_pavlis if model == "mendes-pavlis" else media.marini_murray)
        return "laser_delay"

    def ionosphere(self, model: str, legs: int) -> str:
        """One way through the ionosphere at the elevation, the mean of the legs: the name of the delay of codes (m)."""
        one_of(model, IONOSPHERE, "ionosphere")
        self.numbers["frequency"] = 2e9
        if model == "single-layer":
            self.numbers |= {"electrons": 0.0, "layer": 450e3}
            self.add("ion", media.single_layer)
        else:
            self.numbers |= {"gps_seconds": 0.0, "latitude": 0.0, "longitude": 0.0, **_KLOBUCHAR}
            self.definitions["azimuth_there"] = "atan2(look_e, look_n)"
            self.add("ion", media.klobuchar, azimuth="azimuth_there", gps_seconds="gps_seconds + t")
        if legs == 1:
            return "ion_delay"
        self.numbers["uplink_frequency"] = 2e9
        self.definitions["ion"] = "ion_delay*(1 + (frequency/uplink_frequency)**2)/2"
        return "ion"
