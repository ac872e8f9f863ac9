"""Files of others: tracking data and ephemerides, as columns with the conventions that they state."""

from piazzi.formats.conventions import Conventions
from piazzi.formats.ephemeris import Arc, Ephemeris
from piazzi.formats.joining import concatenate
from piazzi.formats.kinds import KINDS, TAGS, Kind
from piazzi.formats.observations import Correction, Observations, Segment
from piazzi.formats.recognise import read_ephemeris, read_tracking

__all__ = [
    "KINDS", "TAGS", "Arc", "Conventions", "Correction", "Ephemeris", "Kind", "Observations", "Segment", "concatenate",
    "read_ephemeris", "read_tracking",
]  # fmt: skip
