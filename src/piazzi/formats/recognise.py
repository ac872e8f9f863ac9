"""The door of files: their format by what is in them, never by what they are called."""

from __future__ import annotations

import logging
import os
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace
from importlib import import_module
from typing import Any, NamedTuple

import numpy as np

from piazzi.formats import table_header
from piazzi.formats.conventions import Conventions, with_conventions, without_effect
from piazzi.formats.ephemeris import Ephemeris
from piazzi.formats.frames import settled
from piazzi.formats.observations import Observations
from piazzi.formats.source import read_bytes
from piazzi.opening import told_path

_log = logging.getLogger(__name__)
HEAD = 4096  # bytes that a format is told by


class Format(NamedTuple):
    """How a format is told by a file's first bytes, and who reads it: ``module:function`` below `piazzi.formats`.

    A reader takes the bytes, the name for messages and the `Conventions`, and raises ValueError with name, line and reason.
    """

    looks: Callable[[bytes], bool]
    tracking: str | None = None
    ephemeris: str | None = None


_REMARKS = rb"(?:00[^\n]*\n)*"  # of the laser formats


def _begins(pattern: bytes) -> Callable[[bytes], bool]:
    """Whether the first line with anything in it, past comments, is like that."""
    compiled = re.compile(rb"(?:\xef\xbb\xbf)?(?:\s|COMMENT[^\n]*\n)*" + pattern)
    return lambda head: compiled.match(head) is not None


def _root(element: bytes) -> Callable[[bytes], bool]:
    """Whether the first element of an XML file has that name."""
    compiled = re.compile(rb"(?:\xef\xbb\xbf)?(?>\s+|<\?.*?\?>|<!--.*?-->)*+<(?:\w+:)?" + element + rb"[\s/>]", re.S)
    return lambda head: compiled.match(head) is not None


def _in_columns(pattern: bytes) -> Callable[[bytes], bool]:
    """Whether the first line with anything in it, past the headers of a report of astrometry, is like that in its columns."""
    compiled = re.compile(rb"(?:[ \t\r]*\n|(?:[A-Z]{3}|AC2|---)[ -][^\n]*\n)*" + pattern + rb"[ \r]*(?:\n|\Z)")
    return lambda head: compiled.match(head) is not None


def _has_line(pattern: bytes) -> Callable[[bytes], bool]:
    """Whether any line begins like that: reports that stand in letters, below words."""
    compiled = re.compile(rb"^" + pattern, re.M)
    return lambda head: compiled.search(head) is not None


_FREQUENCIES = _begins(
    rb"(?:#[^\n]*\n\s*)*(?:\d{5}\.\d+|\d\d/\d\d/\d\d \d\d:\d\d:\d\d\.\d*)[ \t]+\d{7,}(?:\.\d*)?[ \t]+\S+[ \t]+\d{1,4}\b"
)
_PLAIN = _begins(rb"(?:#[^\n]*\n\s*)*[0-3]\s+\S+\s+\S+\s+[12]\d{3}\s+\d+\s+\d+\s+\d+\s+\d+\s+\d+\.\d*\s")

TABLE = "CSV"
FORMATS: Mapping[str, Format] = {  # name: how it is told, who reads it
    "SP3": Format(_begins(rb"#[a-d][PV ]"), ephemeris="sp3:read"),
    "CPF": Format(_begins(_REMARKS + rb"[Hh]1\s+[Cc][Pp][Ff]\s"), ephemeris="cpf:read"),
    "CRD": Format(_begins(_REMARKS + rb"[Hh]1\s"), tracking="crd:read"),
    "B3": Format(_in_columns(rb"[A-Z][ \d]{5}[ \w]{3}\d{14}[^\n]{51}\d[^\n]*"), tracking="b3:read"),
    "observatory": Format(_begins(rb"(?:#[^\n]*\n\s*)*OBSERVATIONS OF AN OBSERVATORY"), tracking="old_table:read"),
    "plain columns": Format(_PLAIN, tracking="plain:read"),
    "ADES": Format(_begins(rb"(?:[#!][^\n]*\n)*[^\n|]*\|(?:[^\n]*\|)?\s*obsTime\s*[|\n]"), tracking="ades:read_psv"),
    "ADES XML": Format(_root(rb"ades"), tracking="ades:read_xml"),
    "TDM": Format(_begins(rb"CCSDS_TDM_VERS\s*="), tracking="tdm:read_kvn"),
    "TDM XML": Format(_root(rb"tdm"), tracking="tdm:read_xml"),
    "OEM": Format(_begins(rb"CCSDS_OEM_VERS\s*="), ephemeris="oem:read_kvn"),
    "OPM": Format(_begins(rb"CCSDS_OPM_VERS\s*="), ephemeris="opm:read_opm"),
    "OCM": Format(_begins(rb"CCSDS_OCM_VERS\s*="), ephemeris="ocm:read"),
    "OMM": Format(_begins(rb"CCSDS_OMM_VERS\s*="), ephemeris="opm:read_omm"),
    "OMM JSON": Format(_begins(rb"(?:\[\s*)?\{[^{}]*\"MEAN_MOTION\"\s*:"), ephemeris="gp:read_json"),
    "OMM table": Format(_begins(rb"(?=[^\n]*\bEPOCH\b)[^\n]*\bMEAN_MOTION\b[^\n]*,"), ephemeris="gp:read_csv"),
    "TLE": Format(_begins(rb"(?:[^\n]*\n)?1 [ 0-9A-Z]{5}[ A-Z] .{8} \d\d[ \d]{3}\."), ephemeris="tle:read"),
    "OCM XML": Format(_root(rb"ocm"), ephemeris="ocm_xml:read_xml"),
    "OEM XML": Format(_root(rb"(?:oem|opm|omm|ndm)"), ephemeris="odm_xml:read"),
    "MPC": Format(_has_line(rb"[^\n]{15}\d{4} [ \d]\d [ \d]\d[^\n]{54}\S[ \r]*$"), tracking="mpc:read"),
    "IOD": Format(_has_line(rb"[ \d]{5} [ \d]{2} [ \d]{3}[A-Z ]{3} \d{4} [A-Z ] \d{8}"), tracking="visual:read_iod"),
    "UK": Format(_has_line(rb"\d{5}\w{2}\d{10}[ \d]{15}[ \d][1-9][ \d]{8}"), tracking="visual:read_uk"),
    "RDE": Format(_has_line(rb"\d{4} \d{4} \d\.\d{3} [ \d]{4}[ \r]*\n\d\d?[ \r]*\n"), tracking="visual:read_rde"),
    "frequencies": Format(_FREQUENCIES, tracking="radio:read"),
    TABLE: Format(table_header.looks, tracking="table:read"),
}


_READ_BY = {"repair": ("B3",), "debias": ("MPC", "ADES", "ADES XML")}  # options that readers take, not `with_conventions`


def recognise(data: bytes) -> str | None:
    """Name of the format in `FORMATS` that some bytes are of, None where they are of none."""
    head = data[:HEAD]
    return next((name for name, form in FORMATS.items() if form.looks(head)), None)


def read_tracking(*paths: str | os.PathLike[str], **conventions: Any) -> Observations:
    """Measurements of files of tracking data, recognised by what is in them; ``.gz`` and ``.Z`` are taken as they are.

    States of ephemerides are fixes: rows ``x``, ``y``, ``z``, and ``vx``, ``vy``, ``vz`` where there are velocities.

    Parameters
    ----------
    paths : files, put together in this order
    conventions : what the files do not say, see `formats.conventions.Conventions`: ``range="two-way"``, ``time="GPS"``,
        ``angles="geocentric"``, ``sigma="range.BER=10m"``, ``columns="week=gps_week sow=gps_tow x=X[km]"``

    Raises
    ------
    OSError
        Where a file cannot be read.
    ValueError
        With file, line and reason: for a format that is not known, a broken file, or a convention that contradicts it.
    """
    from piazzi.formats.joining import concatenate

    told = Conventions.of(**conventions)
    forms: list[Format] = []
    rows = concatenate(_tracking(path, told, forms) for path in paths)
    first = told_path(paths[0])
    if told.columns and FORMATS[TABLE] not in forms:
        raise ValueError(f"--columns says what columns of tables are: {first} is none")
    unread = [f"--{name}" for name, of in _READ_BY.items() if told.option(name) and not any(FORMATS[k] in forms for k in of)]
    if told.scales and _says_scales(rows, paths, told):
        unread.append("--time")
    for option in (*unread, *without_effect(rows, told)):
        _log.info("%s changes nothing: %s says it itself, or measures nothing of the kind", option, first)
    return with_conventions(rows, told)


def _says_scales(rows: Observations, paths: Iterable[str | os.PathLike[str]], told: Conventions) -> bool:
    """Whether files mean the same rows when nothing is told of time scales."""
    from piazzi.formats.joining import concatenate

    try:
        alone = concatenate(_tracking(path, replace(told, scales=()), []) for path in paths)
    except ValueError:
        return False
    return (
        alone.open == rows.open
        and alone.segments == rows.segments
        and alone.epoch == rows.epoch
        and np.array_equal(alone.t, rows.t)
    )


def tracking_of(data: bytes, name: str, **conventions: Any) -> Observations:
    """Measurements of the text of some of a file, which `name` is in messages; as `read_tracking` otherwise.

    What is told of stations that are not in it is of others.
    """
    told = replace(Conventions.of(**conventions), partial=True)
    return with_conventions(_of_format(data, _format(data, name, bool(told.columns)), name, told), told)


def _tracking(path: str | os.PathLike[str], told: Conventions, forms: list[Format]) -> Observations:
    """Measurements of a file, whose format goes among `forms`."""
    data, form, name = _opened(path, bool(told.columns))
    forms.append(form)
    return _of_format(data, form, name, told)


def _of_format(data: bytes, form: Format, name: str, told: Conventions) -> Observations:
    if form.tracking is None:
        from piazzi.formats.fixes import fixes_of

        return fixes_of(_reader(str(form.ephemeris))(data, name, told), told)
    found: Observations = _reader(form.tracking)(data, name, told)
    return found


def read_ephemeris(path: str | os.PathLike[str], **conventions: Any) -> Ephemeris:
    """States of a file of ephemerides, recognised by what is in it; ``.gz`` and ``.Z`` are taken as they are.

    Raises
    ------
    OSError
        Where the file cannot be read.
    ValueError
        With file, line and reason: for a format that is not known, or a broken file.
    """
    data, form, name = _opened(path)
    if form.ephemeris is None:
        raise ValueError(f"{name}: the file holds measurements, no orbit")
    told = Conventions.of(**conventions)
    found: Ephemeris = _reader(form.ephemeris)(data, name, told)
    if told.frame is None:
        return found
    arcs = []
    for arc in found.arcs:
        own = tuple(str(settled(frame, told.frame)) for frame in arc.covariance_frames)
        arcs.append(replace(arc, frame=settled(arc.frame, told.frame), covariance_frames=own))
    return replace(found, arcs=tuple(arcs), open=tuple(text for text in found.open if "--frame" not in text))


def _opened(path: str | os.PathLike[str], named: bool = False) -> tuple[bytes, Format, str]:
    """Contents, format and name of a file; where columns are `named`, whatever is of no other format is a table."""
    name, data = told_path(path), read_bytes(path)
    return data, _format(data, name, named), name


def _format(data: bytes, name: str, named: bool) -> Format:
    if not data or data.isspace():
        raise ValueError(f"{name}: the file is empty")
    found = recognise(data)
    if found is None and b"<!doctype html" in data[:HEAD].lower():
        raise ValueError(f"{name}: the file is a page (HTML), and holds neither tracking nor an orbit")
    if found is None and (doctype := data[:HEAD].find(b"<!DOCTYPE")) >= 0:
        line = data.count(b"\n", 0, doctype) + 1
        raise ValueError(f"{name}: line {line}: the file has a DOCTYPE, which may name other files; it is not read")
    if found is None and data.startswith(b"%=SNX"):
        raise ValueError(f"{name}: the file is SINEX, which says where stations are: give it as --stations {name}")
    if found is None and named:
        found = TABLE
    if found is None and data[:1] == b"{" and b"piazzi.determine/" in data[:HEAD]:
        raise ValueError(f"{name}: the file is a determination: piazzi propagate {name} -o orbit.oem makes a file of its orbit")
    if found is None:
        parted = any(mark in data[:HEAD] for mark in b",;\t")
        hint = '; of a table say the columns, as --columns "time=T range=RNG[km]"' if parted else ""
        raise ValueError(f"{name}: line 1: the file is of no format that is known: {', '.join(_names())}{hint}")
    return FORMATS[found]


def _names() -> Iterator[str]:
    yield from dict.fromkeys(name.removesuffix(" XML") for name in FORMATS)


def _reader(where: str) -> Callable[[bytes, str, Conventions], Any]:
    module, _, function = where.partition(":")
    reader: Callable[[bytes, str, Conventions], Any] = getattr(import_module(f"piazzi.formats.{module}"), function)
    return reader
