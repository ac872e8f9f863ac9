"""Corrections that files state and leave to their reader: added where they are numbers, else refused by name."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from piazzi.arrays import distinct
from piazzi.determination.sites import matched
from piazzi.earth import StationList
from piazzi.earth.constants import SPEED_OF_LIGHT
from piazzi.formats import TAGS, Observations, Segment
from piazzi.formats.corrections import ADDED, corrected
from piazzi.formats.ramps import series

DELAY = "station delay"
TIMED = ("transmit", "receive")
COMPARED = ("delta_range_delay", "vlbi_delay")  # kinds that compare the clocks of two stations


def with_corrections(observations: Observations, sites: StationList | None) -> tuple[Observations, tuple[str, ...]]:
    """The rows with the numbers added that their files give and say are not applied, and what was added.

    Parameters
    ----------
    observations : as they were read
    sites : stations, whose known bias of range may be the delay that a file gives no number for

    Raises
    ------
    ValueError
        For a correction that is not applied, and can neither be added nor modelled.
    """
    where = f"{observations.files[0]}: " if observations.files else ""
    for segment in observations.segments:
        if (station := _delayed(segment)) and not _known(station, sites):
            raise ValueError(
                f"{where}ranges of {station} have the delay of the station in them, and the file has no number for it: "
                "give it as its bias of range, in --stations FILE.toml"
            )
    try:
        done, clocks = _by_clocks(corrected(observations))
    except ValueError as error:
        raise ValueError(f"{where}{error}") from None
    done, delays = _without_delays(done)
    waiting = [(c.name, c.value) for s in observations.segments for c in s.corrections if c.applied is False and c.value]
    names = dict.fromkeys(name for name, _ in waiting if name in ADDED)
    added = [f"the correction of {name} that the file states is added: it is not applied there" for name in names]
    return done, (*added, *clocks, *delays)


def _by_clocks(observations: Observations) -> tuple[Observations, tuple[str, ...]]:
    """Times of rows by clocks that are right, where the file says by how much those of the stations are ahead.

    A bias goes on from its time with the last drift that was given, as far as the next one, or linearly where there is none.
    """
    t, said = observations.t.copy(), []
    for station in distinct(observations.station[observations.of_kind("clock_bias")]).tolist():
        own = observations.station == station
        times, biases = series(observations, own, "clock_bias")
        changes, drifts = series(observations, own, "clock_drift")
        rows = own & observations.measured
        _check_clock(observations, station)
        if not rows.any():
            continue
        ahead = np.interp(observations.t[rows], times, biases)
        if len(changes):
            k = np.maximum(np.searchsorted(times, observations.t[rows], side="right") - 1, 0)
            d = np.maximum(np.searchsorted(changes, observations.t[rows], side="right") - 1, 0)
            ahead = biases[k] + drifts[d] * (observations.t[rows] - times[k])
        t[rows] -= ahead
        name = observations.participants[station]
        said.append(f"times of {name} are less its clock's bias, {ahead.mean():.3g} s, which the file states")
    return (replace(observations, t=t), tuple(said)) if said else (observations, ())


def _check_clock(observations: Observations, station: int) -> None:
    """Raise ValueError where a clock that is not right is in values, not in times alone: two clocks were compared."""
    name = observations.participants[station]
    for i, segment in enumerate(observations.segments):
        rows = (observations.segment == i) & observations.measured
        own = rows & (observations.station == station)
        ranges = (own & observations.of_kind("range")).any() and segment.way in ("one-way", "three-way")
        delays = any((rows & observations.of_kind(kind)).any() for kind in COMPARED)
        involved = own.any() or name in ((segment.path or ()) + (segment.second_path or ()))
        if ranges or (delays and involved):
            what = "delays between stations" if delays else f"{segment.way} ranges"
            raise ValueError(
                f"{what} have the clock of {name} in them, whose bias the file states: they are not corrected for it yet"
            )


def _without_delays(observations: Observations) -> tuple[Observations, tuple[str, ...]]:
    """Ranges without the delays of participants that the file states, and times of when signals pass the antennas."""
    t, value, said = observations.t.copy(), observations.value.copy(), []
    for i, segment in enumerate(observations.segments):
        delays = dict(segment.delays)
        path = segment.path or ()
        if not any(delays.values()) or not path:
            continue
        rows = (observations.segment == i) & observations.measured
        sends, receives = delays.get(f"transmit {path[0]}", 0.0), delays.get(f"receive {path[-1]}", 0.0)
        within = sum(delays.get(f"{event} {name}", 0.0) for name in path[1:-1] for event in TIMED)
        total = sends + receives + within
        legs = 1.0 if segment.range_is == "sum" or len(path) == 2 else 0.5
        for kind, factor in (("range", legs * SPEED_OF_LIGHT), ("time_of_flight", 1.0)):
            value[rows & observations.of_kind(kind)] -= factor * total
        tags = np.array([TAGS[tag] for tag in observations.tag[rows]])
        t[rows] += np.where(tags == "transmit", sends, np.where(tags == "receive", -receives, 0.0))
        said.append(f"delays of {', '.join(path)} that the file states, {total:.3g} s together, are taken off ranges and times")
    return (replace(observations, t=t, value=value), tuple(dict.fromkeys(said))) if said else (observations, ())


def _delayed(segment: Segment) -> str:
    """The station whose delay is in a segment without a number, "" for none."""
    left = any(c.name == DELAY and c.applied is False and c.value is None for c in segment.corrections)
    return segment.participants[0] if left and segment.participants else ""


def _known(station: str, sites: StationList | None) -> bool:
    site = None if sites is None else matched(station, sites)
    return site is not None and "range" in site.bias
