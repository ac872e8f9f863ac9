"""Keywords of Orbit Data Messages (CCSDS 502.0-B-2 and B-3): OEM, OPM and OMM, with their units."""

from __future__ import annotations

HEADER = ("CREATION_DATE", "ORIGINATOR", "MESSAGE_ID", "CLASSIFICATION")
OBJECT = ("OBJECT_NAME", "OBJECT_ID", "CENTER_NAME", "REF_FRAME", "REF_FRAME_EPOCH", "TIME_SYSTEM")
SPAN = ("START_TIME", "USEABLE_START_TIME", "USEABLE_STOP_TIME", "STOP_TIME")
OEM_META = (*OBJECT, *SPAN, "INTERPOLATION", "INTERPOLATION_DEGREE")
AXES = ("X", "Y", "Z")
STATE = (*AXES, *(f"{axis}_DOT" for axis in AXES))
ACCELERATION = tuple(f"{axis}_DDOT" for axis in AXES)
COVARIANCE = tuple(f"C{row}_{column}" for i, row in enumerate(STATE) for column in STATE[: i + 1])
# keyword: (name of ours, unit of the message)
SPACECRAFT = {
    "MASS": ("mass", "kg"), "SOLAR_RAD_AREA": ("radiation_area", "m**2"), "SOLAR_RAD_COEFF": ("radiation_coefficient", ""),
    "DRAG_AREA": ("drag_area", "m**2"), "DRAG_COEFF": ("drag_coefficient", ""),
}  # fmt: skip
ELEMENTS = {
    "SEMI_MAJOR_AXIS": ("semi_major_axis", "km"), "MEAN_MOTION": ("mean_motion", "rev/day"),
    "ECCENTRICITY": ("eccentricity", ""), "INCLINATION": ("inclination", "deg"), "RA_OF_ASC_NODE": ("ascending_node", "deg"),
    "ARG_OF_PERICENTER": ("argument_of_pericentre", "deg"), "TRUE_ANOMALY": ("true_anomaly", "deg"),
    "MEAN_ANOMALY": ("mean_anomaly", "deg"), "GM": ("gm", "km**3/s**2"),
}  # fmt: skip
MANOEUVRE = ("MAN_EPOCH_IGNITION", "MAN_DURATION", "MAN_DELTA_MASS", "MAN_REF_FRAME", "MAN_DV_1", "MAN_DV_2", "MAN_DV_3")
TLE = {
    "EPHEMERIS_TYPE": "", "CLASSIFICATION_TYPE": None, "NORAD_CAT_ID": "", "ELEMENT_SET_NO": "", "REV_AT_EPOCH": "",
    "BSTAR": "1/ER", "BTERM": "m**2/kg", "MEAN_MOTION_DOT": "rev/day**2", "MEAN_MOTION_DDOT": "rev/day**3", "AGOM": "m**2/kg",
}  # fmt: skip
OPM = {
    *HEADER, *OBJECT, "EPOCH", *STATE, *(k for k in ELEMENTS if k != "MEAN_MOTION"), *SPACECRAFT, "COV_REF_FRAME", *COVARIANCE,
    *MANOEUVRE, "CCSDS_OPM_VERS",
}  # fmt: skip
OMM = {
    *HEADER, *OBJECT, "MEAN_ELEMENT_THEORY", "EPOCH", *(k for k in ELEMENTS if k != "TRUE_ANOMALY"), *SPACECRAFT, *TLE,
    "COV_REF_FRAME", *COVARIANCE, "CCSDS_OMM_VERS",
}  # fmt: skip
