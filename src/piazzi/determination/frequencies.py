"""Frequencies of a satellite's own transmitter as stations receive them, whose carrier is known or estimated."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from math import floor, log10
from typing import Any

import numpy as np

from piazzi.determination.parts import Part
from piazzi.determination.ranging import passes
from piazzi.determination.sites import Context
from piazzi.earth import sensors
from piazzi.problem import Gaussian
from piazzi.problem.checks import Array

NAMES = ("carrier", "transmit")  # of a carrier that a segment states
DIGITS = 3  # of the nominal carrier, where nobody says it: the rest is estimated


def frequencies(context: Context, index: Array) -> Sequence[Part]:
    """Rows of received frequencies as parts, one for each station, segment and pass.

    The carrier is that of the file, or of what it says that the object transmitted.  Where it says neither, carrier and drift
    are estimated, the same for all rows, about a rounded median of what was received.

    Raises
    ------
    ValueError
        For signals that the satellite returns, or carriers that change.
    """
    found, unknown = [], []
    for rows in passes(context, index):
        carrier = _carrier(context, int(rows[0]))
        if carrier is None:
            unknown.append(rows)
        else:
            found.append(_part(context, rows, carrier, estimated=False))
    if unknown:
        nominal = _rounded(float(np.median(context.observations.value[np.concatenate(unknown)])))
        context.said[f"the carrier is estimated, before the measurements {nominal / 1e6:g} MHz"] = None
        found += [_part(context, rows, nominal, estimated=True) for rows in unknown]
    return found


def _carrier(context: Context, row: int) -> float | None:
    """What the object sends, Hz, where the file says it."""
    rows = context.observations
    segment = rows.segments[rows.segment[row]]
    if segment.way not in (None, "one-way"):
        raise ValueError(f"{context.where}frequencies of {segment.way} signals are not determined from yet")
    stated = {value for name, value in segment.frequencies if name in NAMES}
    sender = rows.object[row]
    sent = rows.value[rows.of_kind("transmit_frequency") & (rows.participant == sender)] if sender >= 0 else np.zeros(0)
    stated |= {float(value) for value in sent}
    if len(stated) > 1 or rows.of_kind("transmit_frequency_rate").any():
        raise ValueError(f"{context.where}carriers that change are not determined from yet")
    return stated.pop() if stated else None


def _rounded(value: float) -> float:
    size = 10.0 ** (floor(log10(value)) - DIGITS + 1)
    return size * round(value / size)


def _part(context: Context, rows: Array, nominal: float, estimated: bool) -> Part:
    observations = context.observations
    site = context.site(int(observations.station[rows[0]]))
    sensor = _sensor(nominal, estimated, context.clocks)
    given = sensor.at(site, context.epoch, 1.0)
    beliefs = {name: (role, Gaussian(mean, sigma**2)) for name, role in sensor.parameters.items()
               for mean, sigma in (dict(sensor.priors)[name],)}  # fmt: skip
    return Part(
        sensor, site.name, observations.t[rows], observations.value[rows, None], (observations.sigma[rows] ** 2)[:, None, None],
        rows[:, None], given["place"], given["numbers"], sensor.functions(context.epoch), beliefs,
    )  # fmt: skip


@lru_cache(maxsize=64)
def _sensor(nominal: float, estimated: bool, clocks: bool) -> Any:
    name = "frequency" if estimated else f"frequency_{nominal:.0f}"
    return sensors.frequency(nominal, name=name, time_bias=clocks, parameters=("carrier", "drift") if estimated else ())
