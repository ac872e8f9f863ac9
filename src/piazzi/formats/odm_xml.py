"""Orbit messages in XML: OEM, OPM and OMM, alone or several in an NDM."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

import numpy as np

from piazzi.formats.conventions import Conventions
from piazzi.formats.ephemeris import Arc, Ephemeris, MeanElements
from piazzi.formats.markup import Element, walk
from piazzi.formats.ndm import Item, Source, known, needed, shown, single
from piazzi.formats.odm import Block, arc_of, in_si, metadata_of, one_system
from piazzi.formats.odm_keywords import ACCELERATION, COVARIANCE, HEADER, STATE
from piazzi.formats.oem import check_version, ephemeris_of
from piazzi.formats.opm import arc_of_opm, elements_of_omm, message_of

_READ = ("oem", "opm", "omm")
_OTHERS = ("ocm", "tdm", "aem", "apm", "acm", "cdm", "rdm")
_INSIDE = (
    "header", "body", "segment", "metadata", "data", "stateVector", "covarianceMatrix", "keplerianElements", "meanElements",
    "spacecraftParameters", "maneuverParameters", "tleParameters", "userDefinedParameters",
)  # fmt: skip


def read(data: bytes, name: str, told: Conventions) -> Ephemeris:
    """Arcs and mean elements of the messages of an XML file.

    Raises
    ------
    ValueError
        With file, line and reason, for a document type, and where no message of the file is of orbits.
    """
    document = _Document(Source(name))
    walk(document.source, data, document.begins, document.ends)
    if not document.arcs and not document.mean:
        others = ", ".join(sorted(document.others)) or "nothing"
        document.source.refuse(1, f"the file holds no OEM, OPM or OMM, but {others}")
    left = tuple((f"messages of kind {kind.upper()}", count) for kind, count in document.others.items())
    if document.arcs and document.kinds == {"oem"}:
        found = ephemeris_of(name, document.arcs, document.header)
    else:
        found = message_of(name, "/".join(sorted(document.kinds)).upper(), document.arcs, document.mean)
    return replace(found, left_out=left)


class _Document:
    """What the elements of orbit messages say, as they come."""

    def __init__(self, source: Source) -> None:
        self.source = source
        self.path: list[str] = []
        self.parents: list[bool] = []
        self.arcs: list[Arc] = []
        self.mean: list[MeanElements] = []
        self.others: Counter[str] = Counter()
        self.kinds: set[str] = set()
        self.header: list[Item] = []
        self.items: list[Item] = []
        self.systems: list[Item] = []
        self.seen: Counter[str] = Counter()
        self.message = ""
        self._segment()

    def _segment(self) -> None:
        self.metadata: dict[str, Item] | None = None
        self.states: list[tuple[bytes, list[float], int]] = []
        self.blocks: list[Block] = []
        self.found: list[Item] = []

    def begins(self, name: str, attributes: dict[str, str], line: int) -> None:
        if self.parents:
            self.parents[-1] = True
        self.parents.append(False)
        self.path.append(name)
        inside = self.message in _OTHERS
        if not inside and name in _READ and (len(self.path) == 1 or self.path[-2] == "ndm"):
            self.message = name
            self.kinds.add(name)
            check_version(self.source, Item("_VERS", attributes.get("version", ""), line))
            self.items, self.systems, self.seen = [], [], Counter()
        elif not inside and name in _OTHERS:
            self.message = name
            self.others[name] += 1
        elif not inside and name in _INSIDE:
            self.opens(name, line)

    def opens(self, name: str, line: int) -> None:
        """A part of a message begins."""
        if not self.message:
            self.source.refuse(line, f"{shown(name)} stands outside of a message")
        self.seen[name] += 1
        if name == "segment":
            self._segment()
            self.seen["metadata"] = 0
        elif name == "metadata" and self.seen[name] > 1:
            self.source.refuse(line, "a segment has one <metadata>, and this is the second")
        if self.message == "oem" and name in ("metadata", "stateVector", "covarianceMatrix"):
            self.found = []

    def ends(self, element: Element) -> None:
        self.path.pop()
        is_leaf = not self.parents.pop()
        name, line = element.name, element.line
        if self.message in _OTHERS:
            self.message = "" if name == self.message else self.message
            return
        if name == self.message:
            self.finish(line)
        elif is_leaf and name not in (*_INSIDE, "COMMENT", "ndm"):
            if not self.message:
                self.source.refuse(line, f"{shown(name)} stands outside of a message")
            if name == "USER_DEFINED":
                name = f"USER_DEFINED_{element.attributes.get('parameter', '')}"
            item = Item(name, element.text, line, element.attributes.get("units", ""))
            (self.found if self.message == "oem" else self.items).append(item)
        elif self.message == "oem":
            self.closes(name, line)
        elif not is_leaf and name not in (*_INSIDE, "ndm"):
            known(self.source, Item(name, "", line), _INSIDE, "an orbit message in XML")

    def closes(self, name: str, line: int) -> None:
        """A part of an OEM ends."""
        if name == "header":
            for item in self.found:
                known(self.source, item, HEADER, "the header of an OEM")
            self.header += self.found
        elif name == "metadata":
            self.metadata = metadata_of(self.source, self.found, line)
            self.systems.append(self.metadata["TIME_SYSTEM"])
            one_system(self.source, self.systems[0], self.systems[-1])
        elif name == "stateVector":
            self.states.append(self.state(line))
        elif name == "covarianceMatrix":
            self.blocks.append(self.block(line))
        elif name == "segment":
            if self.metadata is None or not self.states:
                self.source.refuse(line, f"the segment has no {'states' if self.metadata else 'metadata'}")
            dates, numbers, lines = zip(*self.states, strict=True)
            columns = np.array(dates), np.array(numbers), np.array(lines)
            self.arcs.append(arc_of(self.source, self.metadata, *columns, self.blocks))
        self.found = []

    def state(self, line: int) -> tuple[bytes, list[float], int]:
        found = self.part(("EPOCH", *STATE, *ACCELERATION), ("EPOCH", *STATE), "a state", line)
        units = dict.fromkeys(STATE[:3], "km") | dict.fromkeys(STATE[3:], "km/s") | dict.fromkeys(ACCELERATION, "km/s**2")
        values = self.numbers(found, units)
        text = found["EPOCH"].text.encode("utf-8", "replace")
        return text if 0 < len(text) <= 64 else b"\xff", values, line

    def numbers(self, found: dict[str, Item], units: dict[str, str]) -> list[float]:
        """Numbers in km and s, NaN where there is none."""
        out = []
        for keyword, unit in units.items():
            item = found.get(keyword)
            if item is None:
                out.append(np.nan)
            elif item.unit and item.unit != unit:
                out.append(in_si(self.source, item, unit) / 1e3)
            else:
                out.append(self.source.number(item))
        return out

    def block(self, line: int) -> Block:
        found = self.part(("EPOCH", "COV_REF_FRAME", *COVARIANCE), ("EPOCH", *COVARIANCE), "a covariance", line)
        frame = found["COV_REF_FRAME"].text if "COV_REF_FRAME" in found else ""
        return Block(found["EPOCH"].text, frame, [self.source.number(found[keyword]) for keyword in COVARIANCE], line)

    def part(self, keywords: tuple[str, ...], required: tuple[str, ...], what: str, line: int) -> dict[str, Item]:
        for item in self.found:
            known(self.source, item, keywords, what)
        found = single(self.source, self.found, what)
        needed(self.source, found, required, what, line)
        return found

    def finish(self, line: int) -> None:
        """A message ends."""
        if self.message == "opm":
            self.arcs.append(arc_of_opm(self.source, self.items, line))
        elif self.message == "omm":
            self.mean.append(elements_of_omm(self.source, self.items, line))
        self.message = ""
