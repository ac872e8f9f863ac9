"""Ramped frequencies: what a transmitter sent at an instant, and how many cycles between two."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from piazzi.arrays import Array, distinct
from piazzi.formats.observations import Observations
from piazzi.text import brief, nearest


@dataclass(frozen=True, eq=False)
class Ramp:
    """A frequency that is linear in time between events: from `t` (K,) s on `frequency` Hz, changing by `rate` Hz/s."""

    t: Array
    frequency: Array
    rate: Array

    __repr__ = brief

    def at(self, t: Any) -> Array:
        """Frequency in Hz at instants of any shape; NaN before the first event."""
        t = np.asarray(t, dtype=float)
        k = np.searchsorted(self.t, t, side="right") - 1
        safe = np.maximum(k, 0)
        return np.where(k >= 0, self.frequency[safe] + self.rate[safe] * (t - self.t[safe]), np.nan)

    def cycles(self, start: Any, end: Any) -> Array:
        """Cycles sent from `start` to `end`, of any shape: the integral of the frequency; NaN before the first event.

        The first frequency is integrated apart from the changes, which keeps 1e-7 cycles over hours at any carrier.
        """
        start, end = np.asarray(start, dtype=float), np.asarray(end, dtype=float)
        return np.asarray(self.frequency[0] * (end - start) + (self._changes(end) - self._changes(start)))

    def _changes(self, t: Array) -> Array:
        """Integral of the frequency less the first one, from the first event."""
        above, steps = self.frequency - self.frequency[0], np.diff(self.t)
        whole = np.append(0.0, np.cumsum((above[:-1] + 0.5 * self.rate[:-1] * steps) * steps))
        k = np.searchsorted(self.t, t, side="right") - 1
        safe = np.maximum(k, 0)
        dt = t - self.t[safe]
        return np.where(k >= 0, whole[safe] + (above[safe] + 0.5 * self.rate[safe] * dt) * dt, np.nan)


def ramp_of(observations: Observations, participant: str) -> Ramp:
    """What a participant transmitted, from rows ``transmit_frequency`` and ``transmit_frequency_rate``.

    A frequency holds from its time on, a rate from its time until the next one.  Where a rate comes without a frequency, the
    ramp goes on from where it is.

    Raises
    ------
    ValueError
        Where the participant is unknown, or no frequency of it is given.
    """
    if participant not in observations.participants:
        raise ValueError(f"there is no participant {participant!r}{nearest(participant, observations.participants)}")
    own = observations.participant == observations.participants.index(participant)
    times, frequencies = series(observations, own, "transmit_frequency")
    changes, rates = series(observations, own, "transmit_frequency_rate")
    if not len(times):
        raise ValueError(f"no frequency that {participant} transmitted is given")
    events = distinct(np.concatenate([times, changes[changes > times[0]]]))
    k = np.searchsorted(changes, events, side="right") - 1
    rate = np.where(k >= 0, rates[np.maximum(k, 0)], 0.0) if len(rates) else np.zeros(len(events))
    frequency = np.empty(len(events))
    given = np.searchsorted(times, events, side="right") - 1
    for i, (t, j) in enumerate(zip(events.tolist(), given.tolist(), strict=True)):
        goes_on = times[j] < t
        frequency[i] = frequency[i - 1] + rate[i - 1] * (t - events[i - 1]) if goes_on else frequencies[j]
    return Ramp(events, frequency, rate)


def series(observations: Observations, own: Array, kind: str) -> tuple[Array, Array]:
    """Times and values of the rows of a kind among some (J,), in order of time."""
    rows = np.flatnonzero(own & observations.of_kind(kind))
    rows = rows[np.argsort(observations.t[rows], kind="stable")]
    return observations.t[rows], observations.value[rows]
