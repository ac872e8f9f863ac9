"""Readers of what users give for an option: each takes a value and where it was said, and refuses what cannot be."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from math import isfinite
from typing import Any

from piazzi.text import one_line
from piazzi.units import positive_duration

_PLAIN = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)


@contextmanager
def _said_at(where: str, kinds: tuple[type[Exception], ...] = (ValueError,)) -> Iterator[None]:
    """Say where the value was that is refused within, by an error of these kinds."""
    try:
        yield
    except kinds as error:
        raise ValueError(f"{where}: {error}") from None


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


def measure(unit: str, least: float | None = None) -> Callable[[Any, str], float]:
    """Makes a reader of numbers in a unit, which may be joined to them; they are above `least`."""

    def read(value: Any, where: str) -> float:
        from piazzi.determination.words import quantity

        text = str(value).strip()
        if isinstance(value, str) and not _PLAIN.fullmatch(text):
            if not text[:1].isdigit() and text[:1] not in "+-.":
                number(value, where)
            value = quantity(re.sub(r"m\^?2$", "m**2", text), unit, where)
        return number(value, where) if least is None else positive(value, where)

    return read


def duration(value: Any, where: str) -> float:
    """A length of time, as text with a unit, or a number of seconds."""
    return positive_duration(value, where) if isinstance(value, str) else positive(value, where)


def instant(value: Any, where: str) -> Any:
    """A date: text stays, as its scale is that of the answer."""
    from piazzi.earth import Epoch

    with _said_at(where, (TypeError, ValueError)):
        Epoch(value)
    return value


def span(value: Any, where: str) -> Any:
    """Two ends with .. between them."""
    from piazzi.determination.arcs import check_span

    check_span(value)
    return value


def estimators(value: Any, where: str) -> Any:
    """Estimators as text, or objects by name."""
    from piazzi.determination.fit import estimators as read

    with _said_at(where):
        read(value)
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


def text(value: Any, where: str) -> str:
    """Text that is not empty."""
    if not isinstance(value, str) or not value.strip():
        raise ValueError(f"{where} is {one_line(repr(value), 60)}; it must be text")
    return value.strip()


def catalogue(value: Any, where: str) -> int:
    """A number of the catalogue of space objects."""
    found = str(value).strip()
    if isinstance(value, bool) or not found.isdecimal() or not found.isascii() or not 0 < int(found) < 10**9:
        raise ValueError(f"{where} is {one_line(repr(value), 60)}; it is a whole number of at most nine digits, such as 22195")
    return int(found)


def vector(value: Any, where: str) -> tuple[float, float, float]:
    """Three finite numbers."""
    if not isinstance(value, list | tuple) or len(value) != 3:
        raise ValueError(f"{where} is {one_line(repr(value), 60)}; it must be three numbers, m along R, T and N")
    x, y, z = (number(one, where) for one in value)
    return x, y, z


METHODS = {"HERMITE": 7, "LAGRANGE": 9, "LINEAR": 1}  # with their usual degrees


def interpolation(value: Any, where: str) -> tuple[str, int]:
    """A method of interpolation with its degree, as ``"Lagrange 9"``."""
    if isinstance(value, tuple):
        return str(value[0]), int(value[1])
    method, _, degree = str(value).strip().upper().partition(" ")
    plain = degree.strip() or str(METHODS.get(method, ""))
    if method not in METHODS or not plain.isdecimal() or not 0 < int(plain) < 100:
        raise ValueError(
            f"{where} is {one_line(repr(value), 60)}; write Hermite, Lagrange or Linear, and a degree: 'Lagrange 9'"
        )
    return method, int(plain)


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


def hold(value: Any, where: str) -> Any:
    """Rows to hold back, as text or a share."""
    from piazzi.determination.holding import check

    with _said_at(where):
        return check(value)


def formats(value: Any, where: str) -> str:
    """Names of formats of pictures."""
    from piazzi.determination.figures import formats_of

    return ",".join(formats_of(value))


def width(value: Any, where: str) -> str:
    """A width of pictures."""
    from piazzi.determination.figures import width_of

    width_of(value)
    return str(value)
