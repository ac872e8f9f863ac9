"""Axes by the names that files give them."""

from __future__ import annotations

import re

from piazzi.earth import FRAMES

LOCAL = ("RTN", "RSW", "RIC", "TNW", "TNW_ROTATING", "RTN_ROTATING")  # those of the orbit
KNOWN = (*FRAMES, "ICRF", *LOCAL)
_WORDS = {"TOD_EARTH": "TOD", "MOD_EARTH": "MOD", "J2000": "EME2000", "TOD_IAU2006": "TOD", "PEF_IAU2006": "PEF"}


def frame_named(text: str) -> str:
    """The name by which `earth` knows the axes that a file names: ``ITRF-97`` is ITRF; unknown ones as they are."""
    name = text.strip().upper().replace(" ", "")
    name = _WORDS.get(name, name)
    if re.fullmatch(r"ITRF[-_]?\d{2,4}", name):
        return "ITRF"
    return name if name in KNOWN else text.strip()


def settled(name: str | None, told: str | None) -> str | None:
    """The axes of a file, or those that the user says they are, where the file names none, or some that nobody knows."""
    return told if told is not None and name not in KNOWN else name
