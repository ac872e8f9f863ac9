"""Keywords of the Tracking Data Message (CCSDS 503.0-B-1 and B-2), and what their values are in SI."""

from __future__ import annotations

import math
from typing import NamedTuple

LIGHT = 299792458.0
DEGREE = math.pi / 180


class Quantity(NamedTuple):
    """What a keyword measures, and the factor from the message's unit to SI."""

    kind: str
    factor: float = 1.0


PLAIN = {
    "CARRIER_POWER": Quantity("carrier_power"),
    "DOPPLER_COUNT": Quantity("doppler_count"),
    "DOPPLER_INSTANTANEOUS": Quantity("range_rate", 1e3),
    "DOPPLER_INTEGRATED": Quantity("range_rate_averaged", 1e3),
    "PC_N0": Quantity("carrier_to_noise"),
    "PR_N0": Quantity("ranging_to_noise"),
    "RECEIVE_FREQ": Quantity("receive_frequency"),
    "DOR": Quantity("delta_range_delay"),
    "VLBI_DELAY": Quantity("vlbi_delay"),
    "MAG": Quantity("magnitude"),
    "RCS": Quantity("radar_cross_section"),
    "CLOCK_BIAS": Quantity("clock_bias"),
    "CLOCK_DRIFT": Quantity("clock_drift"),
    "STEC": Quantity("total_electron_content", 1e16),
    "TROPO_DRY": Quantity("troposphere_dry"),
    "TROPO_WET": Quantity("troposphere_wet"),
    "PRESSURE": Quantity("pressure", 1e2),
    "RHUMIDITY": Quantity("humidity", 1e-2),
    "TEMPERATURE": Quantity("temperature"),
}
OF_PARTICIPANT = {
    "RECEIVE_FREQ": Quantity("receive_frequency"),
    "TRANSMIT_FREQ": Quantity("transmit_frequency"),
    "TRANSMIT_FREQ_RATE": Quantity("transmit_frequency_rate"),
    "RECEIVE_PHASE_CT": Quantity("receive_phase"),
    "TRANSMIT_PHASE_CT": Quantity("transmit_phase"),
}
ANGLE_KINDS = {
    "AZEL": ("azimuth", "elevation"),
    "RADEC": ("right_ascension", "declination"),
    "XEYN": ("x_east", "y_north"),
    "XSYE": ("x_south", "y_east"),
}
RANGE_FACTORS = {"km": 1e3, "s": LIGHT, "RU": 1.0}
# name of a correction, and its factor to SI where the range's unit does not say it
CORRECTIONS = {
    "ANGLE_1": DEGREE, "ANGLE_2": DEGREE, "DOPPLER": 1e3, "MAG": 1.0, "RANGE": None, "RCS": 1.0, "RECEIVE": 1.0,
    "TRANSMIT": 1.0, "ABERRATION_YEARLY": DEGREE, "ABERRATION_DIURNAL": DEGREE,
}  # fmt: skip
PEOPLE = range(1, 10)
DATA = {*PLAIN, "RANGE", "ANGLE_1", "ANGLE_2"} | {f"{name}_{i}" for name in OF_PARTICIPANT for i in PEOPLE}
HEADER = ("CCSDS_TDM_VERS", "CREATION_DATE", "ORIGINATOR", "MESSAGE_ID")
MODES = ("SEQUENTIAL", "SINGLE_DIFF")
TEXTS = (
    "TRACK_ID", "DATA_TYPES", "START_TIME", "STOP_TIME", "TRANSMIT_BAND", "RECEIVE_BAND", "INTERPOLATION",
    "INTERPOLATION_DEGREE",
)  # fmt: skip
METADATA = {
    *TEXTS, "TIME_SYSTEM", "MODE", "PATH", "PATH_1", "PATH_2", "TURNAROUND_NUMERATOR", "TURNAROUND_DENOMINATOR", "TIMETAG_REF",
    "INTEGRATION_INTERVAL", "INTEGRATION_REF", "FREQ_OFFSET", "RANGE_MODE", "RANGE_MODULUS", "RANGE_UNITS", "ANGLE_TYPE",
    "REFERENCE_FRAME", "DOPPLER_COUNT_BIAS", "DOPPLER_COUNT_SCALE", "DOPPLER_COUNT_ROLLOVER", "DATA_QUALITY",
    "CORRECTIONS_APPLIED", *(f"CORRECTION_{name}" for name in CORRECTIONS),
    *(f"{name}_{i}" for name in ("PARTICIPANT", "EPHEMERIS_NAME", "TRANSMIT_DELAY", "RECEIVE_DELAY") for i in PEOPLE),
}  # fmt: skip
