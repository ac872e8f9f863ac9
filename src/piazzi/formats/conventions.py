"""What a user says about files that do not say it themselves."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from piazzi.arrays import Array
from piazzi.earth.scales import SCALES
from piazzi.formats.frames import KNOWN, frame_named, settled
from piazzi.formats.kinds import ANGLES, KINDS, TAGS
from piazzi.formats.observations import Observations, Segment
from piazzi.formats.range_units import in_metres, range_unit_of
from piazzi.tables.names import parse_columns
from piazzi.text import brief, nearest, suggest
from piazzi.units import Units

RANGES = {"one-way": ("one-way", "sum"), "two-way": ("two-way", "half"), "round-trip": ("two-way", "sum")}
RANGES |= {"three-way": ("three-way", "sum")}
WORDS: Mapping[str, Iterable[str]] = {
    "range": RANGES, "angles": ANGLES, "tag": TAGS[1:], "corrections": ("applied", "open"),
    "interval_reference": ("start", "middle", "end"),
}  # fmt: skip
_OPTION = re.compile(r"--[a-z-]+")
_SIGMA = re.compile(r"(?:(?P<kind>[a-z_]+)(?:\.(?P<station>[^=]+))?=)?(?P<number>[-+.0-9eE]+)\s*(?P<unit>[a-zA-Z/*^0-9]*)")


@dataclass(frozen=True)
class Sigma:
    """A standard deviation in SI for rows of these kinds and of a station (None: of all)."""

    kinds: tuple[str, ...]
    station: str | None
    value: float


@dataclass(frozen=True)
class Conventions:
    """Answers to what files leave open; they never override what a file says.

    Attributes
    ----------
    range : ``one-way``, ``two-way`` (half of the way there and back), ``round-trip`` (all of it) or ``three-way``
    angles : ``astrometric``, ``geocentric`` or ``apparent``
    tag : ``transmit``, ``bounce`` or ``receive``, what the times of rows are
    frame : axes of directions and fixes
    corrections : ``applied``, or ``open`` where they are still to be applied
    interval, interval_reference : s over which rates are averaged, and the part of it that times are of
    scales : time scale by station, that of all others under ""
    range_units : m, by station, that of all others under ""
    sigmas : standard deviations
    columns : of tables, our names and those of the file
    options : whatever else one format asks for, by name
    partial : whether they are told of more than what is read, so that a station need not be there
    """

    range: str | None = None
    angles: str | None = None
    tag: str | None = None
    frame: str | None = None
    corrections: str | None = None
    interval: float | None = None
    interval_reference: str | None = None
    scales: tuple[tuple[str, str], ...] = ()
    range_units: tuple[tuple[str, float], ...] = ()
    sigmas: tuple[Sigma, ...] = ()
    columns: tuple[tuple[str, str], ...] = ()
    options: tuple[tuple[str, Any], ...] = ()
    partial: bool = False

    __repr__ = brief

    @classmethod
    def of(
        cls,
        *,
        time: Any = None,
        scale: Any = None,
        sigma: Any = None,
        interval: Any = None,
        columns: Any = None,
        range_unit: Any = None,
        **words: Any,
    ) -> Conventions:
        """Conventions from words, as the command line and `read_tracking` take them; `scale` is `time` of all stations.

        Raises
        ------
        ValueError
            For a word that is none of those, with the nearest.
        """
        chosen: dict[str, Any] = {name: _word(name, words.pop(name, None)) for name in WORDS}
        frame = words.pop("frame", None)
        if frame is not None and (frame := frame_named(str(frame))) not in KNOWN:
            raise ValueError(f"axes {frame!r} are none of {', '.join(KNOWN)}{suggest(frame, KNOWN)}")
        scales = tuple(_scale(text) for text in (*_texts(time), *_texts(scale)))
        names = parse_columns(columns) if isinstance(columns, str) else columns or {}
        if words.get("repair") not in (None, "exponent"):
            raise ValueError(f"--repair {words['repair']!r} is not known; exponent is")
        named = {ours: theirs if isinstance(theirs, str) else ",".join(map(str, theirs)) for ours, theirs in names.items()}
        sigmas = tuple(_sigma(text) for text in _texts(sigma))
        seconds = None if interval is None else float(interval)
        if seconds is not None and not 0 < seconds < np.inf:
            raise ValueError(f"an interval is a positive number of seconds, not {interval!r}")
        return cls(
            **chosen,
            frame=frame,
            interval=seconds,
            scales=scales,
            range_units=tuple(range_unit_of(text) for text in _texts(range_unit)),
            sigmas=sigmas,
            columns=tuple(named.items()),
            options=tuple(words.items()),
        )

    def scale_of(self, station: str) -> str | None:
        """The time scale that the user says a station's dates are in."""
        told = dict(self.scales)
        return told.get(station, told.get(""))

    def option(self, name: str) -> Any:
        """What else was said, None where it was not."""
        return dict(self.options).get(name)


def _word(name: str, word: Any) -> str | None:
    if word is not None and word not in WORDS[name]:
        what = name.replace("_", "-")
        raise ValueError(f"--{what} is one of {', '.join(WORDS[name])}, not {word!r}{suggest(str(word), WORDS[name])}")
    return None if word is None else str(word)


def _texts(given: Any) -> list[str]:
    """One text, several, or a mapping from what to what, as a list of ``what=value``."""
    if given is None:
        return []
    if isinstance(given, str):
        return [given]
    if isinstance(given, Mapping):
        return [f"{name}={value}" if name else str(value) for name, value in given.items()]
    return [str(text) for text in given] if isinstance(given, Iterable) else [str(given)]


def _scale(text: str) -> tuple[str, str]:
    station, equals, scale = text.rpartition("=")
    if scale.upper() not in SCALES:
        raise ValueError(f"{scale!r} is no time scale; there are {', '.join(SCALES)}, as in time=GPS or time=BER=GPS")
    return (station if equals else "", scale.upper())


def _sigma(text: str) -> Sigma:
    match = _SIGMA.fullmatch(text.strip())
    if match is None:
        raise ValueError(f"sigma {text!r} cannot be read: write it as range.BER=10m, range_rate=1mm/s or 10m")
    kind, unit = match["kind"], Units().unit(match["unit"] or "1")
    if kind is not None and kind not in KINDS:
        raise ValueError(f"sigma {text!r}: {kind!r} is no kind of measurement{nearest(kind, KINDS)}")
    try:
        value = float(match["number"]) * unit.factor
    except ValueError:
        raise ValueError(f"sigma {text!r}: {match['number']!r} is no number") from None
    if not (np.isfinite(value) and value > 0):
        raise ValueError(f"sigma {text!r} must be positive")
    kinds = tuple(name for name in KINDS if not KINDS[name].auxiliary and _powers(name) == unit.powers)
    if not kinds or (kind is not None and kind not in kinds):
        right = f"{kind}=1{KINDS[kind].unit}" if kind else "range=10m"
        size = match["number"] + (match["unit"] or " without a unit")
        raise ValueError(f"sigma {text!r}: {size} is no sigma of {kind or 'any measurement'}: write it as {right}")
    return Sigma((kind,) if kind else kinds, match["station"], value)


def _powers(kind: str) -> tuple[Any, ...] | None:
    """Exponents of a kind's unit, None for units that only the kind itself has."""
    try:
        return Units().unit(KINDS[kind].unit.replace("cycle", "1")).powers
    except ValueError:
        return None


def with_conventions(observations: Observations, told: Conventions) -> Observations:
    """Observations with what the user says where their files do not, and `open` without what is now said.

    Raises
    ------
    ValueError
        For a sigma that no row takes.
    """
    observations = in_metres(observations, dict(told.range_units), told.partial)
    segments = tuple(_completed(segment, told) for segment in observations.segments)
    sigma = _sigmas(observations, told)
    all_known = bool(told.sigmas) and not np.isnan(sigma[observations.measured]).any()
    answered = {f"--{name.replace('_', '-')}" for name in (*WORDS, "frame", "interval") if getattr(told, name) is not None}
    answered |= {"--sigma"} if all_known else set()
    left = tuple(text for text in observations.open if answered.isdisjoint(_OPTION.findall(text)))
    return replace(observations, segments=segments, open=left, sigma=sigma, tag=_tags(observations, told))


def without_effect(rows: Observations, told: Conventions) -> list[str]:
    """Options that `with_conventions` makes no difference by: the files say it, or have nothing that it is of."""
    found, nothing, out = with_conventions(rows, told), Conventions(), []
    options = {name: name.replace("_", "-") for name in (*WORDS, "frame", "interval")}
    for name, option in {**options, "range_units": "range-unit", "sigmas": "sigma"}.items():
        if getattr(told, name) == getattr(nothing, name):
            continue
        left = with_conventions(rows, replace(told, partial=True, **{name: getattr(nothing, name)}))
        columns = ((left.sigma, found.sigma), (left.tag, found.tag), (left.value, found.value))
        if left.segments == found.segments and all(np.array_equal(a, b, equal_nan=True) for a, b in columns):
            out.append(f"--{option}")
    return out


def with_usual_sigmas(observations: Observations, told: Conventions, usual: Array | float, what: str) -> Observations:
    """Observations with the standard deviations that are usual for their format, where neither file nor user says any.

    `usual` is of each row, NaN where there is no such custom; `what` is listed as assumed where one was taken.
    """
    rows = np.isnan(observations.sigma) & np.isfinite(usual)
    for rule in told.sigmas:
        rows &= ~_covered(observations, rule)
    if not rows.any():
        return observations
    sigma = np.asarray(usual) if rows.all() else np.where(rows, usual, observations.sigma)
    return replace(observations, sigma=sigma, assumed=(*observations.assumed, what))


def _covered(observations: Observations, rule: Sigma) -> Array:
    """(J,) mask of the rows that a sigma of the user's is meant for."""
    rows = observations.of_kind(*rule.kinds)
    if rule.station is not None:
        named = rule.station in observations.participants
        rows = rows & (observations.station == observations.participants.index(rule.station)) if named else rows & False
    return rows


def _completed(segment: Segment, told: Conventions) -> Segment:
    """A segment with what is said of it where it says nothing."""
    new: dict[str, Any] = {
        name: getattr(told, name)
        for name in ("angles", "tag", "interval", "interval_reference")
        if getattr(segment, name) is None and getattr(told, name) is not None
    }
    new["frame"] = settled(segment.frame, told.frame)
    if told.range is not None:
        way, range_is = RANGES[told.range]
        new |= {"way": segment.way or way, "range_is": segment.range_is or range_is}
    if told.corrections is not None:
        applied = told.corrections == "applied"
        new["corrections"] = tuple(c if c.applied is not None else c._replace(applied=applied) for c in segment.corrections)
    return replace(segment, **new)


def _tags(observations: Observations, told: Conventions) -> Array:
    """What the times of rows are, with the user's word for segments that do not say it."""
    silent = np.array([segment.tag is None for segment in observations.segments], dtype=np.bool_)
    if told.tag is None or not silent.any():
        return observations.tag
    return np.where(silent[observations.segment], np.int8(TAGS.index(told.tag)), observations.tag)


def _sigmas(observations: Observations, told: Conventions) -> Array:
    """Sigmas of the files, and of the user where they have none; what says more (kind, station) goes before what says less."""
    sigma = observations.sigma
    if not told.sigmas:
        return sigma
    sigma = sigma.copy()
    missing = np.isnan(sigma)
    for rule in sorted(told.sigmas, key=lambda rule: (rule.station is not None, len(rule.kinds) == 1)):
        rows = missing & observations.of_kind(*rule.kinds)
        if rule.station is not None:
            if rule.station not in observations.participants:
                if told.partial:
                    continue
                raise ValueError(f"sigma for {rule.station!r}: no such station{nearest(rule.station, observations.stations)}")
            rows = rows & (observations.station == observations.participants.index(rule.station))
        sigma[rows] = rule.value
    return sigma
