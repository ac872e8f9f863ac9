"""Files of others: tracking data and ephemerides, as columns with the conventions that they state."""

from typing import TYPE_CHECKING

from piazzi.faces import lazy

if TYPE_CHECKING:
    from piazzi.formats.contents import summary
    from piazzi.formats.conventions import Conventions
    from piazzi.formats.corrections import corrected
    from piazzi.formats.ephemeris import Arc, Burn, Ephemeris, MeanElements
    from piazzi.formats.joining import concatenate
    from piazzi.formats.kinds import KINDS, TAGS, Kind
    from piazzi.formats.observations import Correction, Observations, Segment
    from piazzi.formats.ramps import Ramp, ramp_of
    from piazzi.formats.recognise import read_ephemeris, read_tracking
    from piazzi.formats.write_csv import csv_text
    from piazzi.formats.write_ocm import ocm_text
    from piazzi.formats.write_odm import oem_text, omm_text, opm_text
    from piazzi.formats.write_tdm import tdm_text

__all__ = [
    "KINDS", "TAGS", "Arc", "Burn", "Conventions", "Correction", "Ephemeris", "Kind", "MeanElements", "Observations",
    "Ramp", "Segment", "concatenate", "corrected", "csv_text", "ocm_text", "oem_text", "omm_text", "opm_text", "ramp_of",
    "read_ephemeris", "read_tracking", "summary", "tdm_text",
]  # fmt: skip

lazy(__name__)
