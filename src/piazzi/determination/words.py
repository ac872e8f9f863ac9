"""Lists of ``name=value`` as users write them: a number is joined to its unit, a date to its scale, a stray word refused."""

from __future__ import annotations

import re
from math import isfinite

from piazzi.earth import Epoch
from piazzi.text import nearest, one_line
from piazzi.units import Units

_NUMBER = re.compile(r"([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)(.*)", re.ASCII | re.DOTALL)


def pairs(text: str, what: str, known: tuple[str, ...], example: str) -> dict[str, str]:
    """The names and values of a list; raises ValueError for a stray word, an unknown name or one that is given twice."""
    found: dict[str, str] = {}
    for word in text.split():
        name, equals, value = word.partition("=")
        if not equals or not value:
            raise ValueError(
                f"{what}: {one_line(word, 60)!r} stands alone: join a number to its unit, a date to its scale, as in {example}"
            )
        if name not in known:
            raise ValueError(f"{what}: unknown name {one_line(name, 60)!r}{nearest(name[:60], known)}")
        if name in found:
            raise ValueError(f"{what}: {name} is given twice")
        found[name] = value
    return found


def quantity(text: str, unit: str, what: str) -> float:
    """A number joined to its unit, in SI; a plain number where `unit` is ""."""
    match, short = _NUMBER.fullmatch(text.strip()), what.rpartition(": ")[2]
    if match is None or not isfinite(value := float(match[1])):
        raise ValueError(f"{what} is {one_line(text, 60)!r}; write a number joined to its unit, such as {short}=1{unit}")
    said = match[2].strip()
    if not said and unit:
        raise ValueError(
            f"{what} is {one_line(text, 60)!r}, without a unit: write such as {short}={one_line(match[1], 40)}{unit}"
        )
    try:
        found = Units().unit(said or "1")
    except ValueError as error:
        raise ValueError(f"{what}: {error}") from None
    if found.powers != Units().unit(unit or "1").powers:
        raise ValueError(
            f"{what} is {one_line(text, 60)!r}; it must be {f'in a unit such as {unit}' if unit else 'a plain number'}"
        )
    return value * found.factor


def date(text: str, what: str) -> Epoch:
    """A date with its scale."""
    try:
        return Epoch(text)
    except ValueError as error:
        raise ValueError(f"{what}: {error}") from None
