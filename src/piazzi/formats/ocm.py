"""Orbit Comprehensive Messages (CCSDS 502.0-B-3) as text (KVN): trajectories of positions, covariances, how both were found."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from piazzi.arrays import Array
from piazzi.earth import Epoch
from piazzi.formats.conventions import Conventions
from piazzi.formats.ephemeris import Arc, Ephemeris
from piazzi.formats.frames import frame_named
from piazzi.formats.ndm import Item, Source, key_value, lines_of, needed, shown, single
from piazzi.formats.odm import centre_named, in_si, unknown_axes

_MARK = re.compile(r"(META|TRAJ|PHYS|COV|MAN|PERT|OD|USER)_(START|STOP)")
_STATES = {"CARTP": 3, "CARTPV": 6, "CARTPVA": 9}
_COLUMNS = ("km",) * 3 + ("km/s",) * 3 + ("km/s**2",) * 3
_SPACECRAFT = {
    "WET_MASS": ("mass", "kg"), "DRAG_CONST_AREA": ("drag_area", "m**2"), "DRAG_COEFF_NOM": ("drag_coefficient", ""),
    "SRP_CONST_AREA": ("radiation_area", "m**2"), "SOLAR_RAD_COEFF": ("radiation_coefficient", ""),
}  # fmt: skip
FIRST, LAST = "DAYS_SINCE_FIRST_OBS", "DAYS_SINCE_LAST_OBS"


class OcmBlock(NamedTuple):
    """A block of a message: its kind, its keywords, its other lines with their numbers, and the line where it begins."""

    kind: str
    found: dict[str, Item]
    rows: list[tuple[int, str]]
    line: int

    def word(self, keyword: str, usual: str) -> str:
        """The text of a keyword, or what it is where the message does not say it."""
        return self.found[keyword].text if keyword in self.found else usual


class _Clock(NamedTuple):
    """How a message tells time: its scale, and the instant of its zero."""

    source: Source
    scale: str
    zero: Epoch | None

    def __call__(self, text: str, line: int) -> Epoch:
        """A date, or seconds past the zero of the message."""
        if re.fullmatch(r"[+-]?\d*\.?\d+([eE][+-]?\d+)?", text, re.ASCII):
            if self.zero is None:
                self.source.refuse(line, f"{shown(text)} is in seconds past EPOCH_TZERO, which the message has not")
            return self.zero + float(text)
        return self.source.date(Item("the time", text, line), self.scale)


def read(data: bytes, name: str, told: Conventions) -> Ephemeris:
    """Arcs of an OCM in KVN, one for each trajectory of positions; those of elements are left out and counted.

    Raises
    ------
    ValueError
        With file, line and reason.
    """
    source = Source(name)
    return ephemeris_of(source, *_blocks(source, data))


def ephemeris_of(source: Source, header: Sequence[Item], blocks: Sequence[OcmBlock]) -> Ephemeris:
    """Arcs of a message; ValueError as `read`."""
    if not header or header[0].keyword != "CCSDS_OCM_VERS" or header[0].text not in ("3.0", "3"):
        source.refuse(1, "the version of the OCM is not 3.0, which is read")
    meta = next((block for block in blocks if block.kind == "META"), None)
    if meta is None:
        source.refuse(1, "the message has no metadata (META_START)")
    needed(source, meta.found, ("TIME_SYSTEM", "EPOCH_TZERO"), "the metadata", meta.line)
    scale = source.scale(meta.found["TIME_SYSTEM"])
    clock = _Clock(source, scale, source.date(meta.found["EPOCH_TZERO"], scale))
    ways = [block for block in blocks if block.kind == "TRAJ"]
    read_ = [block for block in ways if block.word("TRAJ_TYPE", "").upper() in _STATES]
    if not read_:
        kinds = ", ".join(sorted({block.word("TRAJ_TYPE", "nothing") for block in ways})) or "none"
        source.refuse(meta.line, f"trajectories of positions (CARTP, CARTPV, CARTPVA) are read; there is {shown(kinds)}")
    said = tuple((item.keyword, item.text) for block in blocks if block.kind in ("META", "OD") for item in block.found.values())
    craft = tuple(
        (ours, in_si(source, block.found[key], unit))
        for block in blocks if block.kind == "PHYS"
        for key, (ours, unit) in _SPACECRAFT.items() if key in block.found
    )  # fmt: skip
    arcs = [_arc(block, clock, meta, said, craft) for block in read_]
    spreads = [one for block in blocks if block.kind == "COV" for one in _covariances(source, block, clock)]
    arcs = [_with(arc, [one for one in spreads if _nearest(arcs, one[0]) == k]) for k, arc in enumerate(arcs)]
    frames = [frame for arc in arcs for frame in (arc.frame, *arc.covariance_frames)]
    scaled = any({"COV_SCALE_MIN", "COV_SCALE_MAX"} & {*block.found} for block in blocks)
    left = len(ways) - len(read_)
    return Ephemeris(
        arcs=tuple(arcs), file=source.name, format="OCM", said=tuple((item.keyword, item.text) for item in header),
        assumed=("COV_SCALE_MIN and COV_SCALE_MAX are not applied to covariances",) if scaled else (),
        open=unknown_axes(frames), left_out=(("trajectories of elements", left),) if left else (),
    )  # fmt: skip


def used_by(arc: Arc) -> tuple[Epoch, Epoch] | None:
    """First and last measurement that the orbit of a message was determined from, None where it does not say them."""
    said = dict(arc.said)
    try:
        end = Epoch(said["OD_EPOCH"], arc.scale)
        first, last = (end + -86400.0 * float(said[keyword]) for keyword in (FIRST, LAST))
    except (KeyError, ValueError):
        return None
    return first, last


def _blocks(source: Source, data: bytes) -> tuple[list[Item], list[OcmBlock]]:
    """The items of the header, and all blocks."""
    header, blocks = list[Item](), list[OcmBlock]()
    items, rows, kind, begun = header, list[tuple[int, str]](), "", 0
    for number, raw in enumerate(lines_of(data), start=1):
        text = raw.strip()
        mark = _MARK.fullmatch(text)
        if mark is not None:
            if (mark[2] == "START") == bool(kind) or (mark[2] == "STOP" and mark[1] != kind):
                source.refuse(number, f"{text} stands {f'in the block of line {begun}' if kind else 'where no block begins'}")
            if mark[2] == "STOP":
                blocks.append(block_of(source, kind, items, rows, begun))
            items, rows, kind, begun = [], [], mark[1] if mark[2] == "START" else "", number
        elif "=" in text and not text.startswith("COMMENT"):
            item = key_value(source, text, number)
            if item is not None:
                items.append(item)
        elif text and not re.match(r"COMMENT(\s|$)", text):
            if kind not in ("TRAJ", "COV", "MAN", "USER"):
                source.refuse(number, f"{shown(text)} is no line of the form KEYWORD = value")
            rows.append((number, text))
    if kind:
        source.refuse(begun, f"the block {kind} does not end with {kind}_STOP")
    return header, blocks


def block_of(source: Source, kind: str, items: Sequence[Item], rows: list[tuple[int, str]], line: int) -> OcmBlock:
    """A block with its items by keyword; those of physics and of users may come again."""
    if kind in ("META", "TRAJ", "COV", "OD"):
        return OcmBlock(kind, single(source, items, f"a block {kind}"), rows, line)
    return OcmBlock(kind, {item.keyword: item for item in items}, rows, line)


def _arc(block: OcmBlock, clock: _Clock, meta: OcmBlock, said: Any, craft: Any) -> Arc:
    source, kind = clock.source, block.word("TRAJ_TYPE", "").upper()
    width = _STATES[kind]
    rows = [(number, text.split()) for number, text in block.rows]
    if not rows:
        source.refuse(block.line, "the trajectory has no states")
    for number, words in rows:
        if len(words) != width + 1:
            source.refuse(number, f"a state of {kind} is a date and {width} numbers, not {len(words) - 1}")
    factors = _factors(source, block, "TRAJ_UNITS", _COLUMNS[:width])
    numbers = np.array([[source.number(Item("the state", w, number)) for w in words[1:]] for number, words in rows]) * factors
    dates = [clock(words[0], number) for number, words in rows]
    t = np.array([date - dates[0] for date in dates])
    back = np.flatnonzero(np.diff(t) < 0)
    if len(back):
        source.refuse(rows[back[0] + 1][0], "the state is before the one above it: those of a trajectory go with time")
    optional: dict[str, Any] = {"velocity": numbers[:, 3:6]} if width > 3 else {}
    if width > 6:
        optional["acceleration"] = numbers[:, 6:]
    if "TRAJ_FRAME_EPOCH" in block.found:
        optional["frame_epoch"] = source.date(block.found["TRAJ_FRAME_EPOCH"], clock.scale)
    return Arc(
        epoch=dates[0], t=t, position=numbers[:, :3], name=meta.word("OBJECT_NAME", ""), scale=clock.scale,
        identifier=meta.word("INTERNATIONAL_DESIGNATOR", ""), centre=centre_named(block.word("CENTER_NAME", "EARTH")),
        frame=_axes(block.word("TRAJ_REF_FRAME", "ICRF3")), lines=np.array([number for number, _ in rows]), spacecraft=craft,
        interpolation=block.found["INTERPOLATION"].text.lower() if "INTERPOLATION" in block.found else None,
        degree=source.whole(block.found["INTERPOLATION_DEGREE"]) if "INTERPOLATION_DEGREE" in block.found else None,
        said=said, **optional,
    )  # fmt: skip


def _axes(text: str) -> str:
    """Axes by our names: the registry has ICRF3 for the ICRF, and RSW_INERTIAL for axes of the instant."""
    name = re.sub(r"_INERTIAL$", "", text.strip().upper())
    return "ICRF" if re.fullmatch(r"ICRF\d?", name) else frame_named(name)


def _covariances(source: Source, block: OcmBlock, clock: _Clock) -> Iterator[tuple[Epoch, Array, str]]:
    """Date, covariance (6, 6) and axes of each row of a block, of positions and velocities; others are passed over."""
    kind, order = block.word("COV_TYPE", "CARTPV").upper(), block.word("COV_ORDERING", "LTM").upper()
    if kind not in ("CARTPV", "CARTPVA"):
        return
    n, frame = _STATES[kind], _axes(block.word("COV_REF_FRAME", "TNW_INERTIAL"))
    places = {"LTM": np.tril_indices(n), "UTM": np.triu_indices(n)}.get(order, tuple(np.indices((n, n)).reshape(2, -1)))
    if order not in ("LTM", "UTM", "FULL", "LTMWCC", "UTMWCC"):
        source.refuse(block.line, f"COV_ORDERING is {shown(order)}; it must be LTM, UTM, FULL, LTMWCC or UTMWCC")
    factors = _factors(source, block, "COV_UNITS", _COLUMNS[:n], 2)
    for number, text in block.rows:
        words = text.split()
        if len(words) != len(places[0]) + 1:
            source.refuse(number, f"a covariance of {kind}, {order}, is a date and {len(places[0])} numbers")
        P = np.zeros((n, n))
        P[places] = [source.number(Item("the covariance", word, number)) for word in words[1:]]
        half = np.triu(P) if order.startswith("UTM") else np.tril(P)  # the other half repeats it, or holds correlations
        P = half + half.T - np.diag(np.diag(half))
        yield clock(words[0], number), (P * np.outer(factors, factors))[:6, :6], frame


def _factors(source: Source, block: OcmBlock, keyword: str, usual: Sequence[str], power: int = 1) -> Array:
    """Factors (n,) of columns to SI, by the units that a block states or those of the standard.

    Units of covariances are of its diagonal, such as km**2; `power` is 2 there.
    """
    item = block.found.get(keyword)
    text = re.sub(r"^\[|\]$", "", f"{item.text}{f'[{item.unit}]' if item.unit else ''}".strip()) if item else ""
    said = [unit.strip() for unit in text.split(",")] if text else list(usual)
    if item is not None and len(said) < len(usual):
        source.refuse(item.line, f"{keyword} has {len(said)} units for {len(usual)} columns")
    line = item.line if item else block.line
    one = [unit if item is None or power == 1 else re.sub(r"^(km|m)\*\*2(/s\*\*(\d))?$", _rooted, unit) for unit in said]
    return np.array([
        in_si(source, Item(keyword, "1", line, unit), own) for unit, own in zip(one, usual, strict=False)
    ])  # fmt: skip


def _rooted(match: re.Match[str]) -> str:
    """The square root of a unit of a variance."""
    seconds = {None: "", "2": "/s", "4": "/s**2"}.get(match[3])
    return match[0] if seconds is None else f"{match[1]}{seconds}"


def _nearest(arcs: Sequence[Arc], when: Epoch) -> int:
    """Index of the arc that a date is in, or nearest to."""
    away = [max(-(t := when - arc.epoch), t - float(arc.t[-1]), 0.0) for arc in arcs]
    return int(np.argmin(away))


def _with(arc: Arc, spreads: Sequence[tuple[Epoch, Array, str]]) -> Arc:
    """The arc with covariances."""
    if not spreads:
        return arc
    return replace(
        arc, covariance_t=np.array([when - arc.epoch for when, _, _ in spreads]),
        covariance=np.array([P for _, P, _ in spreads]), covariance_frames=tuple(frame for _, _, frame in spreads),
    )  # fmt: skip
