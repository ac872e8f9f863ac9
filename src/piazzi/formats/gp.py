"""Mean elements as catalogues publish them beside two-line elements: the keywords of OMM as JSON, or as a table (CSV).

What such files leave out is what SGP4 is of: elements about the Earth in TEME, dates in UTC.
"""

from __future__ import annotations

import csv
import json
from collections.abc import Iterator, Mapping

from piazzi.formats.conventions import Conventions
from piazzi.formats.ephemeris import Ephemeris
from piazzi.formats.ndm import Item, Source, lines_of
from piazzi.formats.odm_keywords import OMM
from piazzi.formats.opm import elements_of_omm, message_of

_SILENT = {"CENTER_NAME": "EARTH", "REF_FRAME": "TEME", "TIME_SYSTEM": "UTC", "MEAN_ELEMENT_THEORY": "SGP4"}


def read_json(data: bytes, name: str, told: Conventions) -> Ephemeris:
    """The sets of one JSON object, or of a list of them; ValueError with file, line and reason."""
    source = Source(name)
    return _message(source, _objects(source, data.decode("utf-8", "replace").removeprefix("\ufeff")))


def read_csv(data: bytes, name: str, told: Conventions) -> Ephemeris:
    """The sets of a table whose header has the keywords; ValueError with file, line and reason."""
    source = Source(name)
    return _message(source, _rows(source, lines_of(data)))


def _objects(source: Source, text: str) -> Iterator[tuple[int, Mapping[str, object]]]:
    """Each object and the line in which it begins."""
    decoder, at, line, before = json.JSONDecoder(), text.find("{"), 1, 0
    while at >= 0:
        line, before = line + text.count("\n", before, at), at
        try:
            found, end = decoder.raw_decode(text, at)
        except (ValueError, RecursionError) as error:
            source.refuse(getattr(error, "lineno", line), f"it is no JSON: {getattr(error, 'msg', error)}")
        yield line, found
        at = text.find("{", end)


def _rows(source: Source, lines: list[str]) -> Iterator[tuple[int, Mapping[str, object]]]:
    rows = csv.reader(line + "\n" for line in lines)
    header: list[str] = []
    for row in rows:
        if not header:
            header = [cell.strip() for cell in row]
        elif row and len(row) != len(header):
            source.refuse(rows.line_num, f"the line has {len(row)} cells; the header names {len(header)}")
        elif row:
            yield rows.line_num, dict(zip(header, row, strict=True))


def _message(source: Source, found: Iterator[tuple[int, Mapping[str, object]]]) -> Ephemeris:
    sets, silent = [], False
    for line, record in found:
        given = {key.upper(): str(value).strip() for key, value in record.items() if value is not None}
        given = {key: value for key, value in given.items() if key in OMM and value}
        silent |= not _SILENT.keys() <= given.keys()
        items = [Item(key, value, line) for key, value in (_SILENT | given).items()]
        sets.append(elements_of_omm(source, items, line))
    if not sets:
        source.refuse(1, "there are no elements in it")
    message = message_of(source.name, "OMM", [], sets)
    said = ("elements are of SGP4 about the Earth, in TEME, with dates in UTC",) if silent else ()
    return Ephemeris(arcs=(), mean=message.mean, file=message.file, format=message.format, assumed=said, open=message.open)
