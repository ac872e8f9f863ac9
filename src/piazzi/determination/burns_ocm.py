"""Manoeuvres of an orbit comprehensive message in KVN (CCSDS 502.0-B-3, 6.2.8): one line each of a block MAN."""

from __future__ import annotations

import re
from collections.abc import Iterator

NEEDED = ("DV_X", "DV_Y", "DV_Z")
UNITS = {"DV_X": "km/s", "DV_Y": "km/s", "DV_Z": "km/s"}  # as the standard has them where a file does not say


def burns_of_ocm(text: str, where: str) -> Iterator[tuple[int, dict[str, str]]]:
    """Line number and words of each manoeuvre, as a table of manoeuvres has them.

    Raises
    ------
    ValueError
        With the line: for a composition without a velocity or a time, and rows that are not as long.
    """
    scale, zero = "UTC", ""
    block: dict[str, str] = {}
    inside = False
    for number, raw in enumerate(text.splitlines(), start=1):
        line = raw.strip()
        if line in ("MAN_START", "MAN_STOP"):
            inside, block = line == "MAN_START", {}
            continue
        key, equals, value = (part.strip() for part in line.partition("="))
        if equals and re.fullmatch(r"[A-Z_0-9]+", key):
            if key == "TIME_SYSTEM":
                scale = value
            elif key == "EPOCH_TZERO":
                zero = value
            elif inside:
                block[key] = value
        elif inside and line and not line.startswith("COMMENT"):
            yield number, _row(line, block, scale, zero, f"{where}, line {number}")


def _row(line: str, block: dict[str, str], scale: str, zero: str, where: str) -> dict[str, str]:
    names = [name.strip() for name in block.get("MAN_COMPOSITION", "").split(",")]
    values = line.split()
    if len(values) != len(names):
        raise ValueError(f"{where}: a manoeuvre has {len(names)} values as MAN_COMPOSITION says, not {len(values)}")
    said = dict(zip(names, values, strict=True))
    missing = [name for name in NEEDED if name not in said]
    if missing:
        raise ValueError(f"{where}: MAN_COMPOSITION has no {missing[0]}; manoeuvres are taken as changes of velocity")
    units = dict(zip(names, (u.strip() for u in block.get("MAN_UNITS", "").strip("[]").split(",")), strict=False)) or UNITS
    out = {"time": _time(said, scale, zero, where), "axes": block.get("MAN_REF_FRAME", "TNW")}
    for i, name in enumerate(NEEDED, start=1):
        out[f"dv_{i}"] = f"{said[name]}{units.get(name, UNITS[name])}"
    if float(said.get("MAN_DURA", 0.0)) > 0.0:
        out["for"] = f"{said['MAN_DURA']}s"
    return out


def _time(said: dict[str, str], scale: str, zero: str, where: str) -> str:
    if "TIME_ABSOLUTE" in said:
        return f"{said['TIME_ABSOLUTE'].rstrip('Z')}[{scale}]"
    if "TIME_RELATIVE" in said and zero:
        from piazzi.earth import Epoch

        begin = Epoch(f"{zero.rstrip('Z')} {scale}")
        return (begin + float(said["TIME_RELATIVE"])).to("TT")
    raise ValueError(f"{where}: MAN_COMPOSITION has neither TIME_ABSOLUTE nor TIME_RELATIVE with EPOCH_TZERO")
