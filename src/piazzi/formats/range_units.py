"""Ranges in units of the ranging machine, as metres where somebody says how long a unit is."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from piazzi.formats.observations import Observations, Segment
from piazzi.text import nearest
from piazzi.units import Units

RU, RANGE = "range_ru", "range"


def range_unit_of(text: str) -> tuple[str, float]:
    """Station, "" for all, and metres of ``0.28m`` or ``DSS-25=0.28m``; raises ValueError for other text."""
    station, equals, length = text.rpartition("=")
    try:
        number, unit = Units().quantity(length.strip())
        metres = number * unit.factor
    except ValueError:
        metres, unit = 0.0, Units().unit("m")
    if unit.powers != Units().unit("m").powers or not 0.0 < metres < np.inf:
        raise ValueError(f"a range unit is a length, as in 0.28m or DSS-25=0.28m, not {text!r}")
    return (station if equals else "", metres)


def in_metres(observations: Observations, told: Mapping[str, float], partial: bool = False) -> Observations:
    """The same with ranges in m where the length of their station's range unit is told, by name or "" for all.

    `partial` observations need not have every station that is named.

    Raises
    ------
    ValueError
        For a station that is not there.
    """
    if not told or RU not in observations.kinds:
        return observations
    for name in told:
        if name and name not in observations.participants and not partial:
            raise ValueError(f"range unit of {name!r}: no such station{nearest(name, observations.participants)}")
    factors = np.array([told.get(name, told.get("", np.nan)) for name in observations.participants] + [told.get("", np.nan)])
    factor = factors[observations.station]  # -1, of nobody, is the last
    rows = observations.of_kind(RU) & np.isfinite(factor)
    kinds = observations.kinds if RANGE in observations.kinds else (*observations.kinds, RANGE)
    left = observations.of_kind(RU) & ~rows
    scale = np.where(rows, factor, 1.0)
    segments = tuple(
        _turned(segment, factor[rows & (observations.segment == i)]) for i, segment in enumerate(observations.segments)
    )
    texts = observations.open if left.any() else tuple(_said(text) for text in observations.open if "--range-unit" not in text)
    return replace(
        observations,
        kinds=kinds,
        kind=np.where(rows, kinds.index(RANGE), observations.kind),
        value=observations.value * scale,
        sigma=observations.sigma * scale,
        segments=segments,
        open=texts,
    )


def _said(text: str) -> str:
    return text.replace(RU, RANGE)


def _turned(segment: Segment, factors: np.ndarray) -> Segment:
    """A segment with modulus and correction of ranges in m; those of one segment are of one station."""
    if not len(factors):
        return segment
    metres = float(factors[0])
    corrections = tuple(
        c._replace(value=c.value * metres) if c.name == RANGE and c.value is not None else c for c in segment.corrections
    )
    modulus = None if segment.range_modulus is None else segment.range_modulus * metres
    return replace(segment, corrections=corrections, range_modulus=modulus)
