"""Corrections that files state and leave to their reader: added where they are numbers, else refused by name."""

from __future__ import annotations

from piazzi.determination.sites import matched
from piazzi.earth import StationList
from piazzi.formats import Observations, Segment
from piazzi.formats.corrections import ADDED, corrected

DELAY = "station delay"


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
        done = corrected(observations)
    except ValueError as error:
        raise ValueError(f"{where}{error}") from None
    waiting = [(c.name, c.value) for s in observations.segments for c in s.corrections if c.applied is False and c.value]
    names = dict.fromkeys(name for name, _ in waiting if name in ADDED)
    return done, tuple(f"the correction of {name} that the file states is added: it is not applied there" for name in names)


def _delayed(segment: Segment) -> str:
    """The station whose delay is in a segment without a number, "" for none."""
    left = any(c.name == DELAY and c.applied is False and c.value is None for c in segment.corrections)
    return segment.participants[0] if left and segment.participants else ""


def _known(station: str, sites: StationList | None) -> bool:
    site = None if sites is None else matched(station, sites)
    return site is not None and "range" in site.bias
