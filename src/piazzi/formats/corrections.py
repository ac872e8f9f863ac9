"""Corrections that a file gives as numbers and leaves to its reader."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from piazzi.formats.observations import Observations

# kinds that a correction is added to
ADDED: Mapping[str, tuple[str, ...]] = {
    "angle_1": ("azimuth", "right_ascension", "x_east", "x_south"),
    "angle_2": ("elevation", "declination", "y_north", "y_east"),
    "doppler": ("range_rate", "range_rate_averaged"),
    "mag": ("magnitude",),
    "range": ("range", "range_ru"),
    "rcs": ("radar_cross_section",),
    "receive": ("receive_frequency",),
    "station delay": ("range",),  # of lasers
    "transmit": ("transmit_frequency",),
}
_DIRECTIONS = ("right_ascension", "declination")


def corrected(observations: Observations) -> Observations:
    """The same rows with the numbers added that files give as corrections and say are not applied.

    Corrections without a number, or that are applied, or of which the file does not say whether they are, stay as they are.

    Raises
    ------
    ValueError
        For aberration that is not applied: it is no sum, because it depends on the direction.
    """
    value = observations.value.copy()
    segments = []
    for i, segment in enumerate(observations.segments):
        rows = observations.segment == i
        new = []
        for correction in segment.corrections:
            waits = correction.applied is False and correction.value is not None
            if waits and correction.name.startswith("aberration") and (rows & observations.of_kind(*_DIRECTIONS)).any():
                raise ValueError(
                    f"the correction {correction.name!r} is not applied, and cannot be: it depends on the direction"
                )
            if waits and correction.name in ADDED:
                value[rows & observations.of_kind(*ADDED[correction.name])] += correction.value
                correction = correction._replace(applied=True)  # noqa: PLW2901
            new.append(correction)
        segments.append(replace(segment, corrections=tuple(new)))
    if not np.isfinite(value).all() and np.isfinite(observations.value).all():
        raise ValueError("a correction makes a value infinite")
    return replace(observations, value=value, segments=tuple(segments))
