"""Orbit Comprehensive Messages (CCSDS 502.0-B-3) in XML: their blocks, for the reader of those in KVN."""

from __future__ import annotations

from piazzi.formats.conventions import Conventions
from piazzi.formats.ephemeris import Ephemeris
from piazzi.formats.markup import Element, walk
from piazzi.formats.ndm import Item, Source
from piazzi.formats.ocm import OcmBlock, block_of, ephemeris_of

_BLOCKS = {name: name.upper() for name in ("traj", "phys", "cov", "man", "pert", "od", "user")} | {"metadata": "META"}


def read_xml(data: bytes, name: str, told: Conventions) -> Ephemeris:
    """Arcs of an OCM in XML; ValueError with file, line and reason."""
    source, header, blocks = Source(name), list[Item](), list[OcmBlock]()
    items, rows, begun = header, list[tuple[int, str]](), 0

    def begins(element: str, attributes: dict[str, str], line: int) -> None:
        nonlocal items, rows, begun
        if element == "ocm":
            header.append(Item(attributes.get("id", ""), attributes.get("version", ""), line))
        elif element in _BLOCKS:
            items, rows, begun = [], [], line

    def ends(element: Element) -> None:
        nonlocal items
        kind, text = _BLOCKS.get(element.name), " ".join(element.text.split())
        if kind is not None:
            blocks.append(block_of(source, kind, items, rows, begun))
            items = []
        elif element.name.endswith("Line"):
            rows.append((element.line, text))
        elif element.name.isupper() and element.name != "COMMENT" and text:
            items.append(Item(element.name, text, element.line, element.attributes.get("units", "")))

    walk(source, data, begins, ends)
    return ephemeris_of(source, header, blocks)
