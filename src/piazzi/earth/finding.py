"""Files of data on the user's disk: in which folders they are looked for, and what each is, by its content."""

from __future__ import annotations

import os
import re
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Literal

from piazzi.opening import opened

KINDS = ("eop", "weather", "kernel", "stations", "field")
_MOST = 1000  # files of a folder that are looked at
_RECORD = 1024  # bytes of a DAF record
_given: list[Path] = []


def use_data(folder: str | Path) -> None:
    """Look for data in this folder first, from now on.

    Raises OSError where it is none.
    """
    place = Path(folder)
    with os.scandir(place):
        pass
    if place not in _given:
        _given.insert(0, place)


def data_folders() -> list[Path]:
    """Folders where data are looked for, the first first: those of `use_data`, ``PIAZZI_EARTH``, the user's data folder."""
    named = os.environ.get("PIAZZI_EARTH")
    return [*_given, *([Path(named)] if named else []), user_folder()]


def user_folder() -> Path:
    """Where downloads go unless a folder is given: ``XDG_DATA_HOME``/piazzi, else ~/.local/share/piazzi."""
    home = os.environ.get("XDG_DATA_HOME")
    return (Path(home) if home else Path.home() / ".local" / "share") / "piazzi"


def recognise(path: str | Path) -> str | None:
    """What a file is, one of `KINDS`, by its content; None for anything else, and for what cannot be read."""
    try:
        with opened(path) as file:
            start = file.read(16384)
    except OSError:
        return None
    text = start.decode("latin-1")
    first = text.split("\n", 1)[0].rstrip("\r")
    if start.startswith((b"DAF/SPK", b"NAIF/DAF")):
        return "kernel"
    if first.startswith("DATE,BSRN,ND,KP1") or re.match(r"(?i)DATATYPE\s+CssiSpaceWeather", first):
        return "weather"
    if "C04" in "\n".join(text.splitlines()[:20]) or (len(first) >= 187 and re.match(r"[ \d]{6} \d{5}\.\d\d ", first)):
        return "eop"
    if re.search(r"(?mi)^end_of_head", text) and "gravity_constant" in text:
        return "field"
    if (
        first.startswith("%=SNX")
        or re.search(r"(?m)^\[\[stations\]\]", text)
        or re.search(r"(?m)^\w\d\d [ \d]{2}\d\.\d{4}", text)
    ):
        return "stations"
    return None


def found(kind: str) -> Iterator[Path]:
    """Files of a kind in the folders where data are looked for, by name within each."""
    for folder in data_folders():
        try:
            names = sorted(entry.name for entry in os.scandir(folder) if entry.is_file())
        except OSError:
            continue
        for name in names[:_MOST]:
            if not name.startswith(".") and recognise(folder / name) == kind:
                yield folder / name


def check_kernel(path: str | Path) -> None:
    """Raise ValueError where a file is no binary SPK kernel, is cut short, or its list of contents leads in circles."""
    name = Path(path).name
    with opened(path) as file:
        head = file.read(_RECORD)
        size = file.seek(0, os.SEEK_END)
        if not head.startswith(b"DAF/SPK") or len(head) < _RECORD:
            raise ValueError(f"{name} is no binary SPK kernel of JPL")
        order: Literal["little", "big"] = "little" if head[88:96] == b"LTL-IEEE" else "big"
        wanted = 8 * (int.from_bytes(head[84:88], order) - 1)
        if size < wanted:
            raise ValueError(f"{name} has {size:,} of at least {wanted:,} bytes")
        record, seen = int.from_bytes(head[76:80], order), set[int]()
        while record:
            if record in seen or not 1 < record <= size // _RECORD:
                raise ValueError(f"{name} is damaged: its list of contents goes to record {record}")
            seen.add(record)
            file.seek((record - 1) * _RECORD)
            following, _, count = struct.unpack("<3d" if order == "little" else ">3d", file.read(24))
            if not (0.0 <= count <= 25.0 and 0.0 <= following <= size // _RECORD):
                raise ValueError(f"{name} is damaged: record {record} of its list of contents")
            record = int(following)
