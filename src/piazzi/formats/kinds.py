"""What may be measured, by name, with the SI unit that its values are kept in."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import NamedTuple


class Kind(NamedTuple):
    """SI unit of a kind of row, and whether it only helps to use the others (a transmitted frequency, the weather)."""

    unit: str
    auxiliary: bool = False


KINDS: Mapping[str, Kind] = {
    # along the line of sight; `Segment.way` and `Segment.range_is` say which legs
    "range": Kind("m"),
    "range_ru": Kind("RU"),  # range units of the ranging machine; --range-unit says how long one is
    "time_of_flight": Kind("s"),
    "range_rate": Kind("m/s"),  # of the instant; positive when receding
    "range_rate_averaged": Kind("m/s"),  # over `Segment.interval`
    "pseudorange": Kind("m"),
    "doppler": Kind("Hz"),
    "doppler_count": Kind("cycle"),
    "receive_frequency": Kind("Hz"),
    "receive_phase": Kind("cycle"),
    "delta_range_delay": Kind("s"),  # DOR: differential one-way range
    "vlbi_delay": Kind("s"),
    # directions; azimuth from north through east, on the sphere as they are, not times cosines
    "azimuth": Kind("rad"),
    "elevation": Kind("rad"),
    "right_ascension": Kind("rad"),
    "declination": Kind("rad"),
    "x_east": Kind("rad"),
    "y_north": Kind("rad"),
    "x_south": Kind("rad"),
    "y_east": Kind("rad"),
    # fixes: up to six rows of one time
    "x": Kind("m"),
    "y": Kind("m"),
    "z": Kind("m"),
    "vx": Kind("m/s"),
    "vy": Kind("m/s"),
    "vz": Kind("m/s"),
    "latitude": Kind("rad"),
    "longitude": Kind("rad"),
    "height": Kind("m"),
    # what helps to use the others
    "transmit_frequency": Kind("Hz", True),
    "transmit_frequency_rate": Kind("Hz/s", True),
    "transmit_phase": Kind("cycle", True),
    "clock_bias": Kind("s", True),
    "clock_drift": Kind("s/s", True),
    "total_electron_content": Kind("1/m^2", True),  # along the path
    "troposphere_dry": Kind("m", True),
    "troposphere_wet": Kind("m", True),
    "pressure": Kind("Pa", True),
    "temperature": Kind("K", True),
    "humidity": Kind("", True),  # relative, 0 to 1
    # what says how well it was seen
    "magnitude": Kind("mag", True),
    "radar_cross_section": Kind("m^2", True),
    "carrier_power": Kind("dBW", True),
    "carrier_to_noise": Kind("dBHz", True),
    "ranging_to_noise": Kind("dBHz", True),
}


def asked_sigmas(kinds: Iterable[str]) -> str:
    """Words that ask for the standard deviations of these kinds, one for each unit, and name the option."""
    names = list(kinds)
    written = {"rad": "...deg", "RU": "...m", "cycle": "..."}
    sigmas = dict.fromkeys(written.get(KINDS[name].unit, f"...{KINDS[name].unit}") for name in names)
    return f"standard deviations of {', '.join(names)}: {' '.join(f'--sigma {sigma}' for sigma in sigmas)}"


TAGS = ("", "transmit", "bounce", "receive")
ANGLES = ("astrometric", "geocentric", "apparent")
