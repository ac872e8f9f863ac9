"""Readers of what users give for an option: each takes a value and where it was said, and refuses what cannot be."""

from __future__ import annotations

from math import isfinite
from typing import Any

from piazzi.text import one_line


def anything(value: Any, where: str) -> Any:
    """As it is: who uses it says what is wrong with it."""
    return value


def flag(value: Any, where: str) -> bool:
    """Said or not."""
    if not isinstance(value, bool):
        raise ValueError(f"{where} is {one_line(repr(value), 60)}; it is true or false")
    return value


def number(value: Any, where: str) -> float:
    """A finite number."""
    try:
        found = float(value)
    except (TypeError, ValueError):
        raise ValueError(f"{where} is {one_line(str(value), 60)!r}, which is no number") from None
    if not isfinite(found):
        raise ValueError(f"{where} is {one_line(str(value), 60)}; it must be a finite number")
    return found


def positive(value: Any, where: str) -> float:
    """A positive number."""
    found = number(value, where)
    if found <= 0.0:
        raise ValueError(f"{where} is {one_line(str(value), 60)}; it must be positive")
    return found


def duration(value: Any, where: str) -> float:
    """A length of time, as text with a unit, or a number of seconds."""
    from piazzi.determination.words import seconds

    return seconds(value, where) if isinstance(value, str) else positive(value, where)


def instant(value: Any, where: str) -> Any:
    """A date: text stays, as its scale is that of the answer."""
    from piazzi.earth import Epoch

    try:
        Epoch(value)
    except (TypeError, ValueError) as error:
        raise ValueError(f"{where}: {error}") from None
    return value


def span(value: Any, where: str) -> Any:
    """Two ends with .. between them."""
    from piazzi.determination.products import check_span

    check_span(value)
    return value


def estimators(value: Any, where: str) -> Any:
    """Estimators as text, or objects by name."""
    from piazzi.determination.fit import estimators as read

    try:
        read(value)
    except ValueError as error:
        raise ValueError(f"{where}: {error}") from None
    return value


def unknowns(value: Any, where: str) -> Any:
    """Unknowns as words or objects."""
    from piazzi.determination.unknowns import listed

    listed(value)
    return value


def uncertain(value: Any, where: str) -> Any:
    """Constants with their sigmas."""
    from piazzi.determination.unknowns import considered

    considered(value)
    return value


def axes(value: Any, where: str) -> str:
    """The name of a frame."""
    from piazzi.earth.rotation import frame_named

    return frame_named(str(value))


def texts(value: Any, where: str) -> tuple[str, ...]:
    """Several words."""
    found = (value,) if isinstance(value, str) else tuple(value)
    if not all(isinstance(one, str) for one in found):
        raise ValueError(f"{where} is {one_line(repr(value), 60)}; it must be text, or a list of texts")
    return found
